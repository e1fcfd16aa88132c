"""Smooth motion: pendulums over long times, orders of convergence, and steps that become smaller."""

from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from physics_prior import rotations
from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems import pendulum
from physics_prior.studies.problems.bricard import bricard
from physics_prior.studies.problems.four_bar import four_bar
from physics_prior.studies.problems.mechanism import Benchmark, turn
from physics_prior.studies.problems.tops import heavy_top
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case

SHORTFALL = 0.2  # of the order that a fitted slope may show
HALVINGS = 4
COARSEST = {1: 1e-3, 2: 5e-3, 4: 2e-2}
"""Order -> s, the first of the steps that are halved: the smallest must stay clear of rounding."""
QUICK = ("rk4", "semi_implicit_euler")
ADAPTED = 0.1  # s, of what an adaptive integrator divides as it needs

FLOOR = 1e-8  # m or rad: what rounding has made of itself by then need not fall further with the step


@case(
    1,
    "Simple pendulum: 10 s, and 2000 s",
    "1 ms: MuJoCo RK4 3.6e-11 m, Euler 2.2e-3 m; Exudyn 1.2e-4 m",
)
def simple_pendulum(thorough: bool) -> Measurements:
    """Position and energy of the IFToMM pendulum, against its elliptic functions."""
    benchmark = pendulum.simple_pendulum()
    run = benchmark.run()
    times, errors = benchmark.errors(run, 1e-3)
    yield Check("position error over 10 s, RK4, 1 ms", float(errors.max()), 1e-6, "m")
    drift = _energy_drift(benchmark, 1e-3, 10.0)
    yield Check("energy error over 10 s, RK4, 1 ms", drift, 5e-5, "J")
    _, best = benchmark.errors(benchmark.run(), 2e-4)
    yield Check("position error over 10 s, RK4, 0.2 ms", float(best.max()), 1e-9, "m")
    long = pendulum.simple_pendulum(2000.0 if thorough else 100.0, side=1.0)
    long_times, long_errors = long.errors(long.run(), 1e-3)
    yield Check("position error over 2000 s, released at x = 1 m", float(long_errors.max()), 1e-3, "m")
    yield Picture(
        "simple_pendulum",
        "Simple pendulum: how the error grows over 2000 s",
        "time [s]",
        "position error [m]",
        [
            Curve("1 ms, 2000 s", long_times, np.maximum.accumulate(long_errors)),
            Curve("1 ms, 10 s", times, np.maximum.accumulate(errors)),
            Curve("0.2 ms, 10 s", times, np.maximum.accumulate(best)),
        ],
        "xy",
        (("bound over 2000 s", 1e-3), ("bound over 10 s", 1e-6)),
    )


def _energy_drift(benchmark: Benchmark, h: float, seconds: float) -> float:
    """Largest difference of the energy from its start, J, at the benchmark's times."""
    run = benchmark.run()
    start, worst = run.energy(), 0.0
    for time in benchmark.times[benchmark.times <= seconds]:
        run.to(float(time), h)
        worst = max(worst, abs(run.energy() - start))
    return worst


@case(
    2,
    "Order of convergence: double pendulum and ball joint",
    "MuJoCo and Pinocchio RK4: 4.0, the Eulers 1.0; Exudyn 2.0",
)
def convergence(thorough: bool) -> Measurements:
    """Every integrator, over four halvings of the step, against references of other origin."""
    curves = []
    for name, integrator in INTEGRATORS.items():
        if not thorough and name not in QUICK:
            continue  # each takes long to compile
        for benchmark, mechanism in ((pendulum.double_pendulum(), "double pendulum"), (_ball_pendulum(), "ball joint")):
            if integrator.adaptive:
                error = float(benchmark.errors(benchmark.run(name), ADAPTED, until=1.0)[1][-1])
                yield Check(f"error, {name}, which chooses its steps, {mechanism}", error, 1e-9)
                continue
            coarsest = COARSEST[integrator.order]
            steps = coarsest * 0.5 ** np.arange(HALVINGS + 1)
            errors = np.array([benchmark.errors(benchmark.run(name), h, until=1.0)[1][-1] for h in steps])
            slope = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
            shortfall = integrator.order - slope
            yield Check(f"order {integrator.order} less the slope, {name}, {mechanism}", shortfall, SHORTFALL)
            if integrator.order >= 4:
                yield Check(f"error at the smallest step, {name}, {mechanism}", float(errors[-1]), 1e-9)
            curves.append(Curve(f"{name}, {mechanism}: slope {slope:.2f}", steps, errors))
    yield Picture("convergence", "Order of convergence over 1 s", "step [s]", "error [m or rad]", curves, "xy")


@cache
def _ball_pendulum() -> Benchmark:
    """An uneven body on a ball joint, 1 s; its orientation by Euler's equations and DOP853 at 1e-13."""
    body = MassProperties(1.0, np.array([0.05, 0.0, -0.3]), np.diag([0.02, 0.03, 0.01]))
    tree = Tree([Part("bob", body)], [Joint("ball", JointKind.SPHERICAL, "world", "bob")])
    gravity = np.array([0.0, 0.0, -9.81])
    q, v = rotations.exp([0.7, 0.2, 0.1]), np.array([1.0, -2.0, 3.0])
    about_pin = body.about(np.zeros(3))

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4], y[4:]
        weight = rotations.rotate(rotations.conjugate(q), gravity) * body.mass
        torque = np.cross(body.center_of_mass, weight) - np.cross(w, about_pin @ w)
        return np.concatenate([rotations.derivative(q, w), np.linalg.solve(about_pin, torque)])

    found = solve_ivp(rate, (0.0, 1.0), np.concatenate([q, v]), method="DOP853", rtol=1e-13, atol=1e-13)
    end = rotations.normalize(found.y[:4, -1])
    effects = (Gravity(acceleration=(0.0, 0.0, -9.81)),)
    return Benchmark(tree, effects, q, v, observe=lambda run: run.q, times=np.ones(1), values=end[None], distance=turn)


@case(
    29,
    "Smaller steps: h, h/10, h/100",
    "Pinocchio's four-bar is 1600 times worse at 2 ms than at 5 ms",
)
def smaller_steps(thorough: bool) -> Measurements:
    """A smaller step never does worse: 1e-2, 1e-3, 1e-4 s; and steps in one call are steps one by one."""
    mechanisms = {
        "double pendulum": pendulum.double_pendulum(),
        "four-bar": four_bar(1, 10.0),
        "two four-bars": four_bar(2, 10.0),
        "Bricard": bricard(),
        "heavy top": heavy_top(),
    }
    coarsest = {"heavy top": 1e-3}
    finest = 3 if thorough else 2
    curves = []
    for name, benchmark in mechanisms.items():
        steps = coarsest.get(name, 1e-2) * 0.1 ** np.arange(finest)
        errors = np.array([benchmark.errors(benchmark.run(), h)[1].max() for h in steps])
        growth = errors[1:] / np.maximum(errors[:-1], FLOOR)
        yield Check(f"error at h/10 over that at h (from {FLOOR:g} on), {name}", float(growth.max()), 1.0)
        curves.append(Curve(name, steps, errors))
    run, split = four_bar(1).run(), four_bar(1).run()
    run.advance(1e-3, 1000)
    for _ in range(1000):
        split.advance(1e-3)
    apart = max(np.max(np.abs(run.q - split.q)), np.max(np.abs(run.v - split.v)))
    yield Check("1000 steps in one call less 1000 calls", float(apart), 0.0)
    yield Picture(
        "smaller_steps",
        "Smaller steps: worst error over the benchmark's time",
        "step [s]",
        "error [m or rad]",
        curves,
        "xy",
    )
