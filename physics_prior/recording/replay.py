"""Replay: a recording through the estimator, as fast as it goes and without ROS; the second door to the one core.

Messages are taken in the order in which they were logged, so that late ones come late here too. Where nothing comes, the
estimate is carried on at the rate at which the node would publish it.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from physics_prior.errors import RecordingError
from physics_prior.estimation import chi_squared
from physics_prior.estimation.estimate import Counts, Estimate, Health, Level
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import Posterior
from physics_prior.estimation.force_score import Comparison, ForceScore
from physics_prior.estimation.history import Node
from physics_prior.estimation.lagged import WHOLE, Lagged
from physics_prior.estimation.readout import deviations, evaluate, measured_acceleration, unit
from physics_prior.estimation.score import FROM_SECONDS, Score
from physics_prior.interface import Output, take_in
from physics_prior.model.coordinates import coordinate_errors
from physics_prior.recording.reader import BagReader, open_bag
from physics_prior.recording.references import read_references
from physics_prior.recording.writer import BagWriter
from physics_prior.scene import Scene

NANOSECONDS = 1e9
BAND = 0.95
HISTORY_SECONDS = 1.0
MARKER_PERIOD = 1.0 / 30.0  # s
DIAGNOSTICS_PERIOD = 1.0  # s
FOREVER = 1e9  # s


@dataclass
class ReplayResult:
    """What a replay found.

    Attributes:
        scene: what was estimated; lag: s after each estimate that measurements told it, infinite for all of them.
        epoch: stamp of the first estimate, ns; all other times count from it.
        stamps: (k,) seconds.
        q: (k, nq) configurations; spread: (k, nv) standard deviations of their coordinates (model/coordinates.py).
        readouts, deviations: readout name -> (k,) or (k, 3); values and standard deviations; units by name.
        health: (k,) Level.
        reference_stamps, reference: (r,) seconds, and readout name -> (r,) or (r, 3) at the reference state, where one fixes it.
        nis_stamps, nis, nis_dimension: (n,) seconds and innovations of each measurement that was used or gated.
        gated, topics: (n,) whether the gate refused it, and where it came from.
        counts: what became of the measurements; loss: what a damaged bag lost, or None.
        score: errors against the references (Score.summary, and ``forces`` by Comparison.figures), or None.
        forces, weight: what the ground does against force plates, by name (ForceScore), and the model's weight, N.
        span_s, wall_s, health_s: seconds of the recording, of the replay, and in each health.
    """

    scene: Scene
    lag: float = 0.0
    epoch: int = 0
    counts: Counts = field(default_factory=Counts)
    loss: str | None = None
    stamps: np.ndarray = field(default_factory=lambda: np.zeros(0))
    q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    spread: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    readouts: dict[str, np.ndarray] = field(default_factory=dict)
    deviations: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    health: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    reference_stamps: np.ndarray = field(default_factory=lambda: np.zeros(0))
    reference: dict[str, np.ndarray] = field(default_factory=dict)
    nis_stamps: np.ndarray = field(default_factory=lambda: np.zeros(0))
    nis: np.ndarray = field(default_factory=lambda: np.zeros(0))
    nis_dimension: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    gated: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    topics: list[str] = field(default_factory=list)
    score: dict[str, Any] | None = None
    forces: dict[str, Comparison] = field(default_factory=dict)
    weight: float = 0.0
    span_s: float = 0.0
    wall_s: float = 0.0
    health_s: dict[str, float] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """What told the estimates, in words."""
        if math.isinf(self.lag):
            return "smoothed by the whole recording"
        return f"smoothed by {1e3 * self.lag:g} ms more" if self.lag > 0.0 else "causal"

    def summary(self) -> dict[str, Any]:
        """The figures of ``replay --json``: plain numbers, None where there is none."""
        nis, dimension = self.nis[~self.gated], self.nis_dimension[~self.gated]
        mean = expected = low = high = None
        if len(nis):
            mean, expected = float(nis.mean()), float(dimension.mean())
            low, high = (float(bound) / len(nis) for bound in chi_squared.interval(BAND, float(dimension.sum())))
        return {
            "lag_s": None if math.isinf(self.lag) else self.lag,
            "measurements": dict(vars(self.counts)),
            "span_s": self.span_s,
            "wall_s": self.wall_s,
            "realtime_factor": self.span_s / self.wall_s if self.wall_s > 0.0 else None,
            "nis": {"mean": mean, "expected": expected, "band95": [low, high]},
            "health": self.health_s,
            "reference": self.score,
        }


def replay(
    bag: Path,
    scene: Scene,
    out: Path | None = None,
    smooth: bool = False,
    lag: float = 0.0,
    process: str = "physics",
    references: Sequence[str] = (),
    publish_rate: float = 30.0,
    until: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> ReplayResult:
    """Run a recording through a scene's estimator.

    out: a bag to write, with the topics of the node. smooth: estimate each stamp from the whole recording; lag: or from what was
    measured up to so many s after it. references: topics to score against, a JointState and WrenchStamped ones of force plates.
    publish_rate: Hz, of predictions where nothing is measured. until: s after the bag's first measurement, where to stop.
    progress: told the share that is done.

    Raises:
        RecordingError: the bag, a topic or the output is not usable; nothing is left half-written.
        SimulationError: the scene's motion cannot be computed.
    """
    return _Replay(bag, scene, math.inf if smooth else lag, process, references, publish_rate, until).run(out, progress)


class _Replay:
    """One run: the estimator, what it said, and where that goes."""

    def __init__(
        self,
        bag: Path,
        scene: Scene,
        lag: float,
        process: str,
        references: Sequence[str],
        publish_rate: float,
        until: float | None,
    ) -> None:
        self.reader = open_bag(bag)
        self.until = FOREVER if until is None else until
        self.scene, self.period = scene, 1.0 / publish_rate
        self.sources = _sources(self.reader, scene)
        self.reference, plates = read_references(self.reader, references, scene)
        self.estimator = Estimator(scene, process, FOREVER if math.isinf(lag) else HISTORY_SECONDS + lag)
        self.estimator.on_settled = self._settle
        self.simulator, self.process = self.estimator.simulator, self.estimator.filter.process
        self.score = Score(scene, self.simulator, self.reference.names) if self.reference is not None else None
        self.force_score = ForceScore(scene, self.simulator, plates) if plates else None
        self.lagged = Lagged(self.estimator, WHOLE if math.isinf(lag) else round(lag * NANOSECONDS), self.period)
        self.result = ReplayResult(scene, lag, loss=self.reader.loss)
        self.rows: list[tuple[int, int, dict[str, np.ndarray], dict[str, np.ndarray]]] = []
        self.motion: list[tuple[np.ndarray, np.ndarray]] = []
        self.true: list[tuple[int, dict[str, np.ndarray]]] = []
        self.innovations: list[tuple[int, float, int, bool, str]] = []
        self.first_stamp: int | None = None
        self.next_markers = self.next_diagnostics = 0
        self.active: list[str] = []

    def run(self, out: Path | None, progress: Callable[[float], None] | None) -> ReplayResult:
        began = time.perf_counter()
        with ExitStack() as stack:
            self.writer = stack.enter_context(BagWriter(out)) if out is not None else None
            self.output = Output(self.scene, self.simulator, self.result.lag)
            if self.writer is not None:
                for topic, message_type in self.output.topics.items():
                    self.writer.add_topic(_absolute(topic), message_type)
            for log_time, posterior in self._posteriors(progress):
                self._emit(posterior, log_time)
        self._finish(time.perf_counter() - began)
        return self.result

    def _posteriors(self, progress: Callable[[float], None] | None) -> Iterator[tuple[int, Posterior]]:
        """The posteriors as they are due, and predictions where none is measured, with the log time of each."""
        total = sum(self.reader.topics[topic].count for topic in self.sources)
        lagged, period = self.lagged, round(self.period * NANOSECONDS)
        arrived = stamp = coasting = 0  # log time and stamp of the newest measurement, and how long none has come, ns
        self.first_log = self.last_log = 0

        def logged(posterior: Posterior) -> int:
            """When its lag has passed; a smoothed recording has no such time."""
            return posterior.stamp if lagged.lag == WHOLE else arrived + max(0, posterior.stamp + lagged.lag - stamp)

        for index, record in enumerate(self.reader.read(self.sources)):
            self.first_log = self.first_log or record.log_time_ns
            if record.log_time_ns - self.first_log > self.until * NANOSECONDS:
                break
            self.last_log = max(self.last_log, record.log_time_ns)
            if progress is not None and index % 100 == 0:
                progress(index / total)
            while arrived and record.log_time_ns - arrived > period + coasting:
                coasting += period
                for posterior in lagged.due(stamp + coasting):
                    yield logged(posterior), posterior
                if coasting > lagged.lag and self.estimator.ready:
                    newest = self.estimator.history.nodes[-1].posterior
                    yield arrived + coasting, self.estimator.filter.predict(newest, stamp + coasting - lagged.lag)
            changed = take_in(self.estimator, self.sources[record.topic], record.message_type, record.data)
            for posterior in lagged.due(self.estimator.stamp):
                yield min(record.log_time_ns, logged(posterior)), posterior
            if changed:
                arrived, stamp, coasting = record.log_time_ns, self.estimator.stamp, 0
        self.estimator.reset()
        for posterior in lagged.rest():
            yield logged(posterior), posterior
        if progress is not None:
            progress(1.0)

    def _emit(self, posterior: Posterior, log_time: int) -> None:
        """Note an estimate, score it and file it."""
        health = self.estimator.health_of(posterior, posterior.stamp)
        self.estimator.filter.enter(posterior)
        if self.first_stamp is None:
            self.first_stamp = posterior.stamp
        state = posterior.state
        vdot = measured_acceleration(state.acceleration)
        values = evaluate(self.scene.readouts, self.simulator, state.q, state.v, vdot)
        spread = deviations(self.scene.readouts, self.simulator, self.process, posterior)
        self.rows.append((posterior.stamp, int(health.level), values, spread))
        errors = coordinate_errors(self.scene.tree, state.q, posterior.factor[: self.simulator.nv])
        self.motion.append((state.q.copy(), np.linalg.norm(errors, axis=1)))
        settled = posterior.stamp - self.first_stamp >= FROM_SECONDS * NANOSECONDS
        if settled:
            self._compare(posterior, vdot)
        if settled and self.force_score is not None:
            self.estimator.filter.enter(posterior)
            self.force_score.add(posterior.stamp, state.q, state.v, self.simulator.wrenches(state.q, state.v, vdot))
        if self.writer is not None:
            self._file(self.estimator.describe(posterior), log_time, health)

    def _compare(self, posterior: Posterior, vdot: np.ndarray | None) -> None:
        if self.reference is None or self.score is None:
            return
        at = self.reference.at(posterior.stamp)
        if at is not None:
            names = self.reference.names
            positions = dict(zip(names, at[0].tolist(), strict=True))
            velocities = dict(zip(names, at[1].tolist(), strict=True))
            true = self.score.add(posterior.state.q, posterior.state.v, vdot, positions, velocities)
            if true is not None:
                self.true.append((posterior.stamp, true))

    def _file(self, estimate: Estimate, log_time: int, health: Health) -> None:
        """Write what the node would: states each time, pictures and diagnostics at their pace, these also when effects change."""
        assert self.writer is not None
        publications = self.output.states(estimate)
        if log_time >= self.next_markers:
            publications += self.output.markers(estimate)
            self.next_markers = log_time + round(MARKER_PERIOD * NANOSECONDS)
        active = self.output.active_effects(estimate)
        if log_time >= self.next_diagnostics or active != self.active:
            publications += self.output.diagnostics(estimate.stamp, health, self.estimator.counts, estimate)
            self.next_diagnostics = log_time + round(DIAGNOSTICS_PERIOD * NANOSECONDS)
            self.active = active
        for topic, message in publications:
            self.writer.write(_absolute(topic), message, log_time)

    def _settle(self, node: Node) -> None:
        """Note the innovation of a node whose outcome is final."""
        self.lagged.settle(node)
        posterior = node.posterior
        if posterior.used is not None and posterior.dimension > 0:
            self.innovations.append(
                (node.measurement.stamp, posterior.nis, posterior.dimension, not posterior.used, node.measurement.topic)
            )

    def _finish(self, wall: float) -> None:
        result = self.result
        result.counts, result.wall_s = self.estimator.counts, wall
        if not self.rows or self.first_stamp is None:
            raise RecordingError(
                f"{self.reader.path}: the measurements on {list(self.sources)} never fixed the configuration of scene"
                f" '{self.scene.name}' ({self.estimator.last_rejection or 'too few of them agree'})"
            )
        stamps = np.array([row[0] for row in self.rows], dtype=np.int64)
        result.epoch = self.first_stamp
        result.stamps = (stamps - self.first_stamp) / NANOSECONDS
        result.health = np.array([row[1] for row in self.rows])
        result.q, result.spread = (np.array(each) for each in zip(*self.motion, strict=True))
        for readout in self.scene.readouts:
            result.readouts[readout.name] = np.array([row[2][readout.name] for row in self.rows])
            result.deviations[readout.name] = np.array([row[3][readout.name] for row in self.rows])
            result.units[readout.name] = unit(readout, self.simulator)
        result.span_s = (self.last_log - self.first_log) / NANOSECONDS
        result.health_s = _durations(stamps, result.health, self.first_log)
        if self.innovations:
            at, nis, dimension, gated, topics = zip(*self.innovations, strict=True)
            result.nis_stamps = (np.array(at) - self.first_stamp) / NANOSECONDS
            result.nis, result.nis_dimension = np.array(nis), np.array(dimension)
            result.gated, result.topics = np.array(gated), list(topics)
        if self.reference is not None and self.score is not None:
            result.score = self.score.summary()
            if self.true:
                result.reference_stamps = (np.array([stamp for stamp, _ in self.true]) - self.first_stamp) / NANOSECONDS
                result.reference = {
                    readout.name: np.array([values[readout.name] for _, values in self.true])
                    for readout in self.scene.readouts
                }
            else:  # positions alone, or not of all joints
                result.reference_stamps = (self.reference.stamps - self.first_stamp) / NANOSECONDS
                result.reference = {
                    readout.name: self.reference.positions[:, self.reference.names.index(readout.name)]
                    for readout in self.score.compared
                }
        if self.force_score is not None:
            result.forces = self.force_score.comparisons()
            result.weight = self.force_score.weight
            figures = {name: each.figures(result.weight) for name, each in result.forces.items()}
            result.score = {"from_s": FROM_SECONDS, **(result.score or {}), "forces": figures}


def _sources(reader: BagReader, scene: Scene) -> dict[str, Any]:
    """The scene's sources by topic, each checked to be in the bag with a type that it takes."""
    if not scene.measurements:
        raise RecordingError(f"scene '{scene.name}' measures nothing: add 'measurements' to replay a bag with it")
    for source in scene.measurements:
        reader.require_topic(source.topic, *source.message_types)
    return {source.topic: source for source in scene.measurements}


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"


def _durations(stamps: np.ndarray, health: np.ndarray, first_log: int) -> dict[str, float]:
    """Seconds in each health: an estimate stands for the time since the one before it."""
    out = {level.name: 0.0 for level in Level}
    out[Level.LOST.name] += max(0.0, (int(stamps[0]) - first_log) / NANOSECONDS)
    for span, level in zip(np.diff(stamps) / NANOSECONDS, health[1:], strict=True):
        out[Level(int(level)).name] += max(0.0, float(span))
    return out
