"""Pendulums: the simple one of the IFToMM benchmark library, and two rods in a row."""

import numpy as np
from scipy.special import ellipj, ellipk

from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties, point_mass
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark, Mechanism, Run
from physics_prior.studies.problems.reference_values import DOUBLE_PENDULUM

G = 9.81
DOWN = Gravity(acceleration=(0.0, -G, 0.0))
"""The planar benchmarks stand in the plane x, y with y up and turn about z."""


def simple_pendulum(duration: float = 10.0, side: float = -1.0) -> Benchmark:
    """A01 of the IFToMM library: 1 kg on a massless metre, released at (side, 0); position x, y every 0.05 s.

    theta from hanging: sin(theta / 2) = k sn(K - t sqrt(g)), k = sin(theta0 / 2), K(k^2) a quarter of the period.
    """
    tree = Tree([Part("bob", point_mass(1.0, (0.0, -1.0, 0.0)))], [Joint("pin", JointKind.REVOLUTE, "world", "bob")])
    times = 0.05 * np.arange(1, round(duration / 0.05) + 1)
    k = np.sin(0.25 * np.pi)
    sn, _, _, _ = ellipj(ellipk(k * k) - np.sqrt(G) * times, k * k)
    theta = side * 2.0 * np.arcsin(k * sn)
    return Benchmark(
        tree,
        (DOWN,),
        np.array([side * 0.5 * np.pi]),
        np.zeros(1),
        observe=lambda run: run.point("bob", (0.0, -1.0, 0.0))[:2],
        times=times,
        values=np.stack([np.sin(theta), -np.cos(theta)], axis=1),
    )


def double_pendulum() -> Benchmark:
    """Two uniform rods of 1 m and 1 kg, released at 0.5 and 1 rad from hanging: moderate motion; the tip at whole seconds."""
    return Benchmark(
        *_two_rods(1.0, 1.0),
        np.array([0.5, 0.5]),
        np.zeros(2),
        observe=lambda run: run.point("lower", (0.0, -1.0, 0.0))[:2],
        times=DOUBLE_PENDULUM[:, 0],
        values=DOUBLE_PENDULUM[:, 1:],
    )


def uneven_pendulum(upper: float, lower: float) -> Mechanism:
    """The same two rods with masses of your choice, kg."""
    return Mechanism(*_two_rods(upper, lower), np.array([0.5, 0.5]), np.zeros(2))


def _two_rods(upper: float, lower: float) -> tuple[Tree, tuple[Gravity]]:
    def rod(mass: float) -> MassProperties:
        return MassProperties(mass, np.array([0.0, -0.5, 0.0]), mass / 12.0 * np.diag([1.0, 0.0, 1.0]))

    joints = [
        Joint("shoulder", JointKind.REVOLUTE, "world", "upper"),
        Joint("elbow", JointKind.REVOLUTE, "upper", "lower", np.array([0.0, -1.0, 0.0])),
    ]
    return Tree([Part("upper", rod(upper)), Part("lower", rod(lower))], joints), (DOWN,)


def swing_energy(run: Run, seconds: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) and total energy (k,) J of a run, every 10 steps, its start included."""
    times, energies = [run.time], [run.energy()]
    while run.time < seconds - 0.5 * h:
        run.advance(h, 10)
        times.append(run.time)
        energies.append(run.energy())
    return np.array(times), np.array(energies)
