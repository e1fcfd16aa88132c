"""The square-root error-state filter on the manifold: predict, gate, update.

It is a function from a posterior and a measurement to a posterior, with no memory of its own: the history re-rolls it at
will, and the same measurements give the same numbers in whatever order they came.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from physics_prior.dynamics.contact.impulse import push_out
from physics_prior.dynamics.failure import require_followed
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.switches import Hold
from physics_prior.errors import MeasurementError
from physics_prior.estimation import chi_squared, switching
from physics_prior.estimation.astray import Suspects, suspects
from physics_prior.estimation.gain import gain_of
from physics_prior.estimation.measurement import ForceMeasurement, Measurement, SwitchCommand, command_topic
from physics_prior.estimation.observation import OBSERVERS, Innovation, Observer, check
from physics_prior.estimation.process import Process, State, steps
from physics_prior.estimation.square_root import with_first
from physics_prior.scene import MeasurementSource, Scene

ITERATIONS = 5  # of the update, where one linearisation does not do
SMALL_CORRECTION = 0.02  # rad or m: below it, one does
OF_EFFECTS = SwitchCommand, ForceMeasurement
QUORUM = 0.5  # of the markers of a frame: where the gate refuses more, the estimate is as suspect as they are


@dataclass(eq=False, slots=True)
class Posterior:
    """What is known at a stamp after a measurement.

    Attributes:
        stamp: ns.
        state: the best state.
        factor: (n, n) factor S of its covariance S S^T: lower after a prediction, any after an update; (0, 0) where the
            history has let it go, as another measurement of the stamp was told after it.
        accepted: stamp of the last measurement that was believed, ns.
        refused: how many the gate has refused since.
        used: whether the last one was believed; None where it said nothing or did not fit.
        nis: its normalised innovation squared; dimension: what that is expected to be.
        log_determinant: of the covariance of that innovation.
        start: whether it is a (re)start from measurements alone.
        begun: stamp of the scene's time zero, ns.
        holds: what holds, effect by effect of those that can.
        astray: parts whose markers the gate refuses (astray.py).
        trouble: why the last effect that was to take hold does not; empty if it does.
    """

    stamp: int
    state: State
    factor: np.ndarray
    accepted: int
    refused: int = 0
    used: bool | None = None
    nis: float = 0.0
    dimension: int = 0
    log_determinant: float = 0.0
    start: bool = False
    begun: int = 0
    holds: tuple[Hold, ...] = ()
    astray: Suspects = field(default_factory=dict)
    trouble: str = ""


class Filter:
    """Predicts and updates posteriors by a scene's process and sources.

    Attributes:
        simulator, process: the compiled model and the process model on it.
        sources: topic -> source.
    """

    def __init__(self, scene: Scene, simulator: Simulator, process: Process) -> None:
        self.scene, self.simulator, self.process = scene, simulator, process
        self.sources: dict[str, MeasurementSource] = {source.topic: source for source in scene.measurements}
        self._observers: dict[str, Observer] = {
            source.topic: OBSERVERS[type(source)](source, simulator)
            for source in scene.measurements
            if type(source) in OBSERVERS
        }
        labels = simulator.switches.labels
        commands = {command_topic(label): index - len(labels) for index, label in enumerate(labels)}
        self.order = commands | {topic: index for index, topic in enumerate(self.sources)}
        self._limits: dict[int, float] = {}
        self._here = np.zeros(simulator.nv)  # the error at which a prior itself is

    def predict(self, posterior: Posterior, stamp: int) -> Posterior:
        """The posterior carried to a later stamp, ns; SimulationError if it leaves the numbers or is too fast to follow."""
        if stamp <= posterior.stamp:
            return posterior
        begun = posterior.begun
        for stretch in self.simulator.switches.stretches(posterior.stamp - begun, stamp - begun):
            posterior = self._carry(posterior, begun + stretch.end)
            for event in stretch.events:
                posterior = switching.switch(self, posterior, event.index, event.on)
        return posterior

    def _carry(self, posterior: Posterior, stamp: int) -> Posterior:
        """``predict`` where nothing switches on the way."""
        self.enter(posterior)
        count, h = steps((stamp - posterior.stamp) * 1e-9, self.scene.step.size)
        state = posterior.state.copy()
        factor = self.process.predict(state, posterior.factor, h, count)
        require_followed(self.simulator, state.v, h)
        return self._fresh(posterior, stamp=stamp, state=state, factor=factor)

    @staticmethod
    def _fresh(posterior: Posterior, **changes: Any) -> Posterior:
        """The posterior, with changes, before a measurement has said anything."""
        return replace(posterior, used=None, nis=0.0, dimension=0, log_determinant=0.0, start=False, **changes)

    def enter(self, posterior: Posterior) -> None:
        """Have the simulator hold what the posterior holds, at its time."""
        self.simulator.switches.holds = posterior.holds
        self.simulator.time = (posterior.stamp - posterior.begun) * 1e-9
        self.process.enter(posterior.state)

    def key(self, measurement: Measurement) -> tuple[int, int]:
        """What measurements are ordered by: their stamp, and where it is the same, their topic's place in the scene."""
        return measurement.stamp, self.order[measurement.topic]

    def check(self, measurement: Measurement) -> None:
        """Raise MeasurementError if a measurement does not fit its source."""
        if isinstance(measurement, SwitchCommand) and measurement.topic in self.order:
            return
        if measurement.topic not in self.sources:
            raise MeasurementError(f"topic '{measurement.topic}' is not measured: the scene reads {list(self.sources)}")
        check(self.sources[measurement.topic], measurement)

    @staticmethod
    def observes(measurement: Measurement) -> bool:
        """Whether a measurement is of the configuration; the others tell what holds."""
        return not isinstance(measurement, OF_EFFECTS)

    def innovation(self, measurement: Measurement, state: State) -> Innovation:
        """The measurement, which must fit its source, against a state."""
        return self._observers[measurement.topic].innovation(measurement, state.q)

    def gate_limit(self, dimension: int) -> float:
        """The normalised innovation squared that a measurement of this dimension may have."""
        if dimension not in self._limits:
            self._limits[dimension] = float(chi_squared.quantile(self.scene.gate.probability, dimension))
        return self._limits[dimension]

    def update(self, prior: Posterior, measurement: Measurement, gated: bool = True) -> Posterior:
        """The prior at the measurement's stamp, updated by it, if the gate lets it pass; each marker of a frame by itself.

        Iterated (Gauss-Newton, Bell and Cathey 1993) where the correction is too large for one linearisation.
        """
        if not self.observes(measurement):
            active = [hold.active for hold in prior.holds]
            return switching.switch(self, self._fresh(prior), *switching.decision(self, measurement, active))
        self.enter(prior)
        seen = self.innovation(measurement, prior.state)
        if len(seen.y) == 0:
            return self._fresh(prior)
        U = np.ascontiguousarray(prior.factor.T)
        many, doubtful, partly = gated and len(seen.y) > seen.block, False, False
        astray, passed = prior.astray, None
        if len(seen.y) > seen.block:
            U = with_first(U, self.simulator.nv)  # what is seen then depends on as many rows of U
        if many:
            believed = seen.squares(U) <= self.gate_limit(seen.block)
            doubtful = float(np.mean(believed)) < QUORUM
            if seen.links is not None and not doubtful and (astray or not believed.all()):
                patience = round(self.scene.health.degraded_after * 1e9)
                astray, lost = suspects(astray, prior.stamp, patience, seen.links, believed)
                passed = seen.kept(believed) if lost.any() else None
                believed = believed | lost
            partly = not (doubtful or believed.all())
            if partly:
                seen = seen.kept(believed)
        gain = gain_of(U, seen, self._here)
        if doubtful or (gated and not many and not gain.nis <= self.gate_limit(len(seen.y))):
            return replace(
                prior,
                nis=gain.nis,
                dimension=len(seen.y),
                log_determinant=gain.log_determinant,
                refused=prior.refused + 1,
                used=False,
                start=False,
            )
        state = self.process.displace(prior.state, gain.correction)
        last = gain
        for _ in range(ITERATIONS - 1 if gain.change >= SMALL_CORRECTION else 0):
            seen = self.innovation(measurement, state)
            seen = seen.kept(believed) if partly else seen
            last = gain_of(U, seen, self.process.tangent(prior.state, state))
            state = self.process.displace(prior.state, last.correction)
            if last.change < 1e-3 * SMALL_CORRECTION:  # of what is seen: the rest, rates and forces, goes with it
                break
        # a part found again is as surprising as a start
        figures = gain if passed is None else gain_of(U, passed, self._here)
        state, factor = self.process.settle(state, last.factor())
        self.constrain(state, factor)
        return Posterior(
            prior.stamp,
            state,
            factor,
            accepted=prior.stamp,
            used=True,
            nis=figures.nis,
            dimension=len((passed or seen).y),
            log_determinant=figures.log_determinant,
            begun=prior.begun,
            holds=self.simulator.switches.holds,
            astray=astray,
            trouble=prior.trouble,
        )

    @property
    def constrained(self) -> bool:
        """Whether there are constraints that the process knows."""
        return (
            self.simulator.rows > 0 or len(self.simulator.candidates) > 0
        ) and self.process.n == 2 * self.simulator.nv

    def constrain(self, state: State, factor: np.ndarray) -> None:
        """Put state and covariance onto what the simulator holds; what holds its part wherever it is moves with it.

        What overlaps is pushed apart; what approaches it is for the next step to stop.
        """
        if self.constrained:
            if len(self.simulator.candidates):
                push_out(self.simulator.memory.array, state.q)
            switches = self.simulator.switches
            switches.holds = switches.recaught(state.q)
            self.simulator.constrain(state.q, state.v, factor)
        self.process.admit(state, factor)
