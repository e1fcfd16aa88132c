"""How long measurements take to be taken in, against how often they come: whether a scene's budget holds."""

from statistics import median

from physics_prior.scene import Accuracy

FEWEST = 10  # stamps, of which a median tells something


class Pace:
    """Processor time per stamp of what was measured, and the time from stamp to stamp, since they were last told.

    asked: what the scene asks of its accuracy; None where it names its step.
    """

    def __init__(self, asked: Accuracy | None) -> None:
        self._asked = asked
        self._stamp: int | None = None
        self._taken: list[float] = []
        self._intervals: list[float] = []

    def add(self, stamp: int, seconds: float) -> None:
        """A message of a stamp, ns, took so many s; messages of one stamp count as one."""
        if self._stamp is not None and stamp == self._stamp and self._taken:
            self._taken[-1] += seconds
            return
        if self._stamp is not None and stamp > self._stamp:
            self._intervals.append(1e-9 * (stamp - self._stamp))
        self._stamp = stamp
        self._taken.append(seconds)

    def tell(self) -> tuple[str, dict[str, object]]:
        """What of the scene's accuracy does not hold, empty if it does, and the figures; begins anew."""
        taken, intervals, self._taken, self._intervals = self._taken, self._intervals, [], []
        if not taken or not intervals:
            return "", {}
        one, factor = median(taken), median(intervals) / max(median(taken), 1e-9)
        problem, asked = "", self._asked
        if asked is not None and len(taken) >= FEWEST:
            if asked.budget is not None and one > asked.budget:
                problem = (
                    f"measurements take {1e6 * one:.3g} us each: the scene's budget is {1e6 * asked.budget:.3g} us"
                )
            if asked.real_time_factor is not None and factor < asked.real_time_factor:
                problem = (
                    f"measurements are taken in {factor:.3g}x as fast as they come:"
                    f" the scene asks for {asked.real_time_factor:g}x"
                )
        return problem, {"us a measurement": f"{1e6 * one:.0f}", "real time factor": f"{factor:.3g}"}
