"""Compile what a scene calls for before its first measurement comes: the start of a simulation through the real path."""

from itertools import islice

from physics_prior.estimation.estimator import Estimator
from physics_prior.interface.output import Output
from physics_prior.recording.simulate import motion
from physics_prior.scene import Scene

MOMENTS = 3  # a start, an update, and one that tells that the update is complete
AHEAD = 10_000_000  # ns of prediction


def warm_up(scene: Scene) -> None:
    """Run a throwaway estimator of the scene on a few simulated measurements; all its kernels are compiled then.

    Takes 15 to 40 s where the kernels are not in the cache on disk, a tenth of a second where they are.
    """
    estimator = Estimator(scene)
    for moment in islice(motion(scene, estimator.simulator), MOMENTS):
        for measurement in moment.measurements:
            estimator.add(measurement)
    if estimator.ready:
        estimate = estimator.estimate(estimator.stamp + AHEAD)
        output = Output(scene, estimator.simulator)
        output.states(estimate)
        output.markers(estimate)
