"""Settle the step of a scene that asks for an accuracy: once by trials, then from the cache, for all doors alike."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from time import thread_time_ns

from physics_prior.errors import SceneError
from physics_prior.estimation.estimator import Estimator
from physics_prior.recording.simulate import motion
from physics_prior.scene import Accuracy, Scene, Step
from physics_prior.stepping import kept
from physics_prior.stepping.choice import Choice, Measured, allowed_us, cheapest, most_exact
from physics_prior.stepping.course import course_of
from physics_prior.stepping.trials import Report, Scheme, Trials

TOLD = 1e-6  # m, where no error is asked for: the right motion is known at least so well
ROUNDING = 1e-12  # m: no budget buys less
HEADROOM = 0.8  # of what may be spent is what further steps may take it to: clocks waver, and so do motions
STAMPS = 60  # of measurements that an estimator is timed on
SPAN = 4  # times as many steps, from whose costs that of one is told
FINEST = 1000  # steps in an interval


def settle(scene: Scene, report: Report = lambda what: None) -> tuple[Scene, Choice | None]:
    """The scene with the step that does what it asks for, and the choice; itself and None where it names its step.

    The first time takes some seconds, and what it takes to compile the integrators; then the choice lies in the cache of
    kernels, under a digest of all that it depends on, so that replay and node step alike. report is told what is going on.

    Raises:
        SceneError: the scene's motion does not show what a step errs.
    """
    if scene.accuracy is None:
        return scene, None
    choice = kept.read(scene)
    if choice is None:
        try:
            choice = kept.write(scene, choose(scene, scene.accuracy, report))
        except SceneError as problem:
            raise SceneError(f"{scene.path}: accuracy: {problem}") from None
    return stepped(scene, choice.taken.step), choice


def stepped(scene: Scene, step: Step) -> Scene:
    """The scene with a step, whatever it asked for."""
    return replace(scene, step=step, accuracy=None)


def choose(scene: Scene, asked: Accuracy, report: Report = lambda what: None) -> Choice:
    """Try steps on the scene's own motion and choose: the cheapest whose error is allowed, or the most exact whose cost is.

    Raises:
        SceneError: as of ``settle``.
    """
    course = course_of(scene)
    allowed = allowed_us(asked, course.longest)
    told = TOLD if asked.tolerance is None else asked.tolerance
    trials = Trials(course, told, report)
    if allowed is None:
        found = trials.best(told)
        if not found:
            raise SceneError(f"no step tried errs by less than {told:g} m in good time: ask for less")
        taken, work = cheapest(found), "moving"
    else:
        found, work = _within(scene, trials, allowed, report)
        taken = most_exact(found, allowed, max(ROUNDING, trials.reference))
    return Choice(
        asked=asked,
        taken=taken,
        others=tuple(each for each in found if each is not taken),
        work=work,
        interval=course.longest,
        seconds=trials.seconds,
        reference=trials.reference,
        kept=allowed is None or taken.us <= allowed,
    )


def _within(scene: Scene, trials: Trials, allowed: float, report: Report) -> tuple[list[Measured], str]:
    """Of each scheme of equal steps, the finest whose cost is allowed, us, or the coarsest; and what the cost is of."""
    interval, work = 1.0 / scene.simulation.rate, "estimating" if scene.measurements else "moving"

    def costs(steps: Sequence[Step]) -> list[float]:
        report(f"timing {', '.join(dict.fromkeys(step.integrator for step in steps))}: compiled the first time")
        return estimating_us(scene, steps) if scene.measurements else trials.costs(steps)

    tried: list[tuple[Scheme, int]] = []
    for scheme in trials.contestants():
        if scheme.own_steps:
            continue  # what they cost hangs on the motion: no budget holds for them
        report(f"trying {scheme.name}")
        few, many = costs([scheme.step(interval, 1), scheme.step(interval, SPAN)])
        each = max((many - few) / (SPAN - 1), 1e-3 * few)
        n = min(max(1, 1 + int((HEADROOM * allowed - few) / each)), FINEST)
        told = max(ROUNDING, trials.reference)
        enough = trials.reach(scheme, told, n) if trials.error(scheme, n) <= told else None
        tried.append((scheme, enough or n))
    steps = [scheme.step(interval, n) for scheme, n in tried]
    return [
        Measured(scheme=scheme.name, step=step, error=trials.error(scheme, n), us=us)
        for (scheme, n), step, us in zip(tried, steps, costs(steps), strict=True)
        if trials.error(scheme, n) < float("inf")
    ], work


def estimating_us(scene: Scene, steps: Sequence[Step]) -> list[float]:
    """Microseconds of the processor that an estimator takes for what is measured at one stamp: medians, for each step.

    Raises:
        SceneError: what is measured never fixes the configuration.
    """
    reference = stepped(scene, Step(integrator="dop853", size=1.0 / scene.simulation.rate))
    moments = list(motion(reference, reference.simulator(), duration=STAMPS / scene.simulation.rate))
    out = []
    for step in steps:
        for count in (4, len(moments)):  # what is not compiled yet is so the first time
            estimator, times = Estimator(stepped(scene, step)), []
            for moment in moments[:count]:
                begin = thread_time_ns()
                for measurement in moment.measurements:
                    estimator.add(measurement)
                times.append(1e-3 * (thread_time_ns() - begin))
        if not estimator.ready:
            raise SceneError(
                "what is measured never fixes the configuration, so that its cost cannot be told: give 'step'"
            )
        out.append(median(times))
    return out
