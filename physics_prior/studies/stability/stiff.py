"""Stiff springs and dampers: right, or refused; never silently wrong."""

import numpy as np

from physics_prior import inertia
from physics_prior.dynamics.integrators import INTEGRATORS, IntegratorName
from physics_prior.effects import Effect
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.errors import SimulationError
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.governor import governor
from physics_prior.studies.problems.mechanism import Mechanism, Run
from physics_prior.studies.problems.pendulum import double_pendulum
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case

STEP = 1e-3  # s
STIFF: IntegratorName = "lobatto_iiic"
"""The integrator for stiff scenes: it damps what it cannot follow."""

QUICK: tuple[IntegratorName, ...] = ("rk4",)
ALL: tuple[IntegratorName, ...] = tuple(INTEGRATORS)

DOUBLE = 2.0  # times the energy of the start: what no damped motion has


@case(
    7,
    "Flyball governor with stiff springs, 1 ms",
    "MuJoCo implicit 0.082 m, silently; RK4 and Euler unstable at 1 ms",
)
def stiff_governor(thorough: bool) -> Measurements:
    """Springs whose motion decays at 7e3 1/s: the slider's height over 10 s, whatever the integrator, or a refusal."""
    benchmark = governor()
    run, times, errors = benchmark.run(STIFF), [], []
    for time, value in zip(benchmark.times, benchmark.values, strict=True):
        run.to(float(time), STEP)
        times.append(time)
        errors.append(benchmark.distance(benchmark.observe(run), value))
    yield Check(f"slider over 10 s, {STIFF}, 1 ms", max(errors), 1e-4, "m")
    curves = [Curve(f"{STIFF}, 1 ms", np.array(times), np.array(errors))]
    _, best = benchmark.errors(benchmark.run("rk4"), 1e-4)
    yield Check("slider over 10 s, rk4, 0.1 ms", float(best.max()), 1e-6, "m")
    curves.append(Curve("rk4, 0.1 ms", benchmark.times, best))
    finished = 0.0
    for name in ALL if thorough else QUICK:
        try:
            _, found = benchmark.errors(benchmark.run(name), STEP)
        except SimulationError:
            continue
        finished = max(finished, float(found.max()))
        if name != STIFF:
            curves.append(Curve(f"{name}, 1 ms", benchmark.times, found))
    yield Check("slider over 10 s, 1 ms, worst of all integrators that do not refuse it", finished, 1e-4, "m")
    yield Picture(
        "governor",
        "Flyball governor: height of the slider",
        "time [s]",
        "error [m]",
        curves,
        "y",
        (("bound at 1 ms", 1e-4), ("MuJoCo implicit, 1 ms", 0.082)),
    )


@case(8, "Stiff position control, omega h from 0.1 to 100", "mujoco #3443")
def stiff_control(thorough: bool) -> Measurements:
    """Springs and dampers hold the joints of a two-link arm, damped critically, a little, and not at all."""
    rises, left, curves = 0.0, 0.0, []
    for ratio in (0.0, 0.1, 1.0):
        for omega_h in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
            energies = _held(STIFF, omega_h, ratio)
            rises = max(rises, float(np.max(np.diff(energies))) / energies[0])
            if ratio == 1.0:
                left = max(left, energies[-1] / energies[0])
                curves.append(Curve(f"omega h = {omega_h:g}", np.arange(len(energies)), np.maximum(energies, 1e-20)))
    yield Check(f"largest rise of the energy in a step, {STIFF}, of the start", rises, 1e-12)
    yield Check(f"energy left after 300 steps, damped critically, {STIFF}", left, 1e-6)
    gained = 0
    for name in ALL if thorough else QUICK:
        for omega_h in (3.0, 10.0, 100.0):
            try:
                gained += bool(np.max(_held(name, omega_h, 1.0)[1:]) > energies[0] * DOUBLE)
            except SimulationError:
                continue
    yield Check("runs of all integrators that ended with twice the energy and were not refused", float(gained), 0.0)
    yield Picture(
        "stiff_control", f"Stiff position control, damped critically, {STIFF}", "step", "energy [J]", curves, "y"
    )


def _held(name: IntegratorName, omega_h: float, ratio: float) -> np.ndarray:
    """Energies (301,), J, of an arm whose joints are held by springs of a frequency omega, with a share of critical damping."""
    arm = double_pendulum()
    omega, joints = omega_h / STEP, [joint.name for joint in arm.tree.joints]
    springs = JointSpring(stiffness=dict.fromkeys(joints, omega**2), damping=dict.fromkeys(joints, 2.0 * ratio * omega))
    run = Mechanism(arm.tree, (springs,), np.array([0.3, -0.2]), np.array([1.0, 2.0])).run(name)
    out = [run.energy()]
    for _ in range(300):
        run.advance(STEP)
        out.append(run.energy())
    return np.array(out)


@case(9, "Strong joint damping, C h / I = 100", "gz-physics #803")
def strong_damping(thorough: bool) -> Measurements:
    """A wheel and an arm: the rate falls at every step and never changes its sign."""
    wheel = Tree(
        [Part("wheel", inertia.box(12.0, (1.0, 1.0, 1.0)))], [Joint("axle", JointKind.REVOLUTE, "world", "wheel")]
    )
    moment = 2.0
    for strength in (1.0, 100.0, 1e6):
        damper: Effect = JointSpring(stiffness={"axle": 0.0}, damping={"axle": strength * moment / STEP})
        run = Mechanism(wheel, (damper,), np.zeros(1), np.ones(1)).run(STIFF)
        rates = _rates(run, 20)
        yield Check(f"smallest rate, below zero, C h / I = {strength:g}", max(0.0, -float(rates.min())), 0.0, "rad/s")
        yield Check(f"largest rise of the rate, C h / I = {strength:g}", float(np.max(np.diff(rates))), 0.0, "rad/s")
    arm = double_pendulum()
    dampers = JointSpring(stiffness={"shoulder": 0.0, "elbow": 0.0}, damping={"shoulder": 1e5, "elbow": 1e4})
    run = Mechanism(arm.tree, (dampers,), arm.q, np.array([3.0, -2.0])).run(STIFF)
    energies = [run.energy()]
    for _ in range(50):
        run.advance(STEP)
        energies.append(run.energy())
    yield Check(
        "largest rise of an arm's energy in a step, of the start", float(np.max(np.diff(energies))) / energies[0], 0.0
    )


def _rates(run: Run, count: int) -> np.ndarray:
    """Rates (count + 1,) of a wheel, step by step, rad/s."""
    out = [float(run.v[0])]
    for _ in range(count):
        run.advance(STEP)
        out.append(float(run.v[0]))
    return np.array(out)
