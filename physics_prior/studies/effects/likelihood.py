"""The likelihood of recordings under a scene, from the filter's innovations (Schweppe 1965).

log p(measurements) = - 1/2 sum of (NIS + log det(2 pi S)), S the covariance of each innovation. What the gate refuses counts
as if it lay at the gate's edge: an outlier costs the same wherever it is, so that one cannot decide; and so does what an
estimate is started anew from. Measurements that a source scales have their density by what was measured, before the scaling:
else the smallest scale, under which all errors shrink, would win.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from physics_prior.errors import MeasurementError, RecordingError, SimulationError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.history import Node
from physics_prior.estimation.measurement import Measurement
from physics_prior.interface import measurement_of
from physics_prior.recording.cdr import decode
from physics_prior.recording.reader import open_bag
from physics_prior.recording.simulate import motion
from physics_prior.scene import MeasurementSource, PoseSource, Scene

PARTS = 20  # of the recordings, whose own likelihoods are told apart
HORIZON = 0.2  # s, of the forecasts
MOST_FORECASTS = 50  # of a recording

Recordings = Sequence[Sequence[Measurement]]
"""Recordings, each what a scene measures in it, in the order in which it was logged."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """What a scene makes of recordings.

    Attributes:
        log: log-likelihood of the measurements.
        parts: (k,) what of it comes from each part of the recordings; parts are as long as each other, at least PARTS in all.
        rows: numbers measured that it counts; refused: measurements that the gate refused.
        nis: mean normalised innovation squared of those used, per dimension: 1 where model and noise are right.
    """

    log: float
    parts: np.ndarray
    rows: int
    refused: int
    nis: float


def read_measurements(bag: Path, scene: Scene) -> list[Measurement]:
    """What a scene measures in a bag, in the order in which it was logged; messages that are not usable are left out.

    Raises:
        RecordingError: the bag or a topic is missing or of another type, or nothing is usable.
    """
    reader = open_bag(bag)
    sources = {source.topic: source for source in scene.measurements}
    for source in scene.measurements:
        reader.require_topic(source.topic, *source.message_types)
    out = []
    for record in reader.read(sources):
        try:
            out.append(measurement_of(sources[record.topic], decode(record.message_type, record.data), scene))
        except (MeasurementError, RecordingError):
            continue
    if not out:
        raise RecordingError(f"{bag}: holds no usable measurement on {list(sources)}")
    return out


def simulated_measurements(scene: Scene, seed: int, duration: float) -> list[Measurement]:
    """Measurements of a scene's own simulated motion over so many seconds."""
    moments = motion(scene, scene.simulator(), seed=seed, duration=duration)
    return [measurement for moment in moments for measurement in moment.measurements]


def likelihood(scene: Scene, recordings: Recordings) -> Likelihood | None:
    """The likelihood of recordings under a scene; None if its motion leaves the numbers or never starts in one of them."""
    each = math.ceil(PARTS / len(recordings))
    try:
        tallies = [_tally(*_follow(scene, measurements), each) for measurements in recordings]
    except SimulationError:
        return None
    if not all(tally.rows for tally in tallies):
        return None
    parts = np.concatenate([tally.parts for tally in tallies])
    freedom = sum(tally.freedom for tally in tallies)
    nis = sum(tally.nis for tally in tallies) / freedom if freedom else math.nan
    rows, refused = sum(tally.rows for tally in tallies), sum(tally.refused for tally in tallies)
    return Likelihood(float(np.sum(parts)), parts, rows, refused, nis)


def forecast_error(scene: Scene, recordings: Recordings) -> float:
    """Root mean square error of measurements predicted HORIZON ahead without those between, in their standard deviations.

    From posteriors spread over the recordings, of measurements that are believed; NaN where there are none.
    """
    try:
        errors = [error for each in recordings for error in _forecast_errors(*_follow(scene, each))]
    except SimulationError:
        return math.nan
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan


@dataclass
class _Tally:
    """Sums over one recording: as Likelihood has them, ``nis`` not yet over ``freedom``."""

    parts: np.ndarray
    rows: int = 0
    refused: int = 0
    nis: float = 0.0
    freedom: int = 0


def _follow(scene: Scene, measurements: Sequence[Measurement]) -> tuple[Filter, list[Node]]:
    """The filter that followed a recording, and what it knew at each measurement; SimulationError if it left the numbers."""
    estimator = Estimator(scene)
    nodes: list[Node] = []
    estimator.on_settled = nodes.append
    for measurement in measurements:
        estimator.add(measurement)
    estimator.reset()
    return estimator.filter, nodes


def _tally(filter: Filter, nodes: Sequence[Node], parts: int) -> _Tally:
    tally = _Tally(np.zeros(parts))
    scaling = {topic: _scaling(source) for topic, source in filter.sources.items()}
    for node in nodes:
        outcome = _outcome(filter, node)
        if outcome.used is None or outcome.dimension == 0:
            continue
        surprise = outcome.nis if outcome.used else filter.gate_limit(outcome.dimension)
        log = -0.5 * (surprise + outcome.log_determinant + outcome.dimension * math.log(2.0 * math.pi))
        first, last = nodes[0].measurement.stamp, nodes[-1].measurement.stamp
        place = int(parts * (node.measurement.stamp - first) / (last - first + 1))
        tally.parts[place] += log + scaling[node.measurement.topic]
        tally.rows += outcome.dimension
        if outcome.used:
            tally.nis += outcome.nis
            tally.freedom += outcome.dimension
        else:
            tally.refused += 1
    return tally


def _outcome(filter: Filter, node: Node) -> Posterior:
    """What came of a measurement: of one that an estimate was started anew from, that the gate had refused it."""
    anew = node.posterior.start and node.prior is not node.posterior
    return filter.update(node.prior, node.measurement) if anew else node.posterior


def _scaling(source: MeasurementSource) -> float:
    """Logarithm of the determinant of what a source does to measured numbers before they are compared."""
    return 3.0 * math.log(source.scale) if isinstance(source, PoseSource) else 0.0


def _forecast_errors(filter: Filter, nodes: Sequence[Node]) -> Iterator[float]:
    """Errors of forecasts, in standard deviations of the measurement."""
    ahead = round(HORIZON * 1e9)
    stamps = np.array([node.measurement.stamp for node in nodes])
    for first in range(0, len(nodes), max(1, len(nodes) // MOST_FORECASTS)):
        later = int(np.searchsorted(stamps, stamps[first] + ahead))
        if later >= len(nodes) or stamps[later] > stamps[first] + 2 * ahead:
            continue
        measurement = nodes[later].measurement
        if not filter.observes(measurement) or nodes[later].posterior.used is not True:
            continue
        last = int(np.searchsorted(stamps, stamps[first], side="right")) - 1  # of a stamp, knows all of it
        prediction = filter.predict(nodes[last].posterior, measurement.stamp)
        filter.enter(prediction)
        seen = filter.innovation(measurement, prediction.state)
        yield from solve_triangular(seen.noise, seen.y, lower=True)
