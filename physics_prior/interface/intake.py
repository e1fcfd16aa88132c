"""Messages in: one message of a measurement topic, translated into a measurement or refused in one sentence."""

import numpy as np

from physics_prior import rotations
from physics_prior.errors import MeasurementError, PhysicsPriorError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import (
    ForceMeasurement,
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.interface.geometry import NANOSECONDS, array_of, wxyz_of
from physics_prior.recording.cdr import decode
from physics_prior.recording.messages import (
    Header,
    JointState,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    WrenchStamped,
)
from physics_prior.recording.wire import Message
from physics_prior.scene import (
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    Scene,
    SwitchSource,
)

ALL, ROTATION = slice(0, 6), slice(3, 6)  # rows and columns of a 6x6 covariance
SHOWN_NAMES = 8  # of a message's joints, in a sentence


def take_in(estimator: Estimator, source: MeasurementSource, type_name: str, data: bytes) -> bool:
    """Give an estimator a message as it came, CDR bytes of a ROS type; return whether the newest estimate changed.

    A message that cannot be a measurement is counted as rejected, with the reason: ``estimator.last_rejection``.
    """
    try:
        measurement = measurement_of(source, decode(type_name, data), estimator.scene)
    except PhysicsPriorError as error:
        estimator.reject(str(error))
        return False
    return estimator.add(measurement)


def measurement_of(source: MeasurementSource, message: Message, scene: Scene) -> Measurement:
    """Return what a message says, as it says it: the source knows what its lengths and names mean.

    Args:
        source: the scene's measurement whose topic brought the message.
        message: decoded, of one of ``source.message_types``.
        scene: poses and points must be given in its ``frame_id``; an empty one in the message is taken for it.

    Raises:
        MeasurementError: another type or frame, a stamp that is none, numbers that are not finite, a zero quaternion, arrays
            whose lengths do not match, no joint of the source, a covariance that is not symmetric and positive definite.
            The sentence begins with the topic.
    """
    try:
        return _translate(source, message, scene.frame_id)
    except MeasurementError as error:
        raise MeasurementError(f"topic '{source.topic}': {error}") from None


def _translate(source: MeasurementSource, message: Message, frame_id: str) -> Measurement:
    topic = source.topic
    if isinstance(source, PoseSource | OrientationSource) and isinstance(
        message, PoseStamped | PoseWithCovarianceStamped
    ):
        stamp = _stamp_in(message.header, frame_id)
        pose = message.pose if isinstance(message, PoseStamped) else message.pose.pose
        wxyz = wxyz_of(pose.orientation)
        if isinstance(source, OrientationSource):
            return OrientationMeasurement(stamp, topic, wxyz, _covariance(message, ROTATION))
        return PoseMeasurement(stamp, topic, array_of(pose.position), wxyz, _covariance(message, ALL))
    if isinstance(source, PointsSource) and isinstance(message, PoseArray):
        count, expected = len(message.poses), len(source.markers)
        if count != expected:
            raise MeasurementError(f"{count} poses came, but the scene names {expected} markers, one a pose")
        points = np.array([array_of(pose.position) for pose in message.poses])
        return PointsMeasurement(_stamp_in(message.header, frame_id), topic, points)
    if isinstance(source, JointSource) and isinstance(message, JointState):
        names, positions = _known_joints(source, message)
        # a joint's coordinate is the same in every frame
        return JointsMeasurement(_stamp(message.header), topic, names, positions)
    if isinstance(source, SwitchSource) and isinstance(message, WrenchStamped):
        # its size is the same in every frame
        return ForceMeasurement(_stamp(message.header), topic, array_of(message.wrench.force))
    raise MeasurementError(f"a {message.ros_type} came; valid is {' or '.join(source.message_types)}")


def _stamp(header: Header) -> int:
    seconds, nanoseconds = header.stamp.sec, header.stamp.nanosec
    if seconds < 0 or nanoseconds >= NANOSECONDS:
        raise MeasurementError(
            f"stamp {seconds} s {nanoseconds} ns is not valid: seconds must not be negative, nanoseconds less than 1e9"
        )
    return seconds * NANOSECONDS + nanoseconds


def _stamp_in(header: Header, frame_id: str) -> int:
    """Return the stamp of a message in the scene's frame; MeasurementError names both frames if they differ."""
    if header.frame_id not in ("", frame_id):
        raise MeasurementError(
            f"frame_id '{header.frame_id}' is not the scene's, '{frame_id}': transform the poses first"
        )
    return _stamp(header)


def _covariance(message: PoseStamped | PoseWithCovarianceStamped, rows: slice) -> np.ndarray | None:
    """Return some rows and columns of a covariance, its rotation about the measured axes; None where there is none.

    The message counts rotation about the fixed axes of its frame, R -> exp(d) R, a measurement about the measured frame's
    own, R -> R exp(d'): d' = R^T d. All zeros say that the covariance is unknown: the scene's noise holds.
    """
    if isinstance(message, PoseStamped):
        return None
    covariance = np.reshape(message.pose.covariance, (6, 6))[rows, rows]
    if not covariance.any():
        return None
    quaternion = OrientationMeasurement(0, "", wxyz_of(message.pose.pose.orientation)).orientation
    T = np.eye(6)
    T[ROTATION, ROTATION] = rotations.matrix_from_quaternion(quaternion).T
    T = T[rows, rows]
    with np.errstate(invalid="ignore", over="ignore"):  # the measurement refuses what is not finite
        return np.asarray(T @ covariance @ T.T)


def _known_joints(source: JointSource, message: JointState) -> tuple[tuple[str, ...], np.ndarray]:
    """Return names and positions (n,) of those joints of a message that the source reads."""
    if len(message.position) != len(message.name):
        raise MeasurementError(
            f"{len(message.position)} positions came for {len(message.name)} names: give each its own"
        )
    known = [index for index, name in enumerate(message.name) if name in source.joints]
    names = tuple(message.name[index] for index in known)
    if len(set(names)) < len(names):
        raise MeasurementError(f"names {list(names)} came: give each joint once")
    if not names:
        came = list(message.name[:SHOWN_NAMES])
        raise MeasurementError(f"names {came} came, and none is read; the scene reads {list(source.joints)}")
    return names, np.array([message.position[index] for index in known], dtype=float)
