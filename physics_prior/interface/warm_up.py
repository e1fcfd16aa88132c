"""Compile what a scene calls for before its first measurement comes: a made-up recording through the real path."""

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import (
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.interface.output import Output
from physics_prior.scene import JointSource, MeasurementSource, OrientationSource, PointsSource, PoseSource, Scene

STAMPS = (10_000_000, 20_000_000, 30_000_000)  # ns: a start, an update, and one that tells that the update is complete


def warm_up(scene: Scene) -> None:
    """Run an estimator of the scene on measurements of its initial configuration at rest; all kernels are compiled then.

    Takes 10 to 20 s where the kernels are not in the cache on disk, a tenth of a second where they are.
    """
    estimator = Estimator(scene)
    simulator, q = estimator.simulator, scene.initial.q.copy()
    simulator.project(q, np.zeros(simulator.nv))
    for stamp in STAMPS:
        for source in scene.measurements:
            simulator.move(q, np.zeros(simulator.nv))
            estimator.add(_seen(source, simulator, q, stamp))
    if estimator.ready:
        Output(scene, simulator).states(estimator.estimate(2 * STAMPS[-1]))


def _seen(source: MeasurementSource, simulator: Simulator, q: np.ndarray, stamp: int) -> Measurement:
    """Return what a source sees of a configuration without noise; needs ``simulator.move``."""
    if isinstance(source, PoseSource | OrientationSource):
        origin, R = simulator.pose(source.part)
        wxyz = rotations.multiply(rotations.quaternion_from_matrix(R), source.frame.orientation)
        if isinstance(source, OrientationSource):
            return OrientationMeasurement(stamp, source.topic, wxyz)
        position = (origin + R @ np.array(source.frame.position)) / source.scale
        return PoseMeasurement(stamp, source.topic, position, wxyz)
    if isinstance(source, PointsSource):
        places = [(simulator.pose(marker.part), np.array(marker.point)) for marker in source.markers]
        points = np.array([origin + R @ point for (origin, R), point in places])
        return PointsMeasurement(stamp, source.topic, points)
    assert isinstance(source, JointSource)
    positions = np.concatenate([q[simulator.tree.link(joint).q] for joint in source.joints.values()])
    return JointsMeasurement(stamp, source.topic, tuple(source.joints), positions)
