"""Steps tried on a course: the right motion, what each errs from it, and what it costs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median

import numpy as np

from physics_prior.dynamics.integrators import INTEGRATORS, IntegratorName
from physics_prior.errors import SceneError, SimulationError
from physics_prior.scene import Step
from physics_prior.stepping.choice import Measured
from physics_prior.stepping.course import Course, Follower
from physics_prior.stepping.search import coarsest, first

LOOSE = 1e-2  # tolerance of an integrator of its own steps that is to keep to the steps given, where they resolve
AGREEING = 3  # ways to the right motion
SHARE = 1 / 3  # of an error: how surely the right motion has to be known to tell it
SHORTEST = 0.1  # of a course: less of it tells too little
ROUNDS = 5  # of timing, all contestants in turns
REPEATED = 0.3  # s of processor time, beyond which a run is not repeated
PATIENCE = 1.0  # s of processor time for a run, beyond which a scheme is given up
OWN_SETTINGS = 45  # tolerances, down to 1e-13

Report = Callable[[str], None]


@dataclass(frozen=True)
class Scheme:
    """An integrator at steps of its own size, or at equal ones.

    Its settings are numbers, from coarse to fine.
    """

    integrator: IntegratorName
    own_steps: bool = False

    @property
    def name(self) -> str:
        return f"{self.integrator}, its own steps" if self.own_steps else self.integrator

    def step(self, interval: float, n: int, parts: int = 1) -> Step:
        """A setting: n equal steps in an interval of s; or, of its own in parts of it, tolerances of which four are a decade."""
        if self.own_steps:
            tolerance = float(f"{LOOSE * 10.0 ** ((1 - n) / 4):.4g}")
            return Step(integrator=self.integrator, size=interval / parts, tolerance=tolerance)
        if INTEGRATORS[self.integrator].adaptive:
            return Step(integrator=self.integrator, size=interval / n, tolerance=LOOSE)
        return Step(integrator=self.integrator, size=interval / n)


RIGHT = ((2, 1e-13), (4, 1e-11), (8, 1e-9), (16, LOOSE))
"""Ways to the right motion by dop853: into how many the longest step is divided, and the tolerance. Where a mechanism folds,
rounding is above the tightest tolerance, and the finest steps are not the best: so three have to agree."""
EXPLICIT = (Scheme("rk4"), Scheme("dop853"), Scheme("dop853", own_steps=True), Scheme("semi_implicit_euler"))
IMPLICIT = (Scheme("implicit_midpoint"), Scheme("lobatto_iiic"))


class Trials:
    """The right motion of a course and tries beside it.

    Attributes:
        until: how many times of the course count: of a chaotic motion, those until which the right one is known.
        reference: m, how surely it is known there.

    Raises:
        SceneError: the motion is lost, nothing moves, or the right motion is not known well enough for an error to be told.
    """

    def __init__(self, course: Course, told: float, report: Report = lambda what: None) -> None:
        self._course, self._report = course, report
        report("finding the right motion")
        self._right, apart = _middle(course, _ways(course))
        self.until = int(np.sum(apart <= SHARE * told))
        if self.until < 1 + SHORTEST * len(course.times):
            known = float(apart[int(np.ceil(SHORTEST * len(course.times)))])
            raise SceneError(
                f"an error of {told:g} m cannot be told on this scene's motion, which is known to {known:.2g} m: ask for"
                f" {known / SHARE:.1g} m or more, or give 'step'"
            )
        self.reference = float(apart[self.until - 1])
        if max(course.distance(self._right[0], each) for each in self._right[: self.until]) <= told:
            raise SceneError(
                f"nothing moves by {told:g} m from the scene's initial state: give 'initial' positions or velocities from"
                " which it does, or 'step'"
            )
        self._errors: dict[Step, float] = {}
        self._cost: dict[Scheme, float] = {}  # s of a step

    @property
    def seconds(self) -> float:
        """How long a motion counts, s."""
        return float(self._course.times[self.until - 2])

    def error(self, scheme: Scheme, n: int) -> float:
        """The largest distance of a scheme's n-th setting from the right motion, m; infinite where the motion is lost."""
        step = self._step(scheme, n)
        if step not in self._errors:
            follower = Follower(self._course, step)
            try:
                pairs = zip(follower.sights()[: self.until], self._right, strict=False)
                found = max(self._course.distance(a, b) for a, b in pairs)
            except SimulationError:
                found = np.inf
            self._errors[step] = found if np.isfinite(found) else np.inf
            self._cost[scheme] = follower.taken / follower.made
        return self._errors[step]

    def contestants(self) -> list[Scheme]:
        """Who is worth trying: those for stiff motion only where the longest step of Runge and Kutta's loses it."""
        self._report(f"trying {EXPLICIT[0].name}")
        stiff = not np.isfinite(self.error(EXPLICIT[0], self._course.parts))
        return [*EXPLICIT, *(IMPLICIT if stiff else ())]

    def reach(self, scheme: Scheme, allowed: float, most: int | None = None) -> int | None:
        """The coarsest setting of a scheme whose error is allowed; None where there is none up to a number, or in good time."""
        self._report(f"trying {scheme.name}")
        if scheme.own_steps:
            # what chooses its own steps scatters: the next tolerance has to do, too
            n = first(lambda i: max(self.error(scheme, i + 1), self.error(scheme, i + 2)), allowed, OWN_SETTINGS - 1)
            return None if n is None else n + 1
        intervals, least = self._course.times[-1] / self._course.interval, self._course.parts

        def patience() -> int:
            return max(least, int(PATIENCE / (intervals * self._cost[scheme]))) if most is None else most

        return coarsest(partial(self.error, scheme), INTEGRATORS[scheme.integrator].order, allowed, patience, least)

    def best(self, allowed: float) -> list[Measured]:
        """Of each scheme, the coarsest step whose error is allowed, with its cost per longest step, in turns."""
        found: dict[Step, tuple[Scheme, int]] = {}
        for scheme in self.contestants():
            n = self.reach(scheme, allowed)
            if n is not None:  # the longest step may be that of its own steps, too
                found.setdefault(self._step(scheme, n), (scheme, n))
        return [
            Measured(scheme=scheme.name, step=step, error=self.error(scheme, n), us=us)
            for (step, (scheme, n)), us in zip(found.items(), self.costs(list(found)), strict=True)
        ]

    def _step(self, scheme: Scheme, n: int) -> Step:
        return scheme.step(self._course.interval, n, self._course.parts)

    def costs(self, steps: Sequence[Step]) -> list[float]:
        """Microseconds of the processor that steps take for the longest one's time, medians of runs in turns."""
        self._report("timing")
        followers = [Follower(self._course, step) for step in steps]
        times: list[list[float]] = [[] for _ in steps]
        for _ in range(ROUNDS):
            for follower, taken in zip(followers, times, strict=True):
                if not taken or taken[0] < REPEATED:
                    taken.append(follower.seconds())
        length = self._course.times[-1] / self._course.longest
        return [1e6 * median(taken) / length for taken in times]


def _ways(course: Course) -> list[list[np.ndarray]]:
    """The motion by every way that leads to its end; SceneError if fewer than three do."""
    found, problem = [], None
    for parts, tolerance in RIGHT:
        try:
            found.append(
                Follower(course, Step(integrator="dop853", size=course.longest / parts, tolerance=tolerance)).sights()
            )
        except SimulationError as error:
            problem = error
    if len(found) < AGREEING:
        raise SceneError(f"the motion from the scene's initial state is lost: {problem}") from None
    return found


def _middle(course: Course, ways: Sequence[list[np.ndarray]]) -> tuple[list[np.ndarray], np.ndarray]:
    """The way that two others are nearest to in the end, and how far the second was until each time, (k + 1,).

    Two may agree by chance.
    """
    told = []
    for one in ways:
        apart = [
            np.maximum.accumulate([course.distance(a, b) for a, b in zip(one, other, strict=True)])
            for other in ways
            if other is not one
        ]
        told.append((one, sorted(apart, key=lambda each: float(each[-1]))[1]))
    return min(told, key=lambda each: float(each[1][-1]))
