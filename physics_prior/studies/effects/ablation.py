"""Each effect of a scene with and without: whether it is worth its cost on a recording.

An effect is kept where it raises the log-likelihood by more than its numbers would by chance: k / 2 log n for k numbers and n
rows measured (Schwarz 1978, the Bayesian information criterion). A proposed effect is first fitted: one of the wrong strength
would be refused for that. Numbers of the scene that are free are fitted anew in every comparison: else drag would be kept
because it makes up for a damping that is a little off.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from physics_prior.errors import SceneError
from physics_prior.estimation.measurement import Measurement
from physics_prior.studies.effects.cost import extra_cost
from physics_prior.studies.effects.fit import fit
from physics_prior.studies.effects.likelihood import Likelihood, likelihood
from physics_prior.studies.effects.variant import SceneText, kind_of, label_of


@dataclass(frozen=True)
class Verdict:
    """What a recording says of an effect.

    Attributes:
        name, kind: of the effect; proposed: whether it is not in the scene.
        keep: whether it is worth having; evidence: why, in one sentence.
        delta_log_likelihood: with it, less without; None where the recording cannot be followed without it.
        threshold: what that must exceed.
        us_per_step: what it adds to a step, us; None where it cannot be left out.
        nis_with, nis_without, forecast_with, forecast_without: as Likelihood says; None where there is none.
        fitted: numbers of a proposed effect at their best, by path.
    """

    name: str
    kind: str
    proposed: bool
    keep: bool
    evidence: str
    delta_log_likelihood: float | None
    threshold: float
    us_per_step: float | None
    nis_with: float | None = None
    nis_without: float | None = None
    forecast_with: float | None = None
    forecast_without: float | None = None
    fitted: dict[str, float] | None = None

    def figures(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def ablate(
    scene: SceneText,
    measurements: Sequence[Measurement],
    proposed: Sequence[Any] = (),
    free: Sequence[str] = (),
    report: Callable[[float, str], None] = lambda share, now: None,
) -> list[Verdict]:
    """Try every effect of a scene, and proposed ones as they would stand in its ``effects``, on measurements.

    free: paths of numbers that stand at their best in the scene and are fitted anew in every comparison.

    Raises:
        SceneError: the scene or a proposed effect is not valid, or the scene as it stands cannot follow the recording.
    """
    whole = scene.build()
    base = likelihood(whole, measurements)
    if base is None:
        raise SceneError(f"{scene.path}: the scene as it stands cannot follow the recording: nothing can be compared")
    verdicts, total = [], len(scene.entries) + len(proposed)
    for index, entry in enumerate(scene.entries):
        report(index / total, f"without {label_of(entry)}")
        numbers = max(1, len(scene.paths(index)))
        try:
            text = scene.without(index)
            text.build()
        except SceneError as problem:
            verdicts.append(_indispensable(entry, numbers, base, str(problem)))
            continue
        others = [path for path in free if not scene.belongs(path, index)]
        rest = _best(text, others, measurements)[0].build()
        found = likelihood(rest, measurements)
        verdicts.append(_judge(entry, numbers, base, found, extra_cost(whole, rest) if found is not None else None))
    for place, entry in enumerate(proposed):
        report((len(scene.entries) + place) / total, f"with {label_of(entry)}")
        larger = scene.added(entry)
        larger.build()
        own = larger.paths(len(scene.entries))
        text, numbers_found = _best(larger, [*own, *free], measurements)
        better = text.build()
        strengths = {path: numbers_found[path] for path in own}
        found = likelihood(better, measurements)
        verdicts.append(_judge(entry, max(1, len(own)), found, base, extra_cost(better, whole), strengths))
    report(1.0, "done")
    return verdicts


def _best(
    text: SceneText, paths: Sequence[str], measurements: Sequence[Measurement]
) -> tuple[SceneText, dict[str, float]]:
    """A scene with the numbers at some paths at their best, and these; as it stands if it cannot follow the recording."""
    if paths and likelihood(text.build(), measurements) is not None:
        found = fit(text, paths, measurements)
        text = found.scene
    return text, {path: text.number(path) for path in paths}


def _judge(
    entry: Any,
    numbers: int,
    having: Likelihood | None,
    lacking: Likelihood | None,
    cost: float | None,
    fitted: dict[str, float] | None = None,
) -> Verdict:
    """The verdict on an effect; ``fitted`` tells that it is a proposed one."""
    rows = having.rows if having is not None else 2
    threshold = 0.5 * numbers * math.log(rows)
    gain = having.log - lacking.log if having is not None and lacking is not None else None
    keep = having is not None and (gain is None or gain > threshold)
    name, price = label_of(entry), "" if cost is None else f" for {cost:.2g} us a step"
    if having is None:
        evidence = f"{name}: drop, with it the recording cannot be followed"
    elif gain is None:
        evidence = f"{name}: keep, without it the recording cannot be followed"
    elif keep:
        evidence = f"{name}: keep, {gain:+.4g} log-likelihood{price}"
    else:
        evidence = f"{name}: drop, no evidence ({gain:+.3g} log-likelihood, {threshold:.3g} needed){price}"
    return Verdict(
        name,
        kind_of(entry),
        fitted is not None,
        keep,
        evidence,
        gain,
        threshold,
        cost,
        *_pair(having, lacking, "nis"),
        *_pair(having, lacking, "forecast"),
        fitted,
    )


def _indispensable(entry: Any, numbers: int, base: Likelihood, why: str) -> Verdict:
    evidence = f"{label_of(entry)}: keep, the scene is not valid without it: {why}"
    threshold = 0.5 * numbers * math.log(base.rows)
    return Verdict(label_of(entry), kind_of(entry), False, True, evidence, None, threshold, None)


def _pair(having: Likelihood | None, lacking: Likelihood | None, name: str) -> tuple[float | None, float | None]:
    values = [None if each is None else float(getattr(each, name)) for each in (having, lacking)]
    first, second = (None if value is None or not math.isfinite(value) else value for value in values)
    return first, second
