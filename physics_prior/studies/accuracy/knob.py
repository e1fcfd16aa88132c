"""A tolerance that is asked for, put to the test: what the step chosen for it errs and costs where the motion is known."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from rich.table import Table

from physics_prior import __version__
from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SceneError
from physics_prior.scene import Step
from physics_prior.stepping.choice import cheapest
from physics_prior.stepping.course import Course, Follower
from physics_prior.stepping.trials import Trials
from physics_prior.studies.accuracy.compiled import Compiled
from physics_prior.studies.accuracy.front import seconds_to_reach
from physics_prior.studies.accuracy.measure import measure
from physics_prior.studies.accuracy.problem import Problem
from physics_prior.studies.accuracy.schemes import own_schemes
from physics_prior.studies.accuracy.study import part_of
from physics_prior.studies.accuracy.trajectory import Setting
from physics_prior.studies.bench import machine, one_core
from physics_prior.studies.problems.mechanism import Benchmark, Run

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
ROUNDS = 9  # of timing: more than the study's, as ratios of runs of a millisecond waver
MOST_ERROR, MOST_COST = 3.0, 2.0  # times what is asked, and times the best on the measured front


@dataclass(frozen=True)
class Turn:
    """One tolerance on one problem.

    Attributes:
        problem, tolerance: which; tolerance in the problem's unit.
        scheme, h: what was chosen; None where it was refused, and ``why``.
        seconds: s that count: those until which the motion is known well enough; None if all.
        error: against the reference of other origin, over what was asked.
        cost: processor time over that of the best on the front of the study, measured in turns; None where the front has none,
            or tells errors over more seconds.
    """

    problem: str
    tolerance: float
    scheme: str | None = None
    h: float | None = None
    seconds: float | None = None
    error: float | None = None
    cost: float | None = None
    why: str = ""

    @property
    def kept(self) -> bool:
        """Whether it is as accurate and as cheap as it has to be."""
        return self.error is not None and self.error <= MOST_ERROR and (self.cost is None or self.cost <= MOST_COST)


def run_knob(problems: Sequence[Problem], progress: Callable[[float, str], None]) -> list[Turn]:
    """Ask every problem for every tolerance, one problem after the other, on one core."""
    out: list[Turn] = []
    with one_core():
        for index, problem in enumerate(problems):
            out += turns(problem, partial(part_of, progress, index, problems))
    return out


def turns(problem: Problem, progress: Callable[[float], None] = lambda part: None) -> list[Turn]:
    """Choose for every tolerance, then measure the choices among the settings of the study."""
    benchmark = problem.make()
    course = course_of(problem, benchmark)
    out: list[Turn] = []
    asked: list[Compiled] = []
    for index, tolerance in enumerate(TOLERANCES):
        turn, step = _choose(problem, benchmark, course, tolerance)
        out.append(turn)
        if step is not None:
            asked.append(Compiled(step.integrator, [_setting(step)], f"{tolerance:g}", "chosen"))
        progress(0.5 * (index + 1) / len(TOLERANCES))
    study = [scheme for scheme in own_schemes(problem) if scheme.engine == "compiled"]
    points = measure(problem, [*study, *asked], lambda part: progress(0.5 + 0.5 * part), ROUNDS)
    front = [point for point in points if point.engine == "compiled"]
    seconds = {float(point.scheme): point.seconds for point in points if point.engine == "chosen" and point.measured}
    best = {turn.tolerance: seconds_to_reach(front, turn.tolerance) for turn in out if turn.seconds is None}
    return [
        replace(turn, cost=seconds[turn.tolerance] / reached)
        if turn.tolerance in seconds and (reached := best.get(turn.tolerance)) is not None
        else turn
        for turn in out
    ]


def _choose(problem: Problem, benchmark: Benchmark, course: Course, tolerance: float) -> tuple[Turn, Step | None]:
    """What is chosen for a tolerance and how it errs, its cost left open; no step if it is refused."""
    try:
        trials = Trials(course, tolerance)
    except SceneError as told:
        return Turn(problem.key, tolerance, why=str(told)), None
    found = trials.best(tolerance)
    if not found:
        return Turn(problem.key, tolerance, why="no step tried is so exact in good time"), None
    taken, counted = cheapest(found), trials.until - 1
    seen = Follower(course, taken.step).sights()[1 : counted + 1]
    error = max(benchmark.distance(a, b) for a, b in zip(seen, benchmark.values, strict=False))
    seconds = None if counted == len(benchmark.times) else trials.seconds
    return Turn(problem.key, tolerance, taken.scheme, taken.step.size, seconds, error / tolerance), taken.step


def course_of(problem: Problem, benchmark: Benchmark) -> Course:
    """A problem as steps are tried on: its error is that of the study, its longest step the coarsest there."""

    def observe(simulator: Simulator, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return benchmark.observe(Run(simulator, q, v))

    parts = round(float(benchmark.times[0]) / problem.steps[0])
    start = benchmark.q, benchmark.v, benchmark.times, parts, observe, benchmark.distance
    return Course(benchmark.tree, benchmark.effects, *start, benchmark.tau)


def _setting(step: Step) -> Setting:
    return Setting(step.size, step.tolerance if INTEGRATORS[step.integrator].adaptive else None)


def knob_card(found: Sequence[Turn]) -> dict[str, Any]:
    """Every figure, for JSON."""
    rows = [asdict(turn) | {"kept": turn.kept} for turn in found]
    return {"version": __version__, "machine": machine(False), "turns": rows}


def knob_table(found: Sequence[Turn]) -> Table:
    """The figures for people; what does not hold is marked."""
    out = Table(
        title=f"The tolerance asked for: error over it (at most {MOST_ERROR:g}), cost over the best (at most {MOST_COST:g})",
        box=None,
        pad_edge=False,
    )
    for name in ("problem", "tolerance", "integrator"):
        out.add_column(name, header_style="dim")
    for name in ("step", "over", "error", "cost", ""):
        out.add_column(name, justify="right", header_style="dim", no_wrap=True)
    for turn in found:
        if turn.error is None or turn.h is None:
            out.add_row(turn.problem, f"{turn.tolerance:g}", f"refused: {turn.why}", *[""] * 5)
            continue
        cost = "" if turn.cost is None else f"{turn.cost:.2f}"
        mark = "" if turn.kept else "*"
        over = "" if turn.seconds is None else f"{turn.seconds:g} s"
        step = f"{1e3 * turn.h:.4g} ms"
        out.add_row(turn.problem, f"{turn.tolerance:g}", turn.scheme, step, over, f"{turn.error:.2f}", cost, mark)
    return out
