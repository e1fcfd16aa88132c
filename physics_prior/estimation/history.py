"""The history: measurements in order of their stamps, each with the posterior after it.

A late measurement is put in its place and everything after it is rolled again, so that what is known in the end depends on
what was measured and not on when it arrived (the ordered map of past updates that Pronto keeps).
"""

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.measurement import Measurement
from physics_prior.estimation.start import start

NONE = np.empty((0, 0))
START_WINDOW = 100_000_000  # ns: measurements of other topics this much older may help to start


@dataclass
class Node:
    """A measurement and what was known just before and after it."""

    measurement: Measurement
    prior: Posterior
    posterior: Posterior


class History:
    """Ordered nodes over a span of time.

    Of the factors of a stamp only the last is kept, which the next stamp goes on from: a second of 16 poses at 50 Hz, or of a
    person at 100 Hz, would be 30 MB of them, and each new one would push another out of the processor's cache.

    Attributes:
        nodes: oldest first; those older than ``length`` ns before the newest are dropped, but for one to roll from.
        begun: stamp of the start, ns.
    """

    def __init__(self, filter: Filter, length: int) -> None:
        self.filter, self.length = filter, length
        self.nodes: list[Node] = []
        self.begun = 0
        self._keys: list[tuple[int, int]] = []

    def __bool__(self) -> bool:
        return bool(self.nodes)

    @property
    def from_start(self) -> bool:
        """Whether it still reaches back to the start."""
        return bool(self._keys) and self._keys[0][0] == self.begun

    def begin(self, measurements: Iterable[Measurement], posterior: Posterior) -> None:
        """Start anew from a posterior that was made of these measurements."""
        self.nodes = [Node(each, posterior, posterior) for each in sorted(measurements, key=self.filter.key)]
        self._keys = [self.filter.key(node.measurement) for node in self.nodes]
        self.begun = posterior.stamp

    def ends_before(self, measurement: Measurement) -> bool:
        """Whether a measurement comes after all others, as nearly all do."""
        return bool(self._keys) and self.filter.key(measurement) > self._keys[-1]

    def holds(self, measurement: Measurement) -> bool:
        """Whether a measurement of this stamp and topic is there already."""
        key = self.filter.key(measurement)
        place = bisect_left(self._keys, key)
        return place < len(self._keys) and self._keys[place] == key

    def reaches(self, measurement: Measurement) -> bool:
        """Whether a measurement still finds its place: the oldest node is what all others are rolled from."""
        return bool(self._keys) and self.filter.key(measurement) > self._keys[0]

    def insert(self, measurement: Measurement) -> None:
        """Put a measurement in its place, after the start, and roll on from there, or from where a factor is left."""
        key = self.filter.key(measurement)
        place = len(self._keys) if key > self._keys[-1] else bisect_left(self._keys, key)
        before = self.nodes[place - 1].posterior
        self._keys.insert(place, key)
        self.nodes.insert(place, Node(measurement, before, before))
        while not len(self.nodes[place - 1].posterior.factor):
            place -= 1
        for index in range(place, len(self.nodes)):
            self._roll(index)

    def trim(self) -> list[Node]:
        """Drop and return the nodes older than the history's length, all but the newest of them: others roll from it."""
        if len(self._keys) < 2 or self._keys[1][0] >= self._keys[-1][0] - self.length:
            return []
        count = bisect_left(self._keys, (self._keys[-1][0] - self.length, 0)) - 1
        dropped = self.nodes[:count]
        del self.nodes[:count], self._keys[:count]
        return dropped

    def _roll(self, index: int) -> None:
        """Predict and update one node from the one before it; start anew where the gate refused too many in a row."""
        node, before = self.nodes[index], self.nodes[index - 1].posterior
        node.prior = self.filter.predict(before, node.measurement.stamp)
        node.posterior = self.filter.update(node.prior, node.measurement)
        if node.posterior.refused >= self.filter.scene.gate.recover_after:
            restarted = self._restart(index)
            if restarted is not None:
                node.posterior = restarted
        # others go on from the oldest and from starts too; starts and what switches are asked how they began
        shared = node.prior is before and (index == 1 or before.start)
        if not (shared or node.posterior.start) and self.filter.observes(node.measurement):
            node.prior.factor = NONE

    def _restart(self, index: int) -> Posterior | None:
        """A start from the measurements about this node: the gate says the estimate is wrong, so they are believed."""
        stamp = self.nodes[index].measurement.stamp
        newest: dict[str, Measurement] = {}
        for node in reversed(self.nodes[: index + 1]):
            if stamp - node.measurement.stamp > START_WINDOW:
                break
            newest.setdefault(node.measurement.topic, node.measurement)
        together = [each for each in newest.values() if each.stamp == stamp]
        prior = self.nodes[index].prior
        active = [hold.active for hold in self.nodes[index].posterior.holds]
        for chosen in (together, list(newest.values())):
            posterior = start(self.filter, chosen, stamp, prior.begun, active)
            if posterior is not None:
                return posterior
        return None
