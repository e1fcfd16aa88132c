"""The flyball governor, A05 of the IFToMM library: springs so stiff that the motion hides behind them."""

import numpy as np

from physics_prior import inertia
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.spring import Spring
from physics_prior.inertia import combine, point_mass
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark
from physics_prior.studies.problems.reference_values import GOVERNOR

DENSITY = 3000.0  # kg/m^3
OFFSET = 0.05  # m, of the rods' hinges from the axis
STIFFNESS, DAMPING, REST_LENGTH = 8e5, 4e4, 0.5  # N/m, N s/m, m
DROOP = np.pi / 6.0  # rad, of the rods below horizontal at the start
SPIN = 2.0 * np.pi  # rad/s


def governor() -> Benchmark:
    """A shaft with two rods of 1 m, 5 kg at their tips, and a slider of 3 kg that springs hold to the rods' middles.

    Gravity along -z; the fastest motion decays at 7e3 1/s. Observed: height of the slider, m, at whole seconds.
    """
    rod = inertia.box(DENSITY * 1e-4, (1.0, 0.01, 0.01))
    shaft = inertia.box(DENSITY * 1e-4, (0.01, 0.01, 1.0)).transformed(np.eye(3), np.array([0.0, 0.0, 0.5]))
    parts, springs = [Part("shaft", shaft)], []
    joints = [Joint("spin", JointKind.REVOLUTE, "world", "shaft")]
    for name, side in (("right", 1.0), ("left", -1.0)):
        swung = rod.transformed(np.eye(3), np.array([0.5 * side, 0.0, 0.0]))
        parts.append(Part(name, combine([swung, point_mass(5.0, (side, 0.0, 0.0))])))
        hinge, axis = np.array([OFFSET * side, 0.0, 1.0]), np.array([0.0, side, 0.0])
        joints.append(Joint(f"{name}_hinge", JointKind.REVOLUTE, "shaft", name, hinge, axis=axis))
        springs.append(
            Spring(
                name=f"{name}_spring",
                part=name,
                point=(0.5 * side, 0.0, 0.0),
                to="slider",
                at=(OFFSET * side, 0.0, 0.0),
                stiffness=STIFFNESS,
                rest_length=REST_LENGTH,
                damping=DAMPING,
            )
        )
    parts.append(Part("slider", inertia.box(3.0, (0.1, 0.1, 0.1))))
    joints.append(Joint("height", JointKind.PRISMATIC, "shaft", "slider"))
    return Benchmark(
        Tree(parts, joints),
        (Gravity(acceleration=(0.0, 0.0, -9.81)), *springs),
        np.array([0.0, DROOP, DROOP, 0.5]),
        np.array([SPIN, 0.0, 0.0, 0.0]),
        observe=lambda run: run.q[3:],
        times=GOVERNOR[:, 0],
        values=GOVERNOR[:, 1:2],
    )
