"""What a recording holds to compare an estimate with: joints, and force plates."""

from collections.abc import Sequence

import numpy as np

from physics_prior.errors import RecordingError
from physics_prior.estimation.force_score import Plate
from physics_prior.estimation.score import Reference
from physics_prior.interface.geometry import NANOSECONDS, array_of
from physics_prior.interface.topics import force_topics
from physics_prior.recording.cdr import decode
from physics_prior.recording.messages import Header, JointState, WrenchStamped
from physics_prior.recording.reader import BagReader
from physics_prior.scene import Scene


def read_references(reader: BagReader, topics: Sequence[str], scene: Scene) -> tuple[Reference | None, list[Plate]]:
    """The JointState topic among these, at most one, and the force plates, WrenchStamped.

    Raises:
        RecordingError: a topic is missing, doubled, of another type or without messages, or holds what is none of these.
    """
    joints: Reference | None = None
    plates: list[Plate] = []
    for index, topic in enumerate(topics):
        if topic in topics[:index]:
            raise RecordingError(f"reference {topic} is given twice: name each topic once")
        kind = reader.require_topic(topic, JointState.ros_type, WrenchStamped.ros_type).type
        if kind == WrenchStamped.ros_type:
            plates.append(_plate(reader, topic, scene))
        elif joints is None:
            joints = _joints(reader, topic)
        else:
            raise RecordingError(f"reference {topic} is a second JointState topic: compare with one at a time")
    return joints, plates


def plates_of(reader: BagReader, scene: Scene) -> list[str]:
    """The topics of force plates: each WrenchStamped that is neither measured nor named as a force other than the ground's."""
    ground = {name for effect in scene.effects for name in effect.footings(scene.tree)}
    others = [f"/{topic}" for name, topic in force_topics(scene).items() if name not in ground]
    measured = [source.topic for source in scene.measurements]
    return [
        topic
        for topic, kind in reader.topics.items()
        if ground
        and kind.type == WrenchStamped.ros_type
        and topic not in measured
        and not topic.endswith((*others, "/stddev"))
    ]


def _joints(reader: BagReader, topic: str) -> Reference:
    """A JointState topic as a reference; velocities that are missing are NaN."""
    stamps, positions, velocities = [], [], []
    names: tuple[str, ...] = ()
    for record in reader.read([topic]):
        message = decode(record.message_type, record.data)
        assert isinstance(message, JointState)
        names = names or tuple(message.name)
        position, velocity = np.array(message.position), np.array(message.velocity)
        if tuple(message.name) != names or len(position) != len(names) or len(velocity) not in (0, len(names)):
            raise RecordingError(
                f"{reader.path}: reference {topic} does not hold one position (and velocity) for each of {list(names)}"
            )
        stamps.append(_stamp(message.header))
        positions.append(position)
        velocities.append(velocity if len(velocity) else np.full(len(names), np.nan))
    order = np.argsort(stamps, kind="stable")
    return Reference(np.array(stamps)[order], names, np.array(positions)[order], np.array(velocities)[order])


def _plate(reader: BagReader, topic: str, scene: Scene) -> Plate:
    """A WrenchStamped topic as a force plate. One that is named as a force of the scene is known to measure that."""
    stamps, wrenches = [], []
    for record in reader.read([topic]):
        message = decode(record.message_type, record.data)
        assert isinstance(message, WrenchStamped)
        frame = message.header.frame_id
        if frame not in ("", scene.frame_id):
            raise RecordingError(
                f"{reader.path}: reference {topic} is in frame '{frame}', not in the scene's, '{scene.frame_id}'"
            )
        stamps.append(_stamp(message.header))
        wrenches.append(np.concatenate([array_of(message.wrench.force), array_of(message.wrench.torque)]))
    if not stamps:
        raise RecordingError(f"{reader.path}: reference {topic} holds no messages")
    values = np.array(wrenches)
    values[~np.isfinite(values)] = np.nan
    order = np.argsort(stamps, kind="stable")
    force = next((name for name, own in force_topics(scene).items() if topic.endswith(f"/{own}")), None)
    return Plate(topic, np.array(stamps, dtype=np.int64)[order], values[order], force)


def _stamp(header: Header) -> int:
    return header.stamp.sec * NANOSECONDS + header.stamp.nanosec
