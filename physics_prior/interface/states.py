"""States out: joints, the odometry of a free body, and the covariance of everything."""

from collections.abc import Sequence

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.center_of_mass import center_of_mass as position_of_center
from physics_prior.dynamics.center_of_mass import center_of_mass_jacobian
from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimate import Estimate
from physics_prior.interface.geometry import pose_of, quaternion_of, vector_of, wrench_of
from physics_prior.model import JointKind, Link
from physics_prior.model.ball_hinges import (
    hinge_angles,
    hinge_names,
    omega_per_rates,
    rates_per_omega,
    state_derivative,
)
from physics_prior.recording.messages import (
    Float64MultiArray,
    Header,
    JointState,
    MultiArrayDimension,
    MultiArrayLayout,
    MultiDOFJointState,
    Odometry,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)


def joint_states(header: Header, links: Sequence[Link], estimate: Estimate, balls: Sequence[Link] = ()) -> JointState:
    """Position, velocity and effort (generalized force of the effects) of revolute and prismatic joints.

    Behind them those of the three hinges that stand for each ball joint in the URDF, so that robot_state_publisher knows all.
    """
    names = [link.joint.name for link in links]
    at, rate = [link.q.start for link in links], [link.v.start for link in links]
    columns = [[estimate.q[at]], [estimate.v[rate]], [estimate.effort[rate]]]
    for link in balls:
        names += hinge_names(link.joint.name)
        angles = hinge_angles(estimate.q[link.q])
        rates = rates_per_omega(angles) @ estimate.v[link.v]
        torques = omega_per_rates(angles).T @ estimate.effort[link.v]
        for column, own in zip(columns, (angles, rates, torques), strict=True):
            column.append(own)
    return JointState(header, tuple(names), *(np.concatenate(column) for column in columns))


def joint_deviations(
    header: Header, links: Sequence[Link], estimate: Estimate, balls: Sequence[Link] = ()
) -> JointState:
    """Standard deviations of position and velocity, in the fields of these; a JointState has no place of its own for them."""
    at = [link.v.start for link in links]
    names = [link.joint.name for link in links]
    positions, velocities = [estimate.position_deviation[at]], [estimate.velocity_deviation[at]]
    nv = len(estimate.v)
    for link in balls:
        names += hinge_names(link.joint.name)
        angles = hinge_angles(estimate.q[link.q])
        J = state_derivative(angles, rates_per_omega(angles) @ estimate.v[link.v])
        own = np.r_[link.v.start : link.v.stop, nv + link.v.start : nv + link.v.stop]
        spread = np.sqrt(np.maximum(np.diag(J @ estimate.covariance[np.ix_(own, own)] @ J.T), 0.0))
        positions.append(spread[:3])
        velocities.append(spread[3:])
    return JointState(header, tuple(names), np.concatenate(positions), np.concatenate(velocities))


def transforms(header: Header, links: Sequence[Link], estimate: Estimate) -> TFMessage:
    """Where free links are in the header's frame: what a URDF, whose root they are, does not say."""
    return TFMessage(
        [
            TransformStamped(
                header, link.part, Transform(vector_of(estimate.q[link.q][:3]), quaternion_of(estimate.q[link.q][3:]))
            )
            for link in links
        ]
    )


def center_of_mass(header: Header, estimate: Estimate, simulator: Simulator) -> PoseWithCovarianceStamped:
    """The centre of mass of all that moves, with its covariance, along the header's axes; needs ``simulator.move``."""
    nv = len(estimate.v)
    J = center_of_mass_jacobian(simulator)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = J @ estimate.covariance[:nv, :nv] @ J.T
    pose = pose_of(position_of_center(simulator), np.array([1.0, 0.0, 0.0, 0.0]))
    return PoseWithCovarianceStamped(header, PoseWithCovariance(pose, _flat(covariance)))


def multi_dof_joint_states(
    header: Header, links: Sequence[Link], estimate: Estimate, simulator: Simulator
) -> MultiDOFJointState:
    """Free and spherical joints; needs ``simulator.move``.

    The transform is the joint's own, its zero to its child. Twist, of the child relative to the parent, and wrench, that of the
    joint ON the child, are vectors in the frame of the header, the twist's linear part at the child's origin.
    """
    transforms, twists, wrenches = [], [], []
    for link in links:
        q, v = estimate.q[link.q], estimate.v[link.v]
        _, R = simulator.pose(link.part)
        translation, linear = (
            (vector_of(q[:3]), vector_of(v[:3])) if link.joint.kind is JointKind.FREE else (Vector3(), Vector3())
        )
        wrench = estimate.wrenches[link.joint.name]
        transforms.append(Transform(translation, quaternion_of(q[-4:])))
        twists.append(Twist(linear, vector_of(R @ v[-3:])))
        wrenches.append(wrench_of(wrench.force, wrench.moment))
    names = tuple(link.joint.name for link in links)
    return MultiDOFJointState(header, names, transforms, twists, wrenches)


def odometry(header: Header, link: Link, estimate: Estimate) -> Odometry:
    """Pose of a free link in the header's frame and its twist in its own, with covariances.

    The error state has the position in world axes and the rotation about the body's own, R -> R exp(d). The message has the
    pose's rotation about the fixed axes of its frame, R d, and the twist in the body's: u = R^T v changes by
    R^T dv + u x d.
    """
    position, wxyz = estimate.q[link.q][:3], estimate.q[link.q][3:]
    velocity, omega = estimate.v[link.v][:3], estimate.v[link.v][3:]
    R = rotations.matrix_from_quaternion(wxyz)
    seen = R.T @ velocity
    nv = len(estimate.v)
    own = np.r_[link.v.start : link.v.stop, nv + link.v.start : nv + link.v.stop]
    covariance = estimate.covariance[np.ix_(own, own)]
    to_pose = np.zeros((6, 12))
    to_pose[:3, :3], to_pose[3:, 3:6] = np.eye(3), R
    to_twist = np.zeros((6, 12))
    to_twist[:3, 3:6], to_twist[:3, 6:9], to_twist[3:, 9:] = rotations.skew(seen), R.T, np.eye(3)
    return Odometry(
        header,
        link.part,
        PoseWithCovariance(pose_of(position, wxyz), _flat(to_pose @ covariance @ to_pose.T)),
        TwistWithCovariance(Twist(vector_of(seen), vector_of(omega)), _flat(to_twist @ covariance @ to_twist.T)),
    )


def state_covariance(names: Sequence[str], estimate: Estimate) -> Float64MultiArray:
    """Covariance of the error of all positions, then all velocities; the labels of both dimensions name its rows."""
    label = ",".join([*names, *(f"{name}/velocity" for name in names)])
    size = len(estimate.covariance)
    dimensions = (MultiArrayDimension(label, size, size * size), MultiArrayDimension(label, size, size))
    return Float64MultiArray(MultiArrayLayout(dimensions), _flat(estimate.covariance))


def _flat(matrix: np.ndarray) -> np.ndarray:
    """Return a matrix row by row, symmetric to the last bit."""
    return np.ravel(0.5 * (matrix + matrix.T))
