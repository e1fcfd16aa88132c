"""States out: units, signs, frames, and covariances against derivatives of what the messages say."""

import math

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.estimation.estimate import Estimate
from physics_prior.interface import Output
from physics_prior.interface.geometry import array_of, wxyz_of
from physics_prior.recording.cdr import decode, encode
from physics_prior.scene import load_scene


@pytest.fixture
def published(every_joint, every_joint_simulator, estimate_of):
    estimate = estimate_of(every_joint_simulator)
    return dict(Output(every_joint, every_joint_simulator).states(estimate)), estimate


def place(simulator, joint):
    link = simulator.tree.link(joint)
    return link.q, link.v


def test_every_message_has_stamp_and_frame_and_survives_the_codec(published):
    messages, estimate = published
    for message in messages.values():
        assert decode(message.ros_type, encode(message)) == message
        if hasattr(message, "header"):
            assert message.header.frame_id == "lab"
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == estimate.stamp


def test_joint_states_and_their_deviations(published, every_joint_simulator):
    messages, estimate = published
    states, deviations = messages["joint_states"], messages["joint_states/stddev"]
    assert tuple(states.name) == tuple(deviations.name) == ("elbow-1", "elbow.1")
    nv = every_joint_simulator.nv
    for index, name in enumerate(states.name):
        q, v = place(every_joint_simulator, name)
        assert states.position[index] == estimate.q[q][0]
        assert states.velocity[index] == estimate.v[v][0]
        assert states.effort[index] == estimate.effort[v][0]
        assert deviations.position[index] ** 2 == pytest.approx(estimate.covariance[v, v].item(), rel=1e-14)
        row = nv + v.start
        assert deviations.velocity[index] ** 2 == pytest.approx(estimate.covariance[row, row], rel=1e-14)
    assert len(deviations.effort) == 0
    assert deviations.header == states.header


def test_multi_dof_joints_tell_transform_twist_and_wrench(published, every_joint_simulator):
    messages, estimate = published
    message, simulator = messages["multi_dof_joint_states"], every_joint_simulator
    assert tuple(message.joint_names) == ("root", "shoulder")
    simulator.move(estimate.q, estimate.v)
    origin, R = simulator.pose("base")
    np.testing.assert_array_equal(array_of(message.transforms[0].translation), origin)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(wxyz_of(message.transforms[0].rotation)), R, atol=1e-15)
    # the shoulder's own turn, between its placement on the base and the arm
    placed = R @ rotations.matrix_from_quaternion(simulator.tree.joint("shoulder").orientation)
    turn = rotations.matrix_from_quaternion(wxyz_of(message.transforms[1].rotation))
    np.testing.assert_allclose(placed @ turn, simulator.pose("arm")[1], atol=1e-15)
    assert array_of(message.transforms[1].translation).tolist() == [0, 0, 0]
    # twists in the header's frame: the base's in the world, the arm's relative to the base
    velocity, omega = simulator.velocity("base")
    np.testing.assert_allclose(array_of(message.twist[0].linear), velocity, atol=1e-15)
    np.testing.assert_allclose(array_of(message.twist[0].angular), omega, atol=1e-15)
    relative = simulator.velocity("arm")[1] - omega
    np.testing.assert_allclose(array_of(message.twist[1].angular), relative, atol=1e-15)
    assert array_of(message.twist[1].linear).tolist() == [0, 0, 0]
    for index, name in enumerate(message.joint_names):
        assert array_of(message.wrench[index].force).tolist() == estimate.wrenches[name].force.tolist()
        assert array_of(message.wrench[index].torque).tolist() == estimate.wrenches[name].moment.tolist()


def test_odometry_is_the_pose_in_the_frame_and_the_twist_in_the_body(published, every_joint_simulator):
    messages, estimate = published
    message = messages["odometry"]
    every_joint_simulator.move(estimate.q, estimate.v)
    origin, R = every_joint_simulator.pose("base")
    velocity, omega = every_joint_simulator.velocity("base")
    assert message.child_frame_id == "base"
    assert array_of(message.pose.pose.position).tolist() == origin.tolist()
    np.testing.assert_allclose(rotations.matrix_from_quaternion(wxyz_of(message.pose.pose.orientation)), R, atol=1e-15)
    np.testing.assert_allclose(array_of(message.twist.twist.linear), R.T @ velocity, atol=1e-15)
    np.testing.assert_allclose(array_of(message.twist.twist.angular), R.T @ omega, atol=1e-15)


@pytest.mark.parametrize("seed", range(4))
def test_odometry_covariance_against_derivatives(every_joint, every_joint_simulator, estimate_of, seed):
    # what the message says at states displaced along each error: the pose's rotation about fixed axes, log(q' o q^-1)
    estimate, output = estimate_of(every_joint_simulator, seed), Output(every_joint, every_joint_simulator)
    nv, h = every_joint_simulator.nv, 1e-5

    def said(error):
        q = every_joint_simulator.tree.integrate(estimate.q, error[:nv])
        moved = estimate_of(every_joint_simulator, q=q, v=estimate.v + error[nv:])
        return dict(output.states(moved))["odometry"]

    here = said(np.zeros(2 * nv))
    start = rotations.conjugate(wxyz_of(here.pose.pose.orientation))
    J = np.zeros((12, 2 * nv))
    for column in range(2 * nv):
        for sign in (1, -1):
            message = said(sign * h * np.eye(2 * nv)[column])
            pose, twist = message.pose.pose, message.twist.twist
            J[:, column] += (sign / (2 * h)) * np.concatenate(
                [
                    array_of(pose.position),
                    rotations.log(rotations.multiply(wxyz_of(pose.orientation), start)),
                    array_of(twist.linear),
                    array_of(twist.angular),
                ]
            )
    expected = J @ estimate.covariance @ J.T
    message = dict(output.states(estimate))["odometry"]
    pose, twist = (np.reshape(each.covariance, (6, 6)) for each in (message.pose, message.twist))
    np.testing.assert_allclose(pose, expected[:6, :6], atol=1e-9)  # 7e-12
    np.testing.assert_allclose(twist, expected[6:, 6:], atol=1e-9)  # 5e-11
    for matrix in (pose, twist):
        assert (matrix == matrix.T).all()
        assert np.linalg.eigvalsh(matrix)[0] > 0.0


def test_state_covariance_names_its_rows(published, every_joint_simulator):
    messages, estimate = published
    message, nv = messages["state_covariance"], every_joint_simulator.nv
    rows, columns = message.layout.dim
    assert (rows.size, rows.stride, columns.size, columns.stride) == (2 * nv, 4 * nv * nv, 2 * nv, 2 * nv)
    names = rows.label.split(",")
    assert columns.label == rows.label
    assert len(names) == 2 * nv
    assert names[:nv] == every_joint_simulator.tree.freedom_names
    assert names[nv] == "root/linear_x/velocity"
    np.testing.assert_allclose(np.reshape(message.data, (2 * nv, 2 * nv)), estimate.covariance, atol=1e-16)


def test_forces_and_their_deviations(published):
    messages, estimate = published
    for name, topic in (("elbow-1", "elbow_1"), ("elbow.1", "elbow_1_2"), ("shoulder", "shoulder"), ("strap", "strap")):
        wrench, deviation = (
            messages[f"constraint_forces/{topic}"].wrench,
            messages[f"constraint_forces/{topic}/stddev"].wrench,
        )
        assert array_of(wrench.force).tolist() == estimate.wrenches[name].force.tolist()
        assert array_of(wrench.torque).tolist() == estimate.wrenches[name].moment.tolist()
        said = [*array_of(deviation.force), *array_of(deviation.torque)]
        assert said == estimate.wrench_deviations[name].tolist()
    assert "constraint_forces/root" not in messages  # nothing holds a free body


def test_the_force_on_a_hanging_body_points_up(estimate_of):
    # the force ON the part BY its pivot carries its weight
    scene = load_scene("uw_double_pendulum")
    simulator = Simulator(scene.tree, scene.effects)
    q = np.array([math.pi, 0.0])  # both hang
    simulator.move(q, np.zeros(2))
    assert simulator.pose("link2")[0][2] < 0.0
    estimate = estimate_of(simulator, q=q, v=np.zeros(2), wrenches=simulator.wrenches(q, np.zeros(2)))
    first = scene.tree.joints[0].name
    force = dict(Output(scene, simulator).states(estimate))[f"constraint_forces/{first}"].wrench.force
    assert force.z == pytest.approx(-scene.effects[0].field()[2] * scene.tree.mass, rel=1e-12)
    assert abs(force.x) < 1e-12


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("where", ["q", "v", "covariance", "vdot", "effort", "wrenches", "wrench_deviations"])
def test_no_number_that_is_not_finite_leaves(every_joint, every_joint_simulator, estimate_of, where, bad):
    estimate: Estimate = estimate_of(every_joint_simulator)
    value = getattr(estimate, where)
    if where == "wrenches":
        value["strap"].force[1] = bad
    elif where == "wrench_deviations":
        value["strap"][5] = bad
    else:
        value.flat[-1] = bad
    output = Output(every_joint, every_joint_simulator)
    for make in (output.states, output.markers):
        with pytest.raises(SimulationError, match="1700000000250000000 ns is not finite"):
            make(estimate)
