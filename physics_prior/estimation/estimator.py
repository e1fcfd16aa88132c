"""The estimator: measurements in, estimates out. The one core behind both doors, the node and the replay."""

from bisect import insort
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from physics_prior.dynamics.wrench_deviations import wrench_deviations
from physics_prior.errors import MeasurementError, SimulationError
from physics_prior.estimation.estimate import Counts, Estimate, Health, Level
from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.history import START_WINDOW, History, Node
from physics_prior.estimation.measurement import Measurement, SwitchCommand, command_topic
from physics_prior.estimation.processes import PROCESSES
from physics_prior.estimation.readout import force_errors
from physics_prior.estimation.square_root import covariance_of
from physics_prior.estimation.start import start
from physics_prior.estimation.switching import active_at_start
from physics_prior.scene import Scene

JUMP_AFTER = 5  # measurements in a row that find no place: the clock has jumped (a looped bag)
STREAK = 3  # refused measurements in a row that degrade health
DIFFERENCE = 1e-3  # of a standard deviation: the step of the forces' directional derivatives


class Estimator:
    """Estimates the state of a scene from measurements in any order.

    Nothing that a measurement brings makes it raise; what is odd is counted and explained by ``last_rejection``.

    Attributes:
        scene, simulator, filter: what it works with.
        history: what it remembers.
        last_rejection: why the last rejected measurement was.
        on_settled: told each node whose outcome is final, oldest first.
    """

    def __init__(self, scene: Scene, process: str = "physics", history_length: float = 1.0) -> None:
        self.scene = scene
        # a covariance has no rest: what stands still may yet be moving, as far as is known
        self.simulator = scene.simulator(sleeping=False)
        self.filter = Filter(scene, self.simulator, PROCESSES[process](scene, self.simulator))
        self.history = History(self.filter, round(history_length * 1e9))
        self.last_rejection = ""
        self._read = self._late = self._rejected = 0
        self._dropped = Counts()
        self.on_settled: Callable[[Node], None] = lambda node: None
        self._begun: int | None = None  # stamp of the first measurement: the scene's time zero
        self._early: list[Measurement] = []  # before the start and what it was made from
        self._stale: list[Measurement] = []

    @property
    def ready(self) -> bool:
        """Whether there is an estimate."""
        return bool(self.history)

    @property
    def stamp(self) -> int:
        """Stamp of the newest measurement in the estimate, ns; 0 before the start."""
        return self.history.nodes[-1].measurement.stamp if self.history else 0

    @property
    def counts(self) -> Counts:
        """What became of the measurements so far."""
        outcomes, gone = [node.posterior.used for node in self.history.nodes], self._dropped
        used, gated = gone.used + outcomes.count(True), gone.gated + outcomes.count(False)
        return Counts(self._read, used, gated, self._late, self._rejected)

    def reset(self) -> None:
        """Settle and forget all measurements; the next ones start it cold."""
        for node in self.history.nodes:
            self._settle(node)
        self.history = History(self.filter, self.history.length)
        self._early, self._stale, self._begun = [], [], None

    def reject(self, why: str) -> None:
        """Count a message that could not be made a measurement, and say why."""
        self._read += 1
        self._rejected += 1
        self.last_rejection = why

    def add(self, measurement: Measurement) -> bool:
        """Take in a measurement; return whether the newest estimate changed."""
        self._read += 1
        try:
            self.filter.check(measurement)
        except MeasurementError as problem:
            self._rejected += 1
            self.last_rejection = str(problem)
            return False
        return self._take(measurement)

    def switch(self, effect: str, on: bool, stamp: int) -> bool:
        """Have an effect that holds something take hold or let go at a stamp, ns; return whether the newest estimate changed.

        A command has its place in the history as a measurement has, before those of its stamp: it may come late. Other
        commands, the schedule and measured forces after it hold as well: the last word counts. Before the start, any stamp does.
        """
        command = SwitchCommand(stamp, command_topic(effect), effect, on)
        if not self.history and command.topic in self.filter.order:  # of two at one stamp the later word counts
            self._early = [each for each in self._early if self.filter.key(each) != self.filter.key(command)]
        return self.add(command)

    def estimate(self, stamp: int | None = None) -> Estimate:
        """The newest estimate, or what it predicts for a later stamp, ns.

        Raises:
            MeasurementError: not started yet; SimulationError: the prediction left the numbers.
        """
        if not self.history:
            raise MeasurementError("there is no estimate yet: measurements have not fixed the configuration")
        newest = self.history.nodes[-1].posterior
        posterior = newest if stamp is None else self.filter.predict(newest, stamp)
        return replace(self.describe(posterior), counts=self.counts)

    def health_at(self, stamp: int) -> Health:
        """Health of the estimate at a stamp, ns."""
        if not self.history:
            return Health(Level.LOST, "waiting for measurements that fix the configuration")
        return self.health_of(self.history.nodes[-1].posterior, stamp)

    def describe(self, posterior: Posterior) -> Estimate:
        """The estimate that a posterior stands for: forces and their uncertainty, and its health."""
        simulator, nv, state = self.simulator, self.simulator.nv, posterior.state
        self.filter.enter(posterior)
        by_physics = len(state.acceleration) == 0
        wrenches = simulator.wrenches(state.q, state.v, None if by_physics else state.acceleration)
        effort = simulator.effort if by_physics else np.zeros(nv)
        vdot = simulator.acceleration(state.q, state.v) if by_physics else state.acceleration
        rank = simulator.rank
        deviations = self._wrench_deviations(posterior)
        error = simulator.constraint_error(state.q, state.v)
        return Estimate(
            stamp=posterior.stamp,
            q=state.q.copy(),
            v=state.v.copy(),
            covariance=covariance_of(posterior.factor[: 2 * nv]),
            vdot=vdot.copy(),
            effort=effort,
            wrenches=wrenches,
            wrench_deviations=dict(zip(simulator.wrench_names, deviations, strict=True)),
            constraint_error=float(np.max(np.abs(error))) if len(error) else 0.0,
            rank=rank,
            health=self.health_of(posterior, posterior.stamp),
            nis=(posterior.nis, posterior.dimension),
            rows=simulator.switches.rows,
            holding=simulator.switches.holding,
        )

    def _wrench_deviations(self, posterior: Posterior) -> np.ndarray:
        """(wrenches, 6) standard deviations: P_w = (dw/dx) P (dw/dx)^T, by differences along the columns of P's factor.

        Of the forces that go with the state; the white force noise itself has none that a moment's value could have. Those of
        contact are given that what touches goes on touching.
        """
        process, simulator, here = self.filter.process, self.simulator, posterior.state
        if not (simulator.touching or len(here.acceleration)):
            return wrench_deviations(simulator, here.q, here.v, posterior.factor, DIFFERENCE)
        total = np.zeros((len(simulator.wrench_names), 6))
        for column in force_errors(simulator, posterior).T:
            if not column.any():
                continue
            pair = []
            for sign in (DIFFERENCE, -DIFFERENCE):
                state = process.displace(here, sign * column)
                process.enter(state)
                vdot = state.acceleration if len(state.acceleration) else None
                pair.append(simulator.wrench_array(state.q, state.v, vdot))
            total += ((pair[0] - pair[1]) / (2.0 * DIFFERENCE)) ** 2
        process.enter(here)
        return np.sqrt(total)

    def health_of(self, posterior: Posterior, stamp: int) -> Health:
        """Health of a posterior at a stamp, ns, that may be later than its own."""
        age = (stamp - posterior.accepted) * 1e-9
        if age > self.scene.health.lost_after:
            return Health(Level.LOST, f"no measurement was accepted for {age:.1f} s")
        if age > self.scene.health.degraded_after:
            return Health(Level.DEGRADED, f"no measurement was accepted for {age:.2f} s: the state is predicted")
        if posterior.trouble:
            return Health(Level.DEGRADED, posterior.trouble)
        if posterior.refused >= STREAK:
            return Health(Level.DEGRADED, f"the gate refused the last {posterior.refused} measurements")
        return Health(Level.OK)

    def _take(self, measurement: Measurement) -> bool:
        misplaced = self._misplaced(measurement)
        if misplaced:
            return self._set_aside(measurement, misplaced)
        self._stale.clear()
        self._late += measurement.stamp < self._newest
        if not isinstance(measurement, SwitchCommand):
            self._begun = min(measurement.stamp, measurement.stamp if self._begun is None else self._begun)
        try:
            changed = self._put(measurement)
        except SimulationError as problem:
            self.last_rejection = str(problem)
            self.reset()
            self._early = [measurement]
            return False
        for node in self.history.trim():
            self._settle(node)
        return changed

    @property
    def _newest(self) -> int:
        """Stamp of the newest measurement, ns; 0 before the first."""
        if self.history:
            return self.history.nodes[-1].measurement.stamp
        waiting = (each.stamp for each in reversed(self._early) if not isinstance(each, SwitchCommand))
        return next(waiting, 0)

    def _misplaced(self, measurement: Measurement) -> str:
        """Why a measurement finds no place; empty if it does."""
        history, newest = self.history, self._newest
        if history.ends_before(measurement):
            lost = (measurement.stamp - newest) * 1e-9 > self.scene.health.lost_after
            return "is so far ahead of all others that the estimate would be lost by then" if lost else ""
        if history.holds(measurement) or self.filter.key(measurement) in map(self.filter.key, self._early):
            return "was doubled"
        if isinstance(measurement, SwitchCommand) and not history:
            return ""
        oldest = newest - START_WINDOW
        if history:
            oldest = history.nodes[0].measurement.stamp - START_WINDOW
            if not history.from_start and not history.reaches(measurement):
                return "is older than the history"
        return "is older than the start" if measurement.stamp < oldest else ""

    def _put(self, measurement: Measurement) -> bool:
        """Put a measurement in its place. One at the start or before it changes the start: all are taken again, in order.

        So the start, too, depends on what was measured and not on when it arrived.
        """
        if self.history and self.history.reaches(measurement) and measurement.stamp > self.history.begun:
            self.history.insert(measurement)
        elif measurement.stamp >= self._newest and not self.history:
            self._put_newest(measurement)
        else:
            known = [*self._early, *(node.measurement for node in self.history.nodes), measurement]
            self.history, self._early = History(self.filter, self.history.length), []
            for each in sorted(known, key=self.filter.key):
                self._put_newest(each)
        return self.ready

    def _put_newest(self, measurement: Measurement) -> None:
        """Put a measurement after all others; a stamp newer than the waiting ones' tells that theirs are complete.

        Not one so far ahead that a start from them would be lost by then: then it is this one that waits.
        """
        stamp = self._early[-1].stamp if self._early else measurement.stamp
        complete = 0.0 < (measurement.stamp - stamp) * 1e-9 <= self.scene.health.lost_after
        if self.history or (complete and self._start(stamp)):
            self.history.insert(measurement)
            return
        oldest = measurement.stamp - START_WINDOW
        last_words = {each.topic: each for each in self._early if not self.filter.observes(each)}
        self._early = [each for each in self._early if each.stamp > oldest or last_words.get(each.topic) is each]
        insort(self._early, measurement, key=self.filter.key)

    def _start(self, stamp: int) -> bool:
        """Start from the waiting measurements at a stamp, or from the newest of every topic about it."""
        together = [each for each in self._early if each.stamp == stamp]
        newest = {each.topic: each for each in self._early}
        begun = stamp if self._begun is None else self._begun
        active = active_at_start(self.filter, begun, stamp, self._early)
        for chosen in (together, list(newest.values())):
            posterior = start(self.filter, chosen, stamp, begun, active)
            if posterior is not None:
                self.history.begin([each for each in chosen if each.stamp == stamp], posterior)
                self._early = [each for each in self._early if each.stamp < stamp]
                return True
        return False

    def _set_aside(self, measurement: Measurement, why: str) -> bool:
        """Keep a measurement that finds no place; enough of them in a row mean that the clock has jumped."""
        late = 0 <= self._newest - measurement.stamp <= START_WINDOW
        if not late and not isinstance(measurement, SwitchCommand):  # neither tells anything about the clock
            self._stale.append(measurement)
        self._rejected += 1
        self.last_rejection = f"topic '{measurement.topic}': a measurement {why}"
        if len(self._stale) < JUMP_AFTER:
            return False
        again = self._stale
        self.reset()
        self._rejected -= len(again)
        self.last_rejection = "time jumped: the estimate was started anew"
        changed = [self._take(each) for each in again]
        return any(changed)

    def _settle(self, node: Node) -> None:
        """Count a node whose outcome is final, and hand it on."""
        self._dropped.used += node.posterior.used is True
        self._dropped.gated += node.posterior.used is False
        self.on_settled(node)
