"""Runs the schemes of a problem in turns, and tells error, energy, residual and cost of each setting."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any, Literal

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.studies.accuracy.problem import Problem
from physics_prior.studies.accuracy.trajectory import LONGEST, Scheme, Setting, Trajectory
from physics_prior.studies.problems.mechanism import Benchmark, Run

ROUNDS = 3  # of timing, all contestants in turns
REPEATED = 0.3  # s of processor time, beyond which a run is not repeated

Outcome = Literal["measured", "lost", "too slow"]
"""Of a run: at its end, without finite numbers, or beyond ``LONGEST`` (or bound to be, at the pace of a coarser step)."""


@dataclass(frozen=True)
class Point:
    """One scheme at one setting on one problem.

    Attributes:
        engine, scheme, h, tolerance: which.
        error: largest distance from the reference, in the problem's unit; infinite unless it was measured.
        energy: largest change of energy less work done, J; None where it does not stay, or is not told.
        residual: how far what holds was off at most, m.
        seconds: processor time per simulated second, the median; infinite unless it was measured.
        outcome: what became of the run.
    """

    engine: str
    scheme: str
    h: float
    tolerance: float | None
    error: float
    energy: float | None
    residual: float | None
    seconds: float
    outcome: Outcome = "measured"

    @property
    def measured(self) -> bool:
        """Whether the run came to its end."""
        return self.outcome == "measured"

    def figures(self) -> dict[str, Any]:
        """As plain data, with the simulated over the processor time; what is infinite is null."""
        figures = asdict(self) | {"real_time": 1.0 / self.seconds}
        return figures if self.measured else figures | dict.fromkeys(("error", "seconds", "real_time"))


def measure(
    problem: Problem,
    schemes: Sequence[Scheme],
    progress: Callable[[float], None] = lambda fraction: None,
    rounds: int = ROUNDS,
) -> list[Point]:
    """Every scheme at all of its settings; those finer than one too slow are too slow, and not begun."""
    benchmark = problem.make()
    judge = Judge(problem, benchmark)
    duration = float(benchmark.times[-1])
    points: dict[tuple[int, Setting], Point] = {}
    times: dict[tuple[int, Setting], list[float]] = {}
    for index, scheme in enumerate(schemes):
        expected = 0.0
        for place, setting in enumerate(scheme.settings):
            if place and setting.tolerance is None:
                expected *= scheme.settings[place - 1].h / setting.h
            if expected > LONGEST:
                points[index, setting] = without(scheme, setting, "too slow")
                continue
            try:
                found = scheme.trajectory(benchmark, setting)
            except SimulationError:
                points[index, setting] = without(scheme, setting, "lost")
                continue
            expected = found.seconds
            points[index, setting] = judge.point(scheme, setting, found)
            if points[index, setting].measured:
                times[index, setting] = []
        progress((index + 1) / len(schemes) * 0.5)
    # the runs above have warmed everything up; these are those that count
    for done in range(rounds):
        for (index, setting), taken in times.items():
            if not taken or taken[0] < REPEATED:
                taken.append(schemes[index].trajectory(benchmark, setting).seconds)
        progress(0.5 + 0.5 * (done + 1) / rounds)
    return [
        replace(point, seconds=median(times[key]) / duration) if key in times else point
        for key, point in points.items()
    ]


class Judge:
    """What is right: the reference, the energy at the start, and our constraints."""

    def __init__(self, problem: Problem, benchmark: Benchmark) -> None:
        self._problem, self._benchmark = problem, benchmark
        simulator = Simulator(benchmark.tree, benchmark.effects)
        self._run = Run(simulator, benchmark.q.copy(), benchmark.v.copy())
        self._start = self._run.energy()

    def point(self, scheme: Scheme, setting: Setting, found: Trajectory) -> Point:
        """The figures of a trajectory, without its time."""
        if found.q is None:
            return without(scheme, setting, "too slow")
        if not np.all(np.isfinite(found.q)):
            return without(scheme, setting, "lost")
        error, energy, residual = 0.0, 0.0, 0.0
        tells_energy = found.v is not None and self._problem.conservative
        for k, value in enumerate(self._benchmark.values):
            self._run.q[:] = found.q[k]
            self._run.v[:] = self._benchmark.v if found.v is None else found.v[k]
            error = max(error, self._benchmark.distance(self._benchmark.observe(self._run), value))
            residual = max(residual, self._run.residual())
            if tells_energy:
                energy = max(energy, abs(self._run.energy() - self._start - self._work()))
        own = residual if found.residual is None else found.residual
        told = energy if tells_energy else None
        return Point(scheme.engine, scheme.name, setting.h, setting.tolerance, error, told, own, math.inf)

    def _work(self) -> float:
        """Of the constant forces, J."""
        tau = self._benchmark.tau
        return 0.0 if tau is None else float(tau @ (self._run.q - self._benchmark.q))


def without(scheme: Scheme, setting: Setting, outcome: Outcome) -> Point:
    """A setting that has no figures, and why."""
    return Point(scheme.engine, scheme.name, setting.h, setting.tolerance, math.inf, None, None, math.inf, outcome)
