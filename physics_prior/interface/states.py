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
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)

IDENTITY, NONE = np.eye(3), Vector3()


class Joints:
    """The joints of joint_states, of one degree of freedom each: the tree's own, behind them the hinges of its ball joints.

    These three for each ball joint stand for it in the URDF, so that robot_state_publisher knows all.
    """

    def __init__(self, links: Sequence[Link], balls: Sequence[Link] = ()) -> None:
        hinges = [name for link in balls for name in hinge_names(link.joint.name)]
        self.names = (*(link.joint.name for link in links), *hinges)
        self.positions = np.array([link.q.start for link in links], dtype=int)
        self.freedoms = np.array([link.v.start for link in links], dtype=int)
        self.quaternions = np.array([np.r_[link.q] for link in balls], dtype=int).reshape(-1, 4)
        self.turns = np.array([np.r_[link.v] for link in balls], dtype=int).reshape(-1, 3)


def joint_states(header: Header, joints: Joints, estimate: Estimate) -> JointState:
    """Position, velocity and effort (generalized force of the effects) of the joints."""
    at, rate = joints.positions, joints.freedoms
    columns = [[estimate.q[at]], [estimate.v[rate]], [estimate.effort[rate]]]
    if len(joints.turns):
        angles = hinge_angles(estimate.q[joints.quaternions])
        rates = (rates_per_omega(angles) @ estimate.v[joints.turns][..., None])[..., 0]
        torques = (estimate.effort[joints.turns][:, None] @ omega_per_rates(angles))[:, 0]
        for column, own in zip(columns, (angles, rates, torques), strict=True):
            column.append(own.reshape(-1))
    return JointState(header, joints.names, *(np.concatenate(column) for column in columns))


def joint_deviations(header: Header, joints: Joints, estimate: Estimate) -> JointState:
    """Standard deviations of position and velocity, in the fields of these; a JointState has no place of its own for them."""
    nv, turns = len(estimate.v), joints.turns
    variances = np.diag(estimate.covariance)
    columns = [np.sqrt(variances[joints.freedoms]), np.sqrt(variances[nv + joints.freedoms])]
    if len(turns):
        angles = hinge_angles(estimate.q[joints.quaternions])
        rates = (rates_per_omega(angles) @ estimate.v[turns][..., None])[..., 0]
        J = state_derivative(angles, rates)
        own = np.concatenate([turns, nv + turns], axis=1)
        of_hinges = np.sum(J @ estimate.covariance[own[:, :, None], own[:, None, :]] * J, axis=-1)
        spread = np.sqrt(np.maximum(of_hinges, 0.0))
        columns = [np.append(columns[0], spread[:, :3]), np.append(columns[1], spread[:, 3:])]
    return JointState(header, joints.names, *columns)


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
    q, v = estimate.q.tolist(), estimate.v.tolist()
    transforms, twists, wrenches = [], [], []
    for link in links:
        w, x, y, z = q[link.q][-4:]
        _, R = simulator.pose(link.part)
        translation, linear = (
            (Vector3(*q[link.q][:3]), Vector3(*v[link.v][:3])) if link.joint.kind is JointKind.FREE else (NONE, NONE)
        )
        wrench = estimate.wrenches[link.joint.name]
        transforms.append(Transform(translation, Quaternion(x, y, z, w)))
        twists.append(Twist(linear, vector_of(R @ estimate.v[link.v][-3:])))
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
    own = np.arange(link.v.start, link.v.stop)
    own = np.concatenate([own, len(estimate.v) + own])
    # pose and twist of the message by the errors of position, turn, velocity and angular velocity
    J = np.zeros((12, 12))
    J[:3, :3] = J[9:, 9:] = IDENTITY
    J[3:6, 3:6], J[6:9, 3:6], J[6:9, 6:9] = R, rotations.skew(seen), R.T
    covariance = J @ estimate.covariance[own[:, None], own] @ J.T
    return Odometry(
        header,
        link.part,
        PoseWithCovariance(pose_of(position, wxyz), _flat(covariance[:6, :6])),
        TwistWithCovariance(Twist(vector_of(seen), vector_of(omega)), _flat(covariance[6:, 6:])),
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
