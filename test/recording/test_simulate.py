"""Simulated recordings: reproducible, true to the scene's noise, never half-written; and the shipped ones are what they say."""

import re
from dataclasses import fields, is_dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from physics_prior import __version__
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import RecordingError, SimulationError
from physics_prior.interface.intake import measurement_of
from physics_prior.recording import decode, open_bag
from physics_prior.recording.messages import JointState, MultiDOFJointState
from physics_prior.recording.simulate import EPOCH, message_of, motion, simulate
from physics_prior.recording.truth import Truth
from physics_prior.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
BAGS = sorted(path for path in (ROOT / "bags").iterdir() if path.is_dir())
MADE_UP = "simulated_walk"  # not simulated: test/studies/test_simulated_walk.py
SECOND = 10**9

EVERY_JOINT = """
description: Every kind of joint and of measurement.
model:
  parts:
    base: {mass: 2, inertia: {box: [0.3, 0.2, 0.1]}, joint: {kind: free, name: root}}
    arm:
      mass: 1
      center_of_mass: [0, 0, 0.2]
      inertia: {capsule: {radius: 0.05, length: 0.4}}
      joint: {kind: spherical, name: shoulder, parent: base, position: [0.1, 0, 0.05], orientation: {axis: x, angle: 40 deg}}
    slider: {mass: 0.2, inertia: {sphere: 0.03}, joint: {kind: prismatic, name: slide, parent: arm, axis: z}}
effects: [gravity]
measurements:
  - pose: {topic: /arm/pose, part: arm, frame: {position: [0, 0, 0.1]}, position_noise: 5 mm, orientation_noise: 2 deg, scale: 2}
  - orientation: {topic: /base/imu, part: base, orientation_noise: 1 deg}
  - points: {topic: /markers, noise: 1 mm, markers: [{name: a, part: base}, {name: b, part: slider, point: [0, 0, 0.1]}]}
  - joints: {topic: /encoders, joints: {e: slide}, noise: 1e-3}
noise: {force: 1e-2}
initial: {velocities: {root: {angular: [1, 2, 3]}, shoulder: [3, -2, 1], slide: 0.5}}
"""


@pytest.fixture(scope="module")
def every_joint(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "every_joint.yaml"
    path.write_text(EVERY_JOINT)
    return load_scene(path)


def simulator_of(scene):
    return Simulator(scene.tree, scene.effects, scene.step.integrator)


def moments(scene, **options):
    return list(motion(scene, simulator_of(scene), **options))


def without(scene, *, noise):
    """The scene without its unknown force or without one of its sources."""
    if noise == "force":
        return replace(scene, simulation=scene.simulation.model_copy(update={"force_noise": False}))
    return replace(scene, measurements=tuple(each for each in scene.measurements if each.topic != noise))


def file_bytes(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_the_same_call_gives_the_same_bytes(every_joint, tmp_path):
    for number in ("one", "two"):
        (tmp_path / number).mkdir()
        simulate(every_joint, tmp_path / number / "bag", seed=3, duration=0.2)
    assert file_bytes(tmp_path / "one" / "bag") == file_bytes(tmp_path / "two" / "bag")
    simulate(every_joint, tmp_path / "bag", seed=4, duration=0.2)
    assert file_bytes(tmp_path / "bag") != file_bytes(tmp_path / "one" / "bag")


@pytest.mark.parametrize("bag", [bag for bag in BAGS if bag.name != MADE_UP], ids=lambda bag: bag.name)
def test_shipped_bags_are_what_their_command_makes(bag, tmp_path):
    """Topics, types and stamps exactly, numbers to rounding.

    Another processor's instructions change them by 2e-13, kernels that compute the same in another order by 5e-10.
    """
    simulate(load_scene(bag.name), tmp_path / bag.name)
    made, shipped = open_bag(tmp_path / bag.name), open_bag(bag)
    assert made.topics == shipped.topics
    for ours, theirs in zip(made.read(), shipped.read(), strict=True):
        assert ours[:3] == theirs[:3]
        np.testing.assert_allclose(
            numbers(decode(ours.message_type, ours.data)), numbers(decode(theirs.message_type, theirs.data)), atol=1e-8
        )


def numbers(value):
    """All numbers of a message, in order."""
    if is_dataclass(value):
        value = [getattr(value, field.name) for field in fields(value)]
    if isinstance(value, list | tuple | np.ndarray):
        return [number for each in value for number in numbers(each)]
    return [] if isinstance(value, str) else [value]


def test_there_are_few_bytes_of_shipped_bags_and_a_command_for_each():
    assert {bag.name for bag in BAGS} >= {"double_pendulum", "four_bar", "thrown_cube"}
    assert sum(path.stat().st_size for bag in BAGS for path in bag.iterdir()) < 1_500_000  # 1.01 MB
    page = (ROOT / "bags" / "README.md").read_text("utf-8")
    commands = re.findall(r"^physics-prior simulate (\w+) -o bags/(\w+)$", page, flags=re.MULTILINE)
    assert sorted(commands) == [(bag.name, bag.name) for bag in BAGS if bag.name != MADE_UP]
    assert f"python -m physics_prior.studies.{MADE_UP} bags/{MADE_UP}" in page


def test_topics_stamps_and_metadata(every_joint, tmp_path):
    done = []
    simulate(every_joint, tmp_path / "bag", seed=3, duration=0.2, progress=done.append)
    bag = open_bag(tmp_path / "bag")
    assert {topic: kind.type.rpartition("/")[2] for topic, kind in bag.topics.items()} == {
        "/arm/pose": "PoseStamped",
        "/base/imu": "PoseStamped",
        "/markers": "PoseArray",
        "/encoders": "JointState",
        "/truth/joint_states": "JointState",
        "/truth/multi_dof_joint_states": "MultiDOFJointState",
        "/truth/odometry": "Odometry",
        "/truth/constraint_forces/shoulder": "WrenchStamped",
        "/truth/constraint_forces/slide": "WrenchStamped",
    }
    assert {kind.count for kind in bag.topics.values()} == {21}
    for record in bag.read():
        stamp = decode(record.message_type, record.data).header.stamp
        assert stamp.sec * SECOND + stamp.nanosec == record.log_time_ns
    assert sorted({record.log_time_ns for record in bag.read()}) == [EPOCH + 10_000_000 * k for k in range(21)]
    assert bag.metadata_records["simulation"] == {
        "scene": "every_joint",
        "seed": "3",
        "duration_s": "0.2",
        "rate_hz": "100.0",
        "version": __version__,
    }
    assert done == sorted(done)
    assert done[-1] == 1.0
    with Reader(tmp_path / "bag") as theirs:
        assert theirs.message_count == 9 * 21


def test_messages_bring_the_measurements(every_joint):
    """Through the message and back, to the bit but for the orientation's last: it is normalised again."""
    for moment in moments(every_joint, seed=0, duration=0.05):
        for source, measurement in zip(every_joint.measurements, moment.measurements, strict=True):
            back = measurement_of(source, message_of(measurement, every_joint.frame_id), every_joint)
            assert type(back) is type(measurement)
            for name, value in vars(measurement).items():
                if isinstance(value, np.ndarray):
                    np.testing.assert_allclose(getattr(back, name), value, rtol=0, atol=1e-15)
                else:
                    assert getattr(back, name) == value


def test_the_state_comes_back_from_the_truth(every_joint, tmp_path):
    """q and v from the bag alone: 1e-14 (2e-15 seen)."""
    simulate(every_joint, tmp_path / "bag", seed=3, duration=0.2)
    truth = Truth(every_joint, simulator_of(every_joint))
    records = open_bag(tmp_path / "bag").read(truth.topics)
    grouped = [list(group) for _, group in groupby(records, lambda record: record.log_time_ns)]
    for moment, group in zip(moments(every_joint, seed=3, duration=0.2), grouped, strict=True):
        q, v = truth.state({record.topic: decode(record.message_type, record.data) for record in group})
        np.testing.assert_allclose(q, moment.q, atol=1e-14)
        np.testing.assert_allclose(v, moment.v, atol=1e-14)


def test_the_truth_of_other_joints_is_refused(every_joint):
    truth = Truth(every_joint, simulator_of(every_joint))
    with pytest.raises(RecordingError, match=r"the truth names the joints \['knee'\]: the scene has \['root', "):
        truth.state({"/truth/joint_states": JointState(name=("knee",), position=(0.0,), velocity=(0.0,))})
    with pytest.raises(RecordingError, match="the truth names the joints"):
        truth.state({"/truth/multi_dof_joint_states": MultiDOFJointState()})


def test_forces_of_the_truth_are_the_scenes_own(tmp_path):
    """At the end of a swing the pin carries what the equations of motion say, m (a - g)."""
    scene = load_scene("pendulum")
    simulator = simulator_of(scene)
    for topic, message in Truth(scene, simulator).messages(EPOCH, scene.initial.q, scene.initial.v):
        if topic == "/truth/constraint_forces/pivot":
            force = message.wrench.force
    angle = np.radians(60.0)
    alpha = -1.5 * 9.80665 * np.sin(angle)  # of a uniform rod of 1 m
    # the centre, at half a metre below the pin, turned about +y: (-sin, -cos) / 2
    expected = 0.5 * alpha * np.array([-np.cos(angle), np.sin(angle)]) + [0.0, 9.80665]
    np.testing.assert_allclose([force.x, force.z], expected, rtol=1e-12)


def test_a_stream_for_each(every_joint):
    """No noise depends on another's being there."""
    whole = moments(every_joint, seed=1, duration=0.1)[-1]
    fewer = moments(without(every_joint, noise="/markers"), seed=1, duration=0.1)[-1]
    assert fewer.q.tobytes() == whole.q.tobytes()
    topics = [measurement.topic for measurement in fewer.measurements]
    assert topics == ["/arm/pose", "/base/imu", "/encoders"]
    for ours, theirs in zip(fewer.measurements[:2], whole.measurements[:2], strict=True):
        assert ours.orientation.tobytes() == theirs.orientation.tobytes()
    calm = without(every_joint, noise="force")
    first, last = moments(calm, seed=1, duration=0.1)[::10]
    assert (
        first.measurements[0].position.tobytes() == moments(every_joint, seed=1)[0].measurements[0].position.tobytes()
    )
    assert last.q.tobytes() != whole.q.tobytes()


def test_force_noise_is_white_with_the_scenes_density():
    """A free body's momentum after one second: the density, times the square root of a second."""
    scene = load_scene("free_body")
    scene = replace(scene, simulation=scene.simulation.model_copy(update={"rate": 2.0}))
    simulator = simulator_of(scene)
    ends = np.array([list(motion(scene, simulator, seed, 1.0))[-1].v[:3] for seed in range(200)])
    gained = (ends - scene.initial.v[:3]) / (scene.noise.force[:3] / scene.tree.mass)
    assert 0.89 < np.std(gained) < 1.11  # 600 numbers: 4 deviations
    assert abs(np.mean(gained)) < 0.17


def test_stamps_of_a_rate_that_no_nanosecond_divides():
    scene = load_scene("thrown_cube")  # 148 Hz
    stamps = [moment.stamp - EPOCH for moment in moments(scene, seed=0)]
    assert stamps == [round(k * 1e9 / 148.0) for k in range(60)]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"duration": np.nan}, "duration nan s is not valid: give a positive number"),
        ({"duration": np.inf}, "duration inf s is not valid"),
        ({"duration": 0.0}, "duration 0 s is not valid"),
        ({"duration": 1e9}, "duration 1e.09 s is too long: at the scene's rate, give at most 100000 s"),
        ({"seed": -1}, "seed -1 is not valid: give a whole number >= 0"),
    ],
)
def test_bad_numbers_are_named(options, sentence, tmp_path):
    with pytest.raises(SimulationError, match=sentence):
        simulate(load_scene("pendulum"), tmp_path / "bag", **options)
    assert list(tmp_path.iterdir()) == []


def test_a_motion_that_leaves_the_numbers_leaves_no_bag(tmp_path):
    scene = load_scene("double_pendulum")
    scene = replace(scene, initial=replace(scene.initial, v=np.array([1e200, 0.0])))
    with pytest.raises(SimulationError, match="is not finite"):
        simulate(scene, tmp_path / "bag")
    assert list(tmp_path.iterdir()) == []


def test_a_start_that_no_projection_reaches_is_refused():
    """Three rods of a metre do not reach nine."""
    scene = load_scene("four_bar")
    far = scene.effects[1].model_copy(update={"at": (9.0, 0.0, 0.0)})
    with pytest.raises(
        SimulationError, match="initial positions do not do: 'ground_pin' cannot take hold: 6 m stay between"
    ):
        moments(replace(scene, effects=(scene.effects[0], far)), seed=0, duration=0.1)


def test_a_bag_is_not_overwritten(tmp_path):
    simulate(load_scene("pendulum"), tmp_path / "bag", duration=0.1)
    before = file_bytes(tmp_path / "bag")
    with pytest.raises(RecordingError, match="exists"):
        simulate(load_scene("pendulum"), tmp_path / "bag", duration=0.1)
    assert file_bytes(tmp_path / "bag") == before
