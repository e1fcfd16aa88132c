"""Messages in: units, frames, conventions of covariance, and what is refused with which words."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from physics_prior import rotations
from physics_prior.errors import MeasurementError
from physics_prior.estimation.estimator import Estimator
from physics_prior.interface import measurement_of, take_in
from physics_prior.recording.cdr import encode
from physics_prior.recording.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    String,
    Time,
)

HEADER = Header(Time(12, 345), "lab")
STAMP = 12_000_000_345
POSE = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.5, -0.5, 0.5, -0.5))
SEVERAL = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture
def source(every_joint):
    by_topic = {source.topic: source for source in every_joint.measurements}
    return by_topic.__getitem__


def with_covariance(covariance, pose=POSE):
    return PoseWithCovarianceStamped(HEADER, PoseWithCovariance(pose, np.ravel(covariance)))


def random_covariance(seed):
    root = np.random.default_rng(seed).normal(size=(6, 6))
    return 1e-4 * root @ root.T


def test_pose_keeps_its_numbers_and_turns_the_scalar_to_the_front(source, every_joint):
    measured = measurement_of(source("/arm/pose"), PoseStamped(HEADER, POSE), every_joint)
    assert (measured.stamp, measured.topic) == (STAMP, "/arm/pose")
    assert measured.position.tolist() == [1.0, 2.0, 3.0]  # the observation model knows of the scale
    assert measured.orientation.tolist() == [-0.5, 0.5, -0.5, 0.5]
    assert measured.covariance is None


def test_orientation_does_not_look_at_the_position(source, every_joint):
    pose = Pose(Point(np.nan, np.inf, 0.0), POSE.orientation)
    measured = measurement_of(source("/base/imu"), PoseStamped(HEADER, pose), every_joint)
    assert measured.orientation.tolist() == [-0.5, 0.5, -0.5, 0.5]


def test_points_keep_order_and_those_not_seen(source, every_joint):
    unseen = Pose(Point(np.nan, np.nan, np.nan))
    measured = measurement_of(source("/markers"), PoseArray(HEADER, [POSE, unseen]), every_joint)
    np.testing.assert_array_equal(measured.points, [[1, 2, 3], [np.nan] * 3])


def test_joints_are_taken_by_name_and_others_left(source, every_joint):
    message = JointState(Header(Time(12, 345), "nowhere"), ["x", "e2", "e1"], [9.0, 0.2, 0.1])
    measured = measurement_of(source("/encoders"), message, every_joint)
    assert measured.stamp == STAMP
    assert measured.names == ("e2", "e1")
    assert measured.positions.tolist() == [0.2, 0.1]


@SEVERAL
@given(
    wxyz=arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1), seed=st.integers(0, 99)
)
def test_covariance_turns_from_fixed_axes_to_the_measured_frames(source, every_joint, wxyz, seed):
    # The message's error d moves a pose to p + d[:3], exp(d[3:]) o q (REP-103: fixed axes); ours is p' - p,
    # log(q^-1 o q'). The Jacobian between them, by central differences:
    q, C, h = rotations.normalize(wxyz), random_covariance(seed), 1e-5
    J = np.zeros((6, 6))
    for column in range(6):
        for sign in (1, -1):
            d = sign * h * np.eye(6)[column]
            moved = rotations.multiply(rotations.exp(d[3:]), q)
            turn = rotations.log(rotations.multiply(rotations.conjugate(q), moved))
            J[:, column] += sign * np.concatenate([d[:3], turn]) / (2 * h)
    w, x, y, z = wxyz
    pose = Pose(Point(), Quaternion(x, y, z, w))
    measured = measurement_of(source("/arm/pose"), with_covariance(C, pose), every_joint)
    np.testing.assert_allclose(measured.covariance, J @ C @ J.T, atol=1e-12)  # 2e-14
    turned = measurement_of(source("/base/imu"), with_covariance(C, pose), every_joint)
    np.testing.assert_allclose(turned.covariance, measured.covariance[3:, 3:], atol=1e-15)


def test_covariance_of_samples(source, every_joint):
    # the same once more, without derivatives: turn the pose by random errors and look at the spread
    rng, C = np.random.default_rng(5), random_covariance(5)
    q = np.array([-0.5, 0.5, -0.5, 0.5])
    d = rng.multivariate_normal(np.zeros(6), C, size=20_000)
    moved = rotations.multiply(rotations.exp(d[:, 3:]), q)
    turn = rotations.log(rotations.multiply(rotations.conjugate(q), moved))
    spread = np.cov(np.concatenate([d[:, :3], turn], axis=1).T)
    measured = measurement_of(source("/arm/pose"), with_covariance(C), every_joint)
    np.testing.assert_allclose(spread, measured.covariance, atol=0.03 * np.max(C))  # 0.007


def test_zero_covariance_is_the_scenes_noise(source, every_joint):
    assert measurement_of(source("/arm/pose"), with_covariance(np.zeros(36)), every_joint).covariance is None
    only_position = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    assert measurement_of(source("/base/imu"), with_covariance(only_position), every_joint).covariance is None


def test_an_empty_frame_is_the_scenes(source, every_joint):
    message = PoseStamped(replace(HEADER, frame_id=""), POSE)
    assert measurement_of(source("/arm/pose"), message, every_joint).stamp == STAMP


def header(**changes):
    return replace(HEADER, **changes)


REFUSED = {
    "other frame": ("/arm/pose", PoseStamped(header(frame_id="map"), POSE), "frame_id 'map' is not the scene's, 'lab'"),
    "other frame of points": ("/markers", PoseArray(header(frame_id="map"), [POSE, POSE]), "'map'.*'lab'"),
    "nanoseconds": ("/arm/pose", PoseStamped(header(stamp=Time(1, 10**9)), POSE), "1 s 1000000000 ns"),
    "before time": ("/encoders", JointState(header(stamp=Time(-1, 0)), ["e1"], [0.0]), "-1 s"),
    "zero quaternion": ("/arm/pose", PoseStamped(HEADER, Pose(Point(), Quaternion(0.0, 0.0, 0.0, 0.0))), "orientation"),
    "nan quaternion": (
        "/base/imu",
        PoseStamped(HEADER, Pose(Point(), Quaternion(np.nan, 0.0, 0.0, 1.0))),
        "orientation",
    ),
    "nan position": ("/arm/pose", PoseStamped(HEADER, Pose(Point(np.nan, 0.0, 0.0))), "position .*nan"),
    "infinite position": ("/arm/pose", PoseStamped(HEADER, Pose(Point(0.0, np.inf, 0.0))), "position .*inf"),
    "infinite point": ("/markers", PoseArray(HEADER, [POSE, Pose(Point(np.inf, 0.0, 0.0))]), "points .*inf"),
    "too few points": ("/markers", PoseArray(HEADER, [POSE]), "1 poses came, but the scene names 2 markers"),
    "too many points": ("/markers", PoseArray(HEADER, [POSE] * 3), "3 poses"),
    "no points": ("/markers", PoseArray(HEADER, []), "0 poses"),
    "lengths": ("/encoders", JointState(HEADER, ["e1", "e2"], [0.0]), "1 positions came for 2 names"),
    "velocities only": ("/encoders", JointState(HEADER, ["e1"], [], [1.0]), "0 positions came for 1 names"),
    "unknown joints": ("/encoders", JointState(HEADER, ["a", "b"], [0.0, 0.0]), r"\['a', 'b'\].*\['e1', 'e2'\]"),
    "joint twice": ("/encoders", JointState(HEADER, ["e1", "e1"], [0.0, 1.0]), "each joint once"),
    "nan joint": ("/encoders", JointState(HEADER, ["e1"], [np.nan]), "positions .*nan"),
    "other type": ("/encoders", PoseStamped(HEADER, POSE), "PoseStamped came; valid is sensor_msgs/msg/JointState"),
    "strange type": ("/arm/pose", String("x"), "PoseStamped or geometry_msgs/msg/PoseWithCovarianceStamped"),
    "asymmetric": ("/arm/pose", with_covariance(np.eye(6) + 0.1 * np.eye(6, k=1)), "covariance is not symmetric"),
    "negative": ("/arm/pose", with_covariance(np.diag([1, 1, 1, 1, 1, -1])), "covariance"),
    "indefinite": ("/arm/pose", with_covariance(np.eye(6) + 2 * (np.eye(6, k=5) + np.eye(6, k=-5))), "covariance"),
    "singular": ("/arm/pose", with_covariance(np.diag([1, 1, 1, 0, 1, 1])), "covariance"),
    "nan covariance": ("/arm/pose", with_covariance(np.full(36, np.nan)), "covariance"),
    "infinite covariance": ("/base/imu", with_covariance(np.diag([1, 1, 1, 1, 1, np.inf])), "covariance"),
}


@pytest.mark.parametrize(("topic", "message", "words"), REFUSED.values(), ids=REFUSED)
@pytest.mark.filterwarnings("error")
def test_refused_in_one_sentence_that_names_topic_and_culprit(source, every_joint, topic, message, words):
    with pytest.raises(MeasurementError, match=words) as refusal:
        measurement_of(source(topic), message, every_joint)
    assert str(refusal.value).startswith(f"topic '{topic}': ")
    assert "\n" not in str(refusal.value)


def test_taking_in_counts_what_cannot_be_translated(every_joint):
    estimator = Estimator(every_joint)
    arm = every_joint.measurements[0]
    for data in (b"", b"\0\1\0\0rubbish", encode(PoseStamped(header(frame_id="map"), POSE))):
        assert take_in(estimator, arm, "geometry_msgs/msg/PoseStamped", data) is False
    assert (estimator.counts.read, estimator.counts.rejected) == (3, 3)
    assert "'map'" in estimator.last_rejection
    assert take_in(estimator, arm, "no_msgs/msg/Such", b"") is False
    assert "no_msgs/msg/Such" in estimator.last_rejection
