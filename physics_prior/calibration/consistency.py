"""How noisy markers must be said to be, so that the filter's innovations are as large as it expects (Mehra 1970)."""

import math
from collections.abc import Sequence

from physics_prior.errors import MeasurementError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.history import Node
from physics_prior.estimation.measurement import Measurement
from physics_prior.scene import Scene


def noise_ratio(scene: Scene, measurements: Sequence[Measurement]) -> float:
    """Root mean square innovation of a recording, in its own standard deviations.

    Raises:
        MeasurementError: the estimate never starts.
    """
    nodes: list[Node] = []
    estimator = Estimator(scene)
    estimator.on_settled = nodes.append
    for measurement in measurements:
        estimator.add(measurement)
    estimator.reset()
    told = [node.posterior for node in nodes if node.posterior.used and node.posterior.dimension]
    if not told:
        raise MeasurementError(
            "the calibrated person does not explain a frame of the trial: is it the right marker set?"
        )
    return math.sqrt(sum(each.nis for each in told) / sum(each.dimension for each in told))
