"""Observation models: what a state lets a source see, how that depends on the state, and how noisy it is."""

from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import MeasurementError
from physics_prior.estimation.measurement import (
    ForceMeasurement,
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.model import JointKind
from physics_prior.scene import (
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    SwitchSource,
)


@dataclass(frozen=True, eq=False)
class Innovation:
    """A measurement against a state: y ~ H dx + noise, dx the tangent of q.

    Attributes:
        y: (m,) measured less expected.
        H: (m, nv) derivative of what is expected by the tangent of q.
        noise: (m, m) lower factor of the measurement's covariance.
    """

    y: np.ndarray
    H: np.ndarray
    noise: np.ndarray


FITS = {
    PoseSource: PoseMeasurement,
    OrientationSource: OrientationMeasurement,
    PointsSource: PointsMeasurement,
    JointSource: JointsMeasurement,
    SwitchSource: ForceMeasurement,
}
"""Which measurement each kind of source brings."""


def check(source: MeasurementSource, measurement: Measurement) -> None:
    """Raise MeasurementError if a measurement is not of the source's kind or names what the source does not know."""
    if not isinstance(measurement, FITS[type(source)]):
        raise MeasurementError(
            f"topic '{source.topic}' is a {type(source).__name__}: a {type(measurement).__name__} does not fit it"
        )
    if isinstance(source, PointsSource) and isinstance(measurement, PointsMeasurement):
        count, expected = len(measurement.points), len(source.markers)
        if count != expected:
            raise MeasurementError(f"topic '{source.topic}' brought {count} points: the scene names {expected}")
    if isinstance(source, JointSource) and isinstance(measurement, JointsMeasurement):
        for name in measurement.names:
            if name not in source.joints:
                raise MeasurementError(f"joint '{name}' is not one of the source's: {list(source.joints)}")


def innovation(source: MeasurementSource, measurement: Measurement, simulator: Simulator, q: np.ndarray) -> Innovation:
    """The innovation of a measurement at a configuration q (nq,); its kinematics must be up to date (``move``).

    Rotations are compared in the tangent space of the expected one, log(R_expected^T R_measured), in the measured frame's
    axes (Sola 2017, ch. 4). m may be 0, where no marker is seen. The measurement must fit its source (``check``).
    """
    if isinstance(source, PoseSource) and isinstance(measurement, PoseMeasurement):
        position, R, jacobian = _frame(simulator, source)
        turn = rotations.log(
            rotations.quaternion_from_matrix(R.T @ rotations.matrix_from_quaternion(measurement.orientation))
        )
        y = np.concatenate([source.scale * measurement.position - position, turn])
        H = np.concatenate([jacobian[3:], R.T @ jacobian[:3]])
        if measurement.covariance is not None:
            to_metres = np.repeat([source.scale, 1.0], 3)
            return Innovation(y, H, to_metres[:, None] * np.linalg.cholesky(measurement.covariance))
        return Innovation(y, H, np.diag([source.position_noise] * 3 + [source.orientation_noise] * 3))
    if isinstance(source, OrientationSource) and isinstance(measurement, OrientationMeasurement):
        _, R, jacobian = _frame(simulator, source)
        y = rotations.log(
            rotations.quaternion_from_matrix(R.T @ rotations.matrix_from_quaternion(measurement.orientation))
        )
        if measurement.covariance is not None:
            return Innovation(y, R.T @ jacobian[:3], np.linalg.cholesky(measurement.covariance))
        return Innovation(y, R.T @ jacobian[:3], source.orientation_noise * np.eye(3))
    if isinstance(source, PointsSource) and isinstance(measurement, PointsMeasurement):
        seen = np.flatnonzero(~np.isnan(measurement.points).any(axis=1))
        y, H = np.zeros(3 * len(seen)), np.zeros((3 * len(seen), simulator.nv))
        for row, index in enumerate(seen):
            marker = source.markers[index]
            position, R = simulator.pose(marker.part)
            point = np.array(marker.point)
            y[3 * row : 3 * row + 3] = measurement.points[index] - position - R @ point
            H[3 * row : 3 * row + 3] = simulator.jacobian(marker.part, point)[3:]
        return Innovation(y, H, source.noise * np.eye(len(y)))
    assert isinstance(source, JointSource)
    assert isinstance(measurement, JointsMeasurement)
    y, H = np.zeros(len(measurement.names)), np.zeros((len(measurement.names), simulator.nv))
    for row, name in enumerate(measurement.names):
        link = simulator.tree.link(source.joints[name])
        y[row] = measurement.positions[row] - q[link.q][0]
        if link.joint.kind is JointKind.REVOLUTE:  # an encoder may wrap where it likes
            y[row] = (y[row] + np.pi) % (2.0 * np.pi) - np.pi
        H[row, link.v] = 1.0
    return Innovation(y, H, source.noise * np.eye(len(y)))


def _frame(simulator: Simulator, source: PoseSource | OrientationSource) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, rotation and Jacobian (6, nv) of the measured frame."""
    offset = np.array(source.frame.position)
    position, R = simulator.pose(source.part)
    jacobian = simulator.jacobian(source.part, offset)
    return position + R @ offset, R @ rotations.matrix_from_quaternion(np.array(source.frame.orientation)), jacobian
