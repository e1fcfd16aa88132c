"""A person who walks, over real DDS: joints, torques, feet, centre of mass and energy, as replay has them."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, WrenchStamped
from sensor_msgs.msg import JointState, MultiDOFJointState
from std_msgs.msg import Float64

from physics_prior.interface.topics import deviation_topic
from physics_prior.recording import open_bag
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.replay import replay
from physics_prior.scene import load_scene

BAG = Path(__file__).resolve().parents[2] / "bags" / "simulated_walk"
SCENE = "simulated_walk"
SECONDS = 0.4  # of the bag: 41 frames of markers
FEET = ("constraint_forces/left_sole", "constraint_forces/right_sole")
TOPICS = {
    "joint_states": JointState,
    "multi_dof_joint_states": MultiDOFJointState,
    "center_of_mass": PoseWithCovarianceStamped,
    "energy": Float64,
    **dict.fromkeys([*FEET, *map(deviation_topic, FEET)], WrenchStamped),
}


def ros_name(ros_type):
    return f"{ros_type.__module__.split('.')[0]}/msg/{ros_type.__name__}"


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_a_walk_is_published_as_replay_has_it_bit_by_bit(graph, tmp_path, lag):
    node = graph.node(scene=SCENE, lag=lag)
    received = {topic: graph.collect(ros_type, topic, raw=True) for topic, ros_type in TOPICS.items()}
    markers = graph.publisher(PoseArray, "/markers")
    records = list(open_bag(BAG).read(["/markers"]))
    first = records[0].log_time_ns
    for record in records:
        if record.log_time_ns - first > SECONDS * 1e9:
            break
        read = node._estimator.counts.read
        markers.publish(record.data)
        graph.until(lambda read=read: node._estimator.counts.read > read, "a frame to be read")
    replay(BAG, load_scene(SCENE), tmp_path / "out", lag=lag, until=SECONDS)
    expected = {topic: [] for topic in TOPICS}
    for record in open_bag(tmp_path / "out").read([f"/{topic}" for topic in TOPICS]):
        expected[record.topic[1:]].append(record.data)
    owed = round(lag * 100.0) + (lag > 0.0)  # whose lag has not passed at the last frame: replay tells these at the end
    count = len(expected["joint_states"]) - owed
    assert count >= 39 - owed
    graph.until(lambda: all(len(each) == count for each in received.values()), "the last state")
    for topic, ros_type in TOPICS.items():
        # the middleware may add bytes at the end
        said = [encode(decode(ros_name(ros_type), data)) for data in received[topic]]
        assert said == expected[topic][:count], topic
    last = {topic: decode(ros_name(ros_type), received[topic][-1]) for topic, ros_type in TOPICS.items()}
    weight = load_scene(SCENE).tree.mass * 9.80665
    vertical = sum(last[foot].wrench.force.z for foot in FEET)
    assert vertical == pytest.approx(weight, rel=0.3)  # LOADS
    assert all(last[deviation_topic(foot)].wrench.force.z > 0.0 for foot in FEET if last[foot].wrench.force.z > 0.0)
    joints = last["joint_states"]
    assert np.max(np.abs(joints.effort)) > 5.0  # N m: muscles work
