"""Estimates told by what was measured up to a lag after them: causal (none), fixed-lag smoothing, or by the whole recording."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace

from physics_prior.estimation.estimate import Estimate
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import Posterior
from physics_prior.estimation.history import Node
from physics_prior.estimation.landings import timed
from physics_prior.estimation.smoother import Known, smooth

WHOLE = 10**18  # ns: a lag that no recording outlasts


class Lagged:
    """Gives out each of an estimator's stamps once, when all that was measured within the lag after it has come.

    That is so when something later was measured, or the lag has passed by the clock. What comes later still is too late for it.
    """

    def __init__(self, estimator: Estimator, lag: int, period: float) -> None:
        """lag: ns, that the estimator's history must reach back; period: s, of estimates where nothing was measured."""
        self.lag = lag
        self._estimator, self._period = estimator, period
        self._given = self._newest = 0  # stamps of the last one given out and of the last one measured then, ns
        self._history = estimator.history
        self._left: list[Node] = []  # settled before they were
        self._known: Known = {}

    def estimates(self, present: int, ahead: int) -> Iterator[Estimate]:
        """What to publish at the present time, ns on the clock of the measurements, each predicted for so many ns more.

        Without a lag the newest estimate, predicted for the present; with one those that are due, or what is predicted where
        nothing is measured any more.

        Raises:
            MeasurementError: not started yet; SimulationError: a prediction left the numbers.
        """
        estimator = self._estimator
        for posterior in self.due(present) if self.lag > 0 else ():
            later = estimator.filter.predict(posterior, posterior.stamp + ahead)
            yield replace(estimator.describe(later), counts=estimator.counts)
        if self.lag == 0 or present - self.lag > estimator.stamp:
            yield estimator.estimate(present - self.lag + ahead)

    def forget(self) -> None:
        """Owe nothing of what was measured so far."""
        self._given = self._newest = 0
        self._history, self._left, self._known = self._estimator.history, [], {}

    def settle(self, node: Node) -> None:
        """Keep a node that the estimator forgets before it was given out."""
        if _stamp(node) > self._given:
            self._left.append(node)

    def due(self, present: int) -> Iterator[Posterior]:
        """What is due at the present time, ns on the clock of the measurements, oldest first."""
        history = self._estimator.history
        if history is not self._history:  # begun anew
            yield from self.rest()
            self._history = history
        nodes = [*self._left, *history.nodes] if self._left else history.nodes
        if nodes and _stamp(nodes[-1]) < self._given:  # time jumped back
            self._given = 0
        while (first := bisect_right(nodes, self._given, key=_stamp)) < len(nodes):
            stamp = _stamp(nodes[first])
            if present <= stamp + self.lag:
                break
            after = bisect_right(nodes, stamp, key=_stamp)
            window = nodes[first : bisect_right(nodes, stamp + self.lag, key=_stamp)]
            following = _stamp(nodes[after]) if after < len(nodes) else stamp + 1
            self._given = stamp
            if not self._timely(stamp):
                continue
            for key in [key for key in self._known if key[0].stamp < stamp]:
                del self._known[key]
            yield from (each for each in self._smoothed(window) if each.stamp < following)
        self._left = []
        self._newest = _stamp(nodes[-1]) if nodes else 0

    def rest(self) -> Iterator[Posterior]:
        """What is owed of the nodes that the estimator has forgotten: all of it after ``Estimator.reset``."""
        left, self._left = self._left, []
        if left:
            self._given = _stamp(left[-1])
            smoothed = self._smoothed(left)
            if self.lag == WHOLE and (again := timed(self._estimator.filter, left, smoothed)) is not left:
                smoothed = self._smoothed(again)
            yield from (each for each in smoothed if self._timely(each.stamp))

    def _timely(self, stamp: int) -> bool:
        """Whether an estimate may be: without a lag, of what was the newest once, and neither late nor a start's."""
        return self.lag > 0 or stamp == self._newest

    def _smoothed(self, nodes: Sequence[Node]) -> list[Posterior]:
        return smooth(self._estimator.filter, nodes, self._period, self._known)


def _stamp(node: Node) -> int:
    return node.measurement.stamp
