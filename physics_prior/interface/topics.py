"""Topics out: what a scene publishes, of which types, under which names. A scene has no topic for what it has not.

What a scene measures under a name that would also be published, as ``/markers`` of a person, is published as ESTIMATED and that
name: a topic has one type, and nobody listens to himself.
"""

import re
from collections.abc import Iterable

from physics_prior.model import JointKind, Link, Tree
from physics_prior.recording.messages import (
    DiagnosticArray,
    Float64,
    Float64MultiArray,
    JointState,
    MarkerArray,
    MultiDOFJointState,
    Odometry,
    PoseWithCovarianceStamped,
    TFMessage,
    WrenchStamped,
)
from physics_prior.recording.wire import Message
from physics_prior.scene import Scene
from physics_prior.scene.readouts import Subject

JOINT_STATES = "joint_states"
JOINT_DEVIATIONS = "joint_states/stddev"
MULTI_DOF_JOINT_STATES = "multi_dof_joint_states"
ODOMETRY = "odometry"
STATE_COVARIANCE = "state_covariance"
CENTER_OF_MASS = "center_of_mass"
ENERGY = "energy"
TRANSFORMS = "/tf"  # absolute, as every tool expects it
CONSTRAINT_FORCES = "constraint_forces"
MARKERS = "markers"
DIAGNOSTICS = "/diagnostics"  # absolute, as every tool expects it

ESTIMATED = "estimated_"
LONGEST_NAME = 80  # characters of a force's name in its topic; a whole topic may have 247


def topics_of(scene: Scene) -> dict[str, type[Message]]:
    """Return the topics that a scene publishes, each with its type, in the order of publishing."""
    names = published_names(scene)
    return {names[topic]: message_type for topic, message_type in _topics_of(scene).items()}


def published_names(scene: Scene) -> dict[str, str]:
    """Return topic -> the name under which a scene publishes it."""
    measured = {source.topic.lstrip("/") for source in scene.measurements}
    return {topic: f"{ESTIMATED}{topic}" if topic in measured else topic for topic in _topics_of(scene)}


def _topics_of(scene: Scene) -> dict[str, type[Message]]:
    """Return the topics by their own names."""
    topics: dict[str, type[Message]] = {}
    if scalar_links(scene.tree) or ball_links(scene.tree):
        topics[JOINT_STATES] = topics[JOINT_DEVIATIONS] = JointState
    if vector_links(scene.tree):
        topics[MULTI_DOF_JOINT_STATES] = MultiDOFJointState
    if free_links(scene.tree):
        topics[ODOMETRY] = Odometry
        topics[TRANSFORMS] = TFMessage
    topics[CENTER_OF_MASS] = PoseWithCovarianceStamped
    topics[ENERGY] = Float64
    topics[STATE_COVARIANCE] = Float64MultiArray
    for topic in force_topics(scene).values():
        topics[topic] = topics[deviation_topic(topic)] = WrenchStamped
    topics[MARKERS] = MarkerArray
    topics[DIAGNOSTICS] = DiagnosticArray
    return topics


def scalar_links(tree: Tree) -> list[Link]:
    """Return the links on revolute and prismatic joints."""
    return [link for link in tree.links if link.joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC)]


def vector_links(tree: Tree) -> list[Link]:
    """Return the links on free and spherical joints."""
    return [link for link in tree.links if link.joint.kind in (JointKind.FREE, JointKind.SPHERICAL)]


def ball_links(tree: Tree) -> list[Link]:
    """Return the links on spherical joints."""
    return [link for link in tree.links if link.joint.kind is JointKind.SPHERICAL]


def free_links(tree: Tree) -> list[Link]:
    """Return the links on free joints."""
    return [link for link in tree.links if link.joint.kind is JointKind.FREE]


def force_topics(scene: Scene) -> dict[str, str]:
    """Return constraint (a joint or an effect that holds something) -> topic of its force."""
    return _topics(Subject(scene.tree, scene.effects).forces())


def _topics(names: Iterable[str]) -> dict[str, str]:
    """A topic may have fewer characters than a name: the others become '_', and names that become the same are numbered."""
    topics: dict[str, str] = {}
    for name in names:
        valid = re.sub(r"[^A-Za-z0-9_]", "_", name)[:LONGEST_NAME]
        if not valid[:1].isalpha():
            valid = f"joint_{valid}"
        same, number = f"{CONSTRAINT_FORCES}/{valid}", 1
        topic = same
        while topic in topics.values():
            number += 1
            topic = f"{same}_{number}"
        topics[name] = topic
    return topics


def switch_services(scene: Scene) -> dict[str, str]:
    """Return effect that can be switched -> name of the node's service for that, as in its force's topic if it has one."""
    labels = [effect.label for effect in scene.effects if effect.switchable(scene.tree)]
    topics = _topics(dict.fromkeys([*force_topics(scene), *labels]))
    return {label: f"~/effects/{topics[label].rsplit('/', 1)[-1]}" for label in labels}


def deviation_topic(topic: str) -> str:
    """Return the topic of the standard deviations of a force's topic."""
    return f"{topic}/stddev"
