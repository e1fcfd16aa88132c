"""Where the links are and how they move: poses, velocities, Jacobians and their rates."""

from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.errors import SimulationError
from physics_prior.model import JointKind, Link, Tree


@dataclass(frozen=True)
class Kinematics:
    """Motion of all link frames in world axes; the last row is the world, so that the index -1 finds it.

    Attributes:
        position: (n + 1, 3) m, origin of each link's frame (the joint that carries it).
        orientation: (n + 1, 4) quaternion, link to world.
        velocity: (n + 1, 3) m/s, of the origin.
        angular_velocity: (n + 1, 3) rad/s.
        linear_jacobian, angular_jacobian: (n + 1, 3, nv), from v to the two velocities.
        linear_jacobian_rate, angular_jacobian_rate: (n + 1, 3, nv), their time derivatives.
    """

    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    linear_jacobian: np.ndarray
    angular_jacobian: np.ndarray
    linear_jacobian_rate: np.ndarray
    angular_jacobian_rate: np.ndarray


def kinematics(tree: Tree, q: np.ndarray, v: np.ndarray) -> Kinematics:
    """Walk from the roots outwards at q (nq,), its quaternions of unit length, and v (nv,).

    Raises:
        SimulationError: q or v is not finite.
    """
    if not (np.all(np.isfinite(q)) and np.all(np.isfinite(v))):
        raise SimulationError(f"the state q {q.tolist()}, v {v.tolist()} is not finite: it has no motion")
    n = len(tree.links)
    position, orientation = np.zeros((n + 1, 3)), np.zeros((n + 1, 4))
    orientation[-1, 0] = 1.0
    velocity, angular_velocity = np.zeros((n + 1, 3)), np.zeros((n + 1, 3))
    linear, angular, linear_rate, angular_rate = np.zeros((4, n + 1, 3, tree.nv))
    for i, link in enumerate(tree.links):
        p, kind = link.parent, link.joint.kind
        shift, turn = joint_pose(link, q[link.q])
        lever = rotations.rotate(orientation[p], shift)
        position[i] = position[p] + lever
        orientation[i] = rotations.multiply(orientation[p], turn)
        R = rotations.matrix_from_quaternion(orientation[i])

        # what the parent carries along
        angular[i] = angular[p]
        linear[i] = linear[p] - rotations.skew(lever) @ angular[p]
        # what the joint adds: its axes are fixed in the child, so they turn with the child's angular velocity
        if kind is JointKind.REVOLUTE:
            angular[i, :, link.v] += (R @ link.joint.axis)[:, None]
        elif kind is JointKind.PRISMATIC:
            linear[i, :, link.v] += (R @ link.joint.axis)[:, None]
        elif kind is JointKind.SPHERICAL:
            angular[i, :, link.v] += R
        else:
            linear[i, :, link.v] += np.eye(3, 6)  # already in world axes
            angular[i, :, link.v] += np.hstack([np.zeros((3, 3)), R])
        velocity[i] = linear[i] @ v
        angular_velocity[i] = angular[i] @ v

        lever_rate = velocity[i] - velocity[p]
        spin = rotations.skew(angular_velocity[i])
        angular_rate[i] = angular_rate[p]
        linear_rate[i] = (
            linear_rate[p] - rotations.skew(lever_rate) @ angular[p] - rotations.skew(lever) @ angular_rate[p]
        )
        angular_rate[i, :, link.v] += spin @ angular[i, :, link.v]
        if kind is JointKind.PRISMATIC:
            linear_rate[i, :, link.v] += spin @ linear[i, :, link.v]
    return Kinematics(position, orientation, velocity, angular_velocity, linear, angular, linear_rate, angular_rate)


def joint_pose(link: Link, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place a link in its parent link's frame: position (3,) and quaternion (4,) at the joint's own q."""
    joint = link.joint
    if joint.kind is JointKind.FREE:
        return q[:3], q[3:]
    if joint.kind is JointKind.PRISMATIC:
        return joint.position + rotations.rotate(joint.orientation, q[0] * joint.axis), joint.orientation
    turn = rotations.exp(q[0] * joint.axis) if joint.kind is JointKind.REVOLUTE else q
    return joint.position, rotations.multiply(joint.orientation, turn)
