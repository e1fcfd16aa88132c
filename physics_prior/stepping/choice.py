"""What was asked, what was measured, and which of it is taken."""

from collections.abc import Sequence

from physics_prior.scene import Accuracy, Step
from physics_prior.scene.section import Section

LIKE = 1.1  # times: costs and errors within it are alike, a clock tells no less


class Measured(Section):
    """A step on a scene's motion.

    Attributes:
        scheme: integrator, and how it takes its steps.
        step: as a scene would give it.
        error: largest distance of a part from where it should be, m.
        us: microseconds of the processor for one measurement.
    """

    scheme: str
    step: Step
    error: float
    us: float


class Choice(Section):
    """A step, chosen for a scene.

    Attributes:
        asked: what for.
        taken: the step.
        others: the best of every other scheme that was tried, in the order of the tries.
        work: what ``us`` counts: "estimating", or "moving" where the scene measures nothing.
        interval: s, from measurement to measurement.
        seconds: s of the motion that errors were measured over.
        reference: m, how surely the right motion is known.
        kept: whether what was asked is kept.
    """

    asked: Accuracy
    taken: Measured
    others: tuple[Measured, ...]
    work: str
    interval: float
    seconds: float
    reference: float
    kept: bool


def allowed_us(asked: Accuracy, interval: float) -> float | None:
    """Microseconds that a measurement may cost; None where an error is asked for and not a cost."""
    if asked.budget is not None:
        return 1e6 * asked.budget
    return None if asked.real_time_factor is None else 1e6 * interval / asked.real_time_factor


def cheapest(candidates: Sequence[Measured]) -> Measured:
    """The first of those whose cost is like the least one: so that it does not hang on the clock where it need not."""
    least = min(each.us for each in candidates)
    return next(each for each in candidates if each.us <= LIKE * least)


def most_exact(candidates: Sequence[Measured], allowed: float, told: float) -> Measured:
    """Of those that cost what is allowed, us, the most exact; where errors are alike the cheapest.

    told: m, below which errors are not told apart. Where nothing is cheap enough, the cheapest of all.
    """
    fitting = [each for each in candidates if each.us <= allowed]
    if not fitting:
        return cheapest(candidates)
    least = max(told, min(each.error for each in fitting))
    return cheapest([each for each in fitting if each.error <= LIKE * least])
