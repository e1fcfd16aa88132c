"""Stiff springs and dampers: right, or refused; never silently wrong."""

import numpy as np

from physics_prior import inertia
from physics_prior.dynamics.integrators import INTEGRATORS, IntegratorName
from physics_prior.effects import Effect
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.errors import SimulationError
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.governor import governor
from physics_prior.studies.problems.mechanism import Mechanism, Run
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case

STEP = 1e-3  # s
STIFF: IntegratorName = "lobatto_iiic"
"""The integrator for stiff scenes: it damps what it cannot follow."""

FOLLOWED = 0.5  # of the start: a motion that explodes leaves this far behind


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
    silent = 0
    for name in INTEGRATORS:
        for h in (5e-3, 1e-3):
            try:
                _, found = benchmark.errors(benchmark.run(name), h)
            except SimulationError:
                continue
            silent += found.max() > WRONG
            curves.append(Curve(f"{name}, {1e3 * h:g} ms", benchmark.times, found))
    yield Check(f"of {2 * len(INTEGRATORS)} runs at 1 and 5 ms, finished and more than {1e3 * WRONG:g} mm off", float(silent), 0.0)
    yield Picture(
        "governor",
        "Flyball governor: height of the slider",
        "time [s]",
        "error [m]",
        curves,
        "y",
        (("bound at 1 ms", 1e-4), ("MuJoCo implicit, 1 ms", 0.082)),
    )
