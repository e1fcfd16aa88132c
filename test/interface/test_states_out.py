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
    names = ("elbow-1", "elbow.1", "shoulder_y", "shoulder_x", "shoulder_z")
    assert tuple(states.name) == tuple(deviations.name) == names
    nv = every_joint_simulator.nv
    for index, name in enumerate(names[:2]):
        q, v = place(every_joint_simulator, name)
        assert states.position[index] == estimate.q[q][0]
        assert states.velocity[index] == estimate.v[v][0]
        assert states.effort[index] == estimate.effort[v][0]
        assert deviations.position[index] ** 2 == pytest.approx(estimate.covariance[v, v].item(), rel=1e-14)
        row = nv + v.start
        assert deviations.velocity[index] ** 2 == pytest.approx(estimate.covariance[row, row], rel=1e-14)
    assert len(deviations.effort) == 0
    assert deviations.header == states.header


@pytest.mark.parametrize("seed", range(3))
def test_hinges_of_a_ball_joint_are_its_own_motion_and_uncertainty(
    every_joint, every_joint_simulator, estimate_of, seed
):
    simulator, output = every_joint_simulator, Output(every_joint, every_joint_simulator)
    estimate = estimate_of(simulator, seed)
    q, v = place(simulator, "shoulder")
    nv, h, own = simulator.nv, 1e-6, np.r_[v, simulator.nv + np.r_[v]]

    def said(estimate):
        states = dict(output.states(estimate))["joint_states"]
        return np.concatenate([states.position[2:], states.velocity[2:]])

    def moved(error):
        tangent = np.zeros(2 * nv)
        tangent[own] = error
        there = simulator.displaced(estimate.q, tangent[:nv])
        return said(estimate_of(simulator, seed, q=there, v=estimate.v + tangent[nv:]))

    here, states = said(estimate), dict(output.states(estimate))["joint_states"]
    a, b, c = (rotations.exp(angle * axis) for angle, axis in zip(here[:3], np.eye(3)[[1, 0, 2]], strict=True))
    turn = rotations.multiply(rotations.multiply(a, b), c)
    np.testing.assert_allclose(
        rotations.matrix_from_quaternion(turn), rotations.matrix_from_quaternion(estimate.q[q]), atol=1e-14
    )
    J = np.stack([(moved(h * e) - moved(-h * e)) / (2 * h) for e in np.eye(6)], axis=1)
    np.testing.assert_allclose(J[:3, :3] @ estimate.v[v], here[3:], rtol=1e-6)  # rates are how the angles change
    assert states.effort[2:] @ here[3:] == pytest.approx(estimate.effort[v] @ estimate.v[v], rel=1e-12)  # as is power
    deviations = dict(output.states(estimate))["joint_states/stddev"]
    expected = np.sqrt(np.diag(J @ estimate.covariance[np.ix_(own, own)] @ J.T))
    np.testing.assert_allclose(np.concatenate([deviations.position[2:], deviations.velocity[2:]]), expected, rtol=1e-5)


def test_hinges_stay_finite_where_they_are_singular(every_joint, every_joint_simulator, estimate_of):
    estimate = estimate_of(every_joint_simulator)
    q, _ = place(every_joint_simulator, "shoulder")
    estimate.q[q] = rotations.exp(np.array([0.5 * np.pi, 0.0, 0.0]))
    messages = dict(Output(every_joint, every_joint_simulator).states(estimate))
    for message in (messages["joint_states"], messages["joint_states/stddev"]):
        assert np.isfinite(message.position).all()
        assert np.isfinite(message.velocity).all()


def test_transforms_tell_where_the_root_of_the_urdf_is(published):
    messages, _ = published
    (transform,), pose = messages["/tf"].transforms, messages["odometry"].pose.pose
    assert (transform.header.frame_id, transform.child_frame_id) == ("lab", "base")
    assert array_of(transform.transform.translation).tolist() == array_of(pose.position).tolist()
    assert transform.transform.rotation == pose.orientation


def test_centre_of_mass_and_energy_are_those_of_all_parts(every_joint, every_joint_simulator, estimate_of):
    simulator, output = every_joint_simulator, Output(every_joint, every_joint_simulator)
    estimate, h, nv = estimate_of(simulator), 1e-6, every_joint_simulator.nv

    def center(q):
        return array_of(dict(output.states(estimate_of(simulator, q=q)))["center_of_mass"].pose.pose.position)

    message = dict(output.states(estimate))["center_of_mass"]
    total, moment = 0.0, np.zeros(3)
    for part in simulator.tree.parts:
        origin, R = simulator.pose(part.name)
        total += part.mass_properties.mass
        moment += part.mass_properties.mass * (origin + R @ part.mass_properties.center_of_mass)
    np.testing.assert_allclose(array_of(message.pose.pose.position), moment / total, atol=1e-14)
    columns = [
        (center(simulator.displaced(estimate.q, h * e)) - center(simulator.displaced(estimate.q, -h * e))) / (2 * h)
        for e in np.eye(nv)
    ]
    J = np.stack(columns, axis=1)
    covariance = np.reshape(message.pose.covariance, (6, 6))
    np.testing.assert_allclose(covariance[:3, :3], J @ estimate.covariance[:nv, :nv] @ J.T, rtol=1e-6, atol=1e-9)
    assert not covariance[3:].any()
    simulator.move(estimate.q, estimate.v)
    assert dict(output.states(estimate))["energy"].data == simulator.energy()


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
