"""Each effect of a scene with and without: which of them recordings call for.

All effects, those of the scene and those proposed, are taken together, their strengths at their best. Then the one that gains
least is left out, the strengths of the others at their best again, as long as one gains less than its numbers would by chance:
k / 2 log n for k numbers and n rows measured (Schwarz 1978, the Bayesian information criterion). So an effect is kept neither
because it makes up for another that is a little off, nor because it does the work of one that has not been tried. Of two that do
the same work the proposed one goes.

The sides of an effect, such as the friction of a contact, are tried in the same way where it can do without.
"""

import math
from collections.abc import Callable, Container, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from physics_prior.errors import SceneError, SimulationError
from physics_prior.scene import Scene
from physics_prior.studies.effects.cost import extra_cost
from physics_prior.studies.effects.fit import Fit, Problem
from physics_prior.studies.effects.likelihood import Recordings, forecast_error
from physics_prior.studies.effects.parameter import parameters
from physics_prior.studies.effects.variant import SceneText, kind_of, label_of

HARM = 1.0  # of log-likelihood: what leaving out gains beyond what a search leaves open

Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Verdict:
    """What recordings say of an effect, or of a side of one.

    Attributes:
        name, kind: of the effect; NAME.SIDE of a side. proposed: whether it is not in the scene.
        keep: whether it is worth having; evidence: why, in one sentence.
        delta_log_likelihood: with it, less without, all strengths at their best; None where the recording cannot be followed
            without it.
        threshold: what that must exceed.
        us_per_step: what it adds to a step, us; None of a side, or where it cannot be left out.
        nis_with, nis_without: as Likelihood says; None where there is none.
        forecast_with, forecast_without: as forecast_error says; None where there is none.
        rmse_with, rmse_without: error against a reference, where there is one.
        fitted: its numbers at their best, by path.
    """

    name: str
    kind: str
    proposed: bool
    keep: bool
    evidence: str
    delta_log_likelihood: float | None
    threshold: float
    us_per_step: float | None = None
    nis_with: float | None = None
    nis_without: float | None = None
    forecast_with: float | None = None
    forecast_without: float | None = None
    rmse_with: float | None = None
    rmse_without: float | None = None
    fitted: dict[str, float] | None = None

    def figures(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Study:
    """Verdicts, in the order of the scene and then as proposed, and the fit of the scene with what is kept."""

    verdicts: list[Verdict]
    fit: Fit


@dataclass(frozen=True)
class _Unit:
    """What is left out at once: an effect, or a side of it."""

    label: str
    side: str

    @property
    def name(self) -> str:
        return f"{self.label}.{self.side}" if self.side else self.label

    def owns(self, path: str) -> bool:
        return f"{path}.".startswith(f"effects.{self.name}.")


@dataclass(frozen=True, eq=False)
class _Trial:
    """A unit left out: the fit with it, the one without (None if that cannot follow), and what it must gain."""

    having: Fit
    lacking: Fit | None
    threshold: float

    @property
    def gain(self) -> float | None:
        return None if self.lacking is None else self.having.found.log - self.lacking.found.log

    @property
    def surplus(self) -> float:
        return math.inf if self.gain is None else self.gain - self.threshold


def ablate(
    scene: SceneText,
    recordings: Recordings,
    proposed: Sequence[Any] = (),
    free: Sequence[str] = (),
    held: Sequence[str] = (),
    scored: Callable[[Scene], float | None] = lambda scene: None,
    report: Report = lambda share, now: None,
) -> Study:
    """Try every effect of a scene, and proposed ones as they would stand in its ``effects``, on recordings.

    free: paths of numbers that are fitted as strengths are; held: paths of strengths that are not. scored: a scene's error
    against a reference.

    Raises:
        SceneError: the scene or a proposed effect is not valid, or a path leads nowhere; SimulationError: the scene with all
            effects cannot follow the recordings.
    """
    text = scene
    for entry in proposed:
        text = text.added(entry)
        text.build()
    strengths = {label: text.strengths(label) for label in text.labels}
    fixed = {text.proper(path) for path in held}
    paths = [f"effects.{label}.{side}" for label, sides in strengths.items() for side in sides]
    loose = parameters(text, [*(path for path in paths if path not in fixed), *free], paths)
    best = Problem(text, loose, recordings, lambda count: report(0.0, f"all effects, replay {count}")).solve()
    units, bound = _units(text, strengths)
    names = {label_of(entry) for entry in proposed}
    best, trials = _eliminate(best, units, names, report)
    verdicts = []
    for label, entry in zip(text.labels, text.entries, strict=True):
        if label in bound:
            verdicts.append(_indispensable(entry, label in names))
        verdicts += [
            _judge(entry, unit, trials[unit], label in names, scored)
            for unit in units
            if unit.label == label and unit in trials
        ]
    report(1.0, "done")
    return Study(verdicts, best)


def _units(text: SceneText, strengths: dict[str, list[str]]) -> tuple[list[_Unit], list[str]]:
    """What the scene can do without, and the effects that it cannot."""
    units, bound = [], []
    for label, sides in strengths.items():
        whole = _Unit(label, "")
        units += [unit for unit in (whole, *(_Unit(label, side) for side in sides)) if _can_go(text, unit)]
        if whole not in units:
            bound.append(label)
    return units, bound


def _can_go(text: SceneText, unit: _Unit) -> bool:
    """Whether a scene has a unit and is valid without it."""
    if unit.label not in text.labels or (unit.side and unit.side not in text.strengths(unit.label)):
        return False
    try:
        text.without(unit.label, unit.side).build()
    except SceneError:
        return False
    return True


def _eliminate(
    best: Fit, units: Sequence[_Unit], proposed: Container[str], report: Report
) -> tuple[Fit, dict[_Unit, _Trial]]:
    """The fit of what is kept, and the last trial of each unit.

    Leaving out what gains l can make another gain less by l at most, where the fits are nested: what gains more than it needs by
    more than all that was lost since need not be tried again. What does harm (gravity in free fall) was not nested: after it, all
    are tried again.
    """
    trials: dict[_Unit, _Trial] = {}
    present, doubtful, lost = list(units), list(units), 0.0
    while doubtful:
        for count, unit in enumerate(doubtful):
            report(1.0 - (len(doubtful) - count) / (len(units) + 1.0), f"without {unit.name}")
            trials[unit] = _leave_out(best, unit)
        idle = [unit for unit in doubtful if trials[unit].surplus <= 0.0]
        if not idle:
            break
        worst = min(idle, key=lambda unit: (unit.label not in proposed, trials[unit].surplus))
        trial = trials[worst]
        assert trial.lacking is not None
        assert trial.gain is not None
        best, lost = trial.lacking, lost + trial.gain if trial.gain > -HARM else math.inf
        present.remove(worst)
        gone = [unit for unit in present if unit.label == worst.label and not _can_go(best.problem.scene, unit)]
        for unit in gone:  # sides of what was left out, or the last one of an effect, which is as much as all of it
            present.remove(unit)
            del trials[unit]
        doubtful = [unit for unit in present if trials[unit].surplus <= lost]
        lost = lost if math.isfinite(lost) else 0.0
    return best, trials


def _leave_out(best: Fit, unit: _Unit) -> _Trial:
    problem = best.problem
    chosen = [place for place, each in enumerate(problem.parameters) if not unit.owns(each.path)]
    smaller, begin = problem.reduced(problem.scene.without(unit.label, unit.side), chosen, best.minimum)
    try:
        lacking = smaller.solve(begin)
    except SimulationError:
        lacking = None
    sides = problem.scene.strengths(unit.label)
    numbers = max(1, sum(unit.owns(f"effects.{unit.label}.{side}") for side in sides))
    return _Trial(best, lacking, 0.5 * numbers * math.log(best.found.rows))


def _judge(entry: Any, unit: _Unit, trial: _Trial, proposed: bool, scored: Callable[[Scene], float | None]) -> Verdict:
    having, lacking, gain = trial.having, trial.lacking, trial.gain
    with_it, without = having.scene.build(), None if lacking is None else lacking.scene.build()
    cost = None if unit.side or without is None else extra_cost(with_it, without)
    price = "" if cost is None else f" for {cost:.2g} us a step"
    if gain is None:
        evidence = f"{unit.name}: keep, without it the recording cannot be followed"
    elif trial.surplus > 0.0:
        evidence = f"{unit.name}: keep, {gain:+.4g} log-likelihood{price}"
    else:
        evidence = f"{unit.name}: drop, no evidence ({gain:+.3g} log-likelihood, {trial.threshold:.3g} needed){price}"
    return Verdict(
        name=unit.name,
        kind=kind_of(entry),
        proposed=proposed,
        keep=trial.surplus > 0.0,
        evidence=evidence,
        delta_log_likelihood=gain,
        threshold=trial.threshold,
        us_per_step=cost,
        nis_with=_finite(having.found.nis),
        nis_without=None if lacking is None else _finite(lacking.found.nis),
        forecast_with=_finite(forecast_error(with_it, having.problem.recordings)),
        forecast_without=None if without is None else _finite(forecast_error(without, having.problem.recordings)),
        rmse_with=scored(with_it),
        rmse_without=None if without is None else scored(without),
        fitted={path: number for path, number in having.numbers.items() if unit.owns(path)},
    )


def _indispensable(entry: Any, proposed: bool) -> Verdict:
    label = label_of(entry)
    evidence = f"{label}: keep, the scene is not valid without it"
    return Verdict(label, kind_of(entry), proposed, True, evidence, None, 0.0)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
