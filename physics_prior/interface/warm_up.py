"""Compile what a scene calls for before its first measurement comes: a body that seems to stand still, through the real path."""

from dataclasses import replace

from physics_prior.dynamics.beside import derivatives_beside
from physics_prior.estimation.estimator import Estimator
from physics_prior.interface.output import Output
from physics_prior.recording.simulate import motion
from physics_prior.scene import Scene

STAMPS = 3  # a start, an update, and one that tells that the update is complete
AHEAD = 10_000_000  # ns from stamp to stamp, and of prediction


def warm_up(scene: Scene) -> None:
    """Run a throwaway estimator of the scene on what its sources would measure at the start; all its kernels are compiled then.

    Not on a simulation: that would compile ``advance`` too, which an estimate without contacts does not need. Takes 10 to 40 s
    where the kernels are not in the cache on disk, a tenth of a second where they are.
    """
    estimator = Estimator(scene)
    with derivatives_beside(estimator.simulator.step):
        _run(scene, estimator)


def _run(scene: Scene, estimator: Estimator) -> None:
    """The stamps, what is estimated ahead of the last, and what is published of it."""
    start = next(motion(scene, estimator.simulator))
    for index in range(STAMPS):
        for measurement in start.measurements:
            estimator.add(replace(measurement, stamp=measurement.stamp + index * AHEAD))
    if estimator.ready:
        estimate = estimator.estimate(estimator.stamp + AHEAD)
        output = Output(scene, estimator.simulator)
        output.states(estimate)
        output.markers(estimate)
