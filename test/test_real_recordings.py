"""Acceptance on real recordings: what the estimator reaches on bags that nobody simulated. Needs ../shared/bags."""

from pathlib import Path

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.interface import measurement_of
from physics_prior.recording.cdr import decode
from physics_prior.recording.reader import open_bag
from physics_prior.recording.replay import ReplayResult, replay
from physics_prior.scene import load_scene

REFERENCE = "/reference/joint_states"
HALF_WIDTH = 0.0524  # m, of the tossed cube
TOSSES = ("120", "128", "172", "410", "438", "550")


def bag(shared: Path, name: str) -> Path:
    path = shared / "bags" / name
    if not path.exists():
        pytest.skip(f"{path} is missing: it is a recording that is not shipped")
    return path


def pendulum(shared: Path, name: str, smooth: bool = False, process: str = "physics") -> ReplayResult:
    scene = load_scene("uw_double_pendulum")
    return replay(
        bag(shared, f"uw_double_pendulum_{name}"), scene, smooth=smooth, process=process, references=[REFERENCE]
    )


# name, smoothed, bounds of angle [deg], rate [rad/s], force [% of weight]; beside them what was measured
BOUNDS = [
    ("a_noisy", False, 0.49, 0.110, 1.40),  # 0.360 0.1007 1.244
    ("a_noisy", True, 0.32, 0.095, 1.20),  # 0.268 0.0882 1.068
    ("b_noisy", False, 0.41, 0.076, 0.62),  # 0.273 0.0629 0.429
    ("b_noisy", True, 0.25, 0.058, 0.41),  # 0.176 0.0496 0.310
    ("a_rough", False, 0.52, 0.115, 1.80),  # 0.417 0.1077 1.477
    ("b_rough", False, 0.46, 0.082, 0.70),  # 0.355 0.0698 0.538
]


@pytest.mark.parametrize(("name", "smooth", "angle", "rate", "force"), BOUNDS)
def test_double_pendulum_from_noisy_poses_alone(
    shared: Path, name: str, smooth: bool, angle: float, rate: float, force: float
) -> None:
    score = pendulum(shared, name, smooth).score
    assert score is not None
    assert score["position_rmse_deg"] <= angle
    assert score["velocity_rmse"] <= rate
    assert score["force_rmse_percent_weight"] <= force


@pytest.mark.parametrize("name", ["a_noisy", "b_noisy"])
def test_innovations_are_as_large_as_they_should_be(shared: Path, name: str) -> None:
    nis = pendulum(shared, name).summary()["nis"]
    low, high = nis["band95"]
    assert low <= nis["mean"] <= high  # a 5.951, b 5.961 in [5.854, 6.148]


def test_physics_beats_a_kinematic_process(shared: Path) -> None:
    physics, kinematic = (pendulum(shared, "b_noisy", process=process).score for process in ("physics", "kinematic"))
    assert physics is not None
    assert kinematic is not None
    assert physics["position_rmse_deg"] < 0.5 * kinematic["position_rmse_deg"]  # 0.27 and 1.2
    assert physics["velocity_rmse"] < 0.2 * kinematic["velocity_rmse"]  # 0.063 and 1.0
    assert physics["force_rmse_percent_weight"] < 0.05 * kinematic["force_rmse_percent_weight"]  # 0.43 and 30


@pytest.mark.parametrize("name", ["a", "b"])
def test_outliers_gap_and_late_arrivals_are_survived(shared: Path, name: str) -> None:
    clean, rough = (_poses(bag(shared, f"uw_double_pendulum_{name}{suffix}")) for suffix in ("", "_rough"))
    outliers = {key for key, pose in rough.items() if _far(pose, clean[key])}
    result = pendulum(shared, f"{name}_rough")
    seen = [(result.epoch + round(at * 1e9), topic) for at, topic in zip(result.nis_stamps, result.topics, strict=True)]
    gated = {key for key, refused in zip(seen, result.gated, strict=True) if refused}
    good = set(seen) - outliers
    assert len(gated & outliers) >= 0.95 * len(outliers & set(seen))  # a 55 of 55, b 70 of 70
    assert len(gated & good) < 0.02 * len(good)  # a 2 of 1876, b 2 of 1859
    assert result.counts.late > 1000  # a 1206, b 1212: arrival is late by up to 60 ms
    for values in (*result.readouts.values(), *result.deviations.values()):
        assert np.isfinite(values).all()
    assert result.health_s["LOST"] < 0.05
    gap = (result.stamps > 4.3) & (result.stamps < 4.9)  # nothing is measured from 4 to 5 s
    after = (result.stamps > 5.2) & (result.stamps < 10.0)
    assert (result.health[gap] == 1).all()
    assert (result.health[after] == 0).all()


@pytest.mark.parametrize("toss", ["172", "410"])
def test_cube_is_followed_through_free_flight(shared: Path, toss: str) -> None:
    """Of the noisy copy, half of the flight is predicted from the other half and compared with the clean recording."""
    clean, noisy = bag(shared, f"cube_toss_{toss}"), bag(shared, f"cube_toss_{toss}_noisy")
    flight = _flight_seconds(clean)
    result = replay(noisy, load_scene("thrown_cube"), until=flight)
    nis = result.summary()["nis"]
    low, high = nis["band95"]
    assert low <= nis["mean"] <= high  # 172: 5.2 in [4.5, 7.6], 410: 6.1 in [4.5, 7.6]
    assert result.summary()["measurements"]["gated"] == 0
    truth = {stamp: z for (stamp, _), (position, _) in _poses(clean).items() for z in [position[2] / 0.978]}
    error = [
        height - truth[result.epoch + round(at * 1e9)]
        for at, height in zip(result.stamps, result.readouts["height"], strict=True)
        if result.epoch + round(at * 1e9) in truth and at > 0.5 * flight
    ]
    assert len(error) > 3
    assert np.sqrt(np.mean(np.square(error))) < 0.005  # below the noise of one measurement


def test_clean_tosses_fall_as_gravity_says(shared: Path) -> None:
    """Pooled over the six tosses; one by one they scatter (11.5, 6.2, 5.6, 4.8, 4.5, 4.1): splines do not make white noise."""
    scene = load_scene("thrown_cube_smoothed")
    total = count = 0.0
    for toss in TOSSES:
        path = bag(shared, f"cube_toss_{toss}")
        result = replay(path, scene, until=_flight_seconds(path))
        total, count = total + float(result.nis.sum()), count + float(result.nis_dimension.sum())
    spread = 1.96 * np.sqrt(2.0 / count)
    assert abs(total / count - 1.0) < spread  # 1.007, bound 0.11


def _poses(path: Path) -> dict[tuple[int, str], tuple[np.ndarray, np.ndarray]]:
    """Stamp and topic -> position and orientation of every pose in a bag."""
    reader = open_bag(path)
    topics = [name for name, topic in reader.topics.items() if topic.type == "geometry_msgs/msg/PoseStamped"]
    out = {}
    for record in reader.read(topics):
        message = decode(record.message_type, record.data)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        p, o = message.pose.position, message.pose.orientation
        out[stamp, record.topic] = (np.array([p.x, p.y, p.z]), np.array([o.w, o.x, o.y, o.z]))
    return out


def _far(pose: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> bool:
    """Whether a pose is farther from another than its noise (5 mm, 2 deg) explains."""
    turn = rotations.log(rotations.multiply(rotations.conjugate(other[1]), pose[1]))
    return bool(np.degrees(np.linalg.norm(turn)) > 15.0 or np.linalg.norm(pose[0] - other[0]) > 0.04)


def _flight_seconds(path: Path) -> float:
    """How long the cube of a clean toss flies before its lowest corner comes within 12 mm of the table."""
    scene = load_scene("thrown_cube")
    corners = HALF_WIDTH * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    first = None
    for record in open_bag(path).read(["/cube/pose"]):
        pose = measurement_of(scene.measurements[0], decode(record.message_type, record.data), scene)
        first = first or pose.stamp
        lowest = (corners @ rotations.matrix_from_quaternion(pose.orientation).T + pose.position)[:, 2].min()
        if lowest < 0.012:
            break
    return (pose.stamp - first) * 1e-9 - 0.003
