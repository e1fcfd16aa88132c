"""The likelihood of a recording under a scene, from the filter's innovations (Schweppe 1965).

log p(measurements) = - 1/2 sum of (NIS + log det(2 pi S)), S the covariance of each innovation. What the gate refuses counts
as if it lay at the gate's edge: an outlier costs the same wherever it is, so that one cannot decide.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from physics_prior.errors import MeasurementError, RecordingError, SimulationError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.history import Node
from physics_prior.estimation.measurement import Measurement
from physics_prior.interface import measurement_of
from physics_prior.recording.cdr import decode
from physics_prior.recording.reader import open_bag
from physics_prior.recording.simulate import motion
from physics_prior.scene import Scene

HORIZON = 0.2  # s, of the forecasts
MOST_FORECASTS = 50


@dataclass(frozen=True)
class Likelihood:
    """What a scene makes of a recording.

    Attributes:
        log: log-likelihood of the measurements.
        rows: numbers measured that it counts; refused: measurements that the gate refused.
        nis: mean normalised innovation squared of those used, per dimension: 1 where model and noise are right.
        forecast: root mean square error of measurements predicted HORIZON ahead without those between, in standard deviations of
            the measurements; NaN where there was none.
    """

    log: float
    rows: int
    refused: int
    nis: float
    forecast: float


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


def likelihood(scene: Scene, measurements: Sequence[Measurement]) -> Likelihood | None:
    """The likelihood of measurements under a scene; None if its motion leaves the numbers or never starts."""
    estimator = Estimator(scene)
    nodes: list[Node] = []
    estimator.on_settled = nodes.append
    try:
        for measurement in measurements:
            estimator.add(measurement)
        estimator.reset()
        forecast = _forecast(estimator, nodes)
    except SimulationError:
        return None
    counted = [node.posterior for node in nodes if node.posterior.used is not None and node.posterior.dimension]
    if not counted:
        return None
    edge = estimator.filter.gate_limit
    log, rows = 0.0, 0
    for each in counted:
        surprise = each.nis if each.used else edge(each.dimension)
        log -= 0.5 * (surprise + each.log_determinant + each.dimension * math.log(2.0 * math.pi))
        rows += each.dimension
    used = [each for each in counted if each.used]
    freedom = sum(each.dimension for each in used)
    nis = sum(each.nis for each in used) / freedom if freedom else math.nan
    return Likelihood(log, rows, len(counted) - len(used), nis, forecast)


def _forecast(estimator: Estimator, nodes: Sequence[Node]) -> float:
    """Error of forecasts from posteriors spread over the recording, in standard deviations of the measurement."""
    ahead, filter = round(HORIZON * 1e9), estimator.filter
    total, count = 0.0, 0
    stamps = np.array([node.measurement.stamp for node in nodes])
    for first in islice(range(len(nodes)), 0, None, max(1, len(nodes) // MOST_FORECASTS)):
        later = int(np.searchsorted(stamps, stamps[first] + ahead))
        if later >= len(nodes) or stamps[later] > stamps[first] + 2 * ahead:
            continue
        measurement = nodes[later].measurement
        if not filter.observes(measurement) or nodes[later].posterior.used is not True:
            continue
        prediction = filter.predict(nodes[first].posterior, measurement.stamp)
        filter.enter(prediction)
        seen = filter.innovation(measurement, prediction.state)
        error = solve_triangular(seen.noise, seen.y, lower=True)
        total, count = total + float(error @ error), count + len(error)
    return math.sqrt(total / count) if count else math.nan
