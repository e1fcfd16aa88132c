"""The truth of a simulated recording: the messages of an estimate that is certain, and the state back from them."""

from collections.abc import Iterator, Mapping

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import RecordingError
from physics_prior.estimation.estimate import Estimate, Health, Level
from physics_prior.interface.geometry import array_of, header_of, wrench_of, wxyz_of
from physics_prior.interface.states import Joints, joint_states, multi_dof_joint_states, odometry
from physics_prior.interface.topics import (
    JOINT_STATES,
    MULTI_DOF_JOINT_STATES,
    ODOMETRY,
    force_topics,
    free_links,
    scalar_links,
    vector_links,
)
from physics_prior.model import JointKind
from physics_prior.recording.messages import (
    DiagnosticArray,
    DiagnosticStatus,
    JointState,
    KeyValue,
    MultiDOFJointState,
    Odometry,
    WrenchStamped,
)
from physics_prior.recording.wire import Message
from physics_prior.scene import Scene

PREFIX = "/truth/"
EFFECTS = "effects"


class Truth:
    """Makes messages of true states, named as the estimates' own under /truth.

    Attributes:
        topics: topic -> message type.
    """

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        self._scene, self._simulator = scene, simulator
        self._joints, self._vectors = Joints(scalar_links(scene.tree)), vector_links(scene.tree)
        self._free = free_links(scene.tree)
        self._forces = {name: PREFIX + topic for name, topic in force_topics(scene).items()}
        self.topics: dict[str, type[Message]] = {}
        if self._joints.names:
            self.topics[PREFIX + JOINT_STATES] = JointState
        if self._vectors:
            self.topics[PREFIX + MULTI_DOF_JOINT_STATES] = MultiDOFJointState
        if self._free:
            self.topics[PREFIX + ODOMETRY] = Odometry
        self.topics |= dict.fromkeys(self._forces.values(), WrenchStamped)
        if simulator.switches.events:
            self.topics[PREFIX + EFFECTS] = DiagnosticArray

    def messages(self, stamp: int, q: np.ndarray, v: np.ndarray) -> Iterator[tuple[str, Message]]:
        """Each topic's message at a state. Forces are the scene's own: the unknown white force has no value to tell."""
        state = self._certain(stamp, q, v)
        header = header_of(stamp, self._scene.frame_id)
        if self._joints.names:
            yield PREFIX + JOINT_STATES, joint_states(header, self._joints, state)
        if self._vectors:
            self._simulator.move(q, v)
            yield (
                PREFIX + MULTI_DOF_JOINT_STATES,
                multi_dof_joint_states(header, self._vectors, state, self._simulator),
            )
        if self._free:
            yield PREFIX + ODOMETRY, odometry(header, self._free[0], state)
        for name, topic in self._forces.items():
            yield topic, WrenchStamped(header, wrench_of(state.wrenches[name].force, state.wrenches[name].moment))
        if PREFIX + EFFECTS in self.topics:
            labels = self._simulator.switches.labels
            values = [KeyValue(label, "on" if label in state.holding else "off") for label in labels]
            status = DiagnosticStatus(DiagnosticStatus.OK, f"physics_prior: {self._scene.name}", "OK", values=values)
            yield PREFIX + EFFECTS, DiagnosticArray(header, [status])

    def state(self, messages: Mapping[str, Message]) -> tuple[np.ndarray, np.ndarray]:
        """Configuration q (nq,) and velocity v (nv,) from the messages of one stamp by topic: enough for NEES.

        Raises:
            RecordingError: the messages name other joints than the scene.
        """
        tree = self._scene.tree
        q, v = tree.neutral(), np.zeros(tree.nv)
        joints = messages.get(PREFIX + JOINT_STATES, JointState())
        others = messages.get(PREFIX + MULTI_DOF_JOINT_STATES, MultiDOFJointState())
        assert isinstance(joints, JointState)
        assert isinstance(others, MultiDOFJointState)
        known = {link.joint.name for link in tree.links}
        if {*joints.name, *others.joint_names} != known:
            raise RecordingError(
                f"the truth names the joints {[*joints.name, *others.joint_names]}: the scene has {sorted(known)}"
            )
        for index, name in enumerate(joints.name):
            link = tree.link(name)
            q[link.q], v[link.v] = joints.position[index], joints.velocity[index]
        for index, name in enumerate(others.joint_names):
            link, transform = tree.link(name), others.transforms[index]
            q[link.q][-4:] = wxyz_of(transform.rotation)
            if link.joint.kind is JointKind.FREE:
                q[link.q][:3] = array_of(transform.translation)
        self._simulator.move(q, v)
        for index, name in enumerate(others.joint_names):
            link, twist = tree.link(name), others.twist[index]
            _, R = self._simulator.pose(link.part)
            v[link.v][-3:] = R.T @ array_of(twist.angular)
            if link.joint.kind is JointKind.FREE:
                v[link.v][:3] = array_of(twist.linear)
        return q, v

    def _certain(self, stamp: int, q: np.ndarray, v: np.ndarray) -> Estimate:
        simulator, nv = self._simulator, len(v)
        wrenches = simulator.wrenches(q, v)
        effort, vdot = simulator.effort, simulator.acceleration(q, v)
        error = simulator.constraint_error(q, v)
        return Estimate(
            stamp=stamp,
            q=q,
            v=v,
            covariance=np.zeros((2 * nv, 2 * nv)),
            vdot=vdot,
            effort=effort,
            wrenches=wrenches,
            wrench_deviations={name: np.zeros(6) for name in wrenches},
            constraint_error=float(np.max(np.abs(error), initial=0.0)),
            rank=simulator.rank,
            health=Health(Level.OK),
            rows=simulator.switches.rows,
            holding=simulator.switches.holding,
        )
