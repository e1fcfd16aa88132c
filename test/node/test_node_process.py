"""The node as a process: exit codes, signals, and the same numbers as a replay, bit for bit."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

from physics_prior.interface import topics_of
from physics_prior.recording import open_bag
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.replay import replay
from physics_prior.recording.simulate import simulate
from physics_prior.ros_inputs import ros_class
from physics_prior.scene import load_scene

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "bags"
SCENE = "uw_double_pendulum"
DEADLINE = 120.0  # s, with a cold cache
STRAGGLERS = 10.0  # s, for what was sent before
NODE = [sys.executable, "-m", "physics_prior.node", "--ros-args"]


@pytest.fixture
def environment(tmp_path, monkeypatch, other_domain):
    """A ROS domain of the test's own for this process and its children."""
    monkeypatch.setenv("ROS_DOMAIN_ID", other_domain)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])))


@contextmanager
def process(command):
    """A child that does not outlive the block, nor the deadline."""
    child = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    timer = threading.Timer(DEADLINE, child.kill)
    timer.start()
    try:
        yield child
    finally:
        timer.cancel()
        child.kill()
        child.wait()
        child.stdout.close()


def read_until(child, words):
    """Read what a child says until it says these words."""
    said = []
    for line in child.stdout:
        said.append(line)
        if words in line:
            return "".join(said)
    pytest.fail(f"the child ended without '{words}': {''.join(said)}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.usefixtures("environment")
def test_signals_end_it_cleanly(number):
    with process([*NODE, "-p", f"scene:={SCENE}"]) as child:
        read_until(child, "ready")
        child.send_signal(number)
        rest = child.stdout.read()
        assert child.wait() == 0, rest
    assert "Traceback" not in rest


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "parameter 'scene' is missing: give a file or one of ball_on_rod, .*double_pendulum, "),
        (["-p", "scene:=nope"], "parameter 'scene': scene 'nope' is neither a file nor a shipped scene; shipped are "),
        (["-p", f"scene:={SCENE}", "-p", "publish_rate:=-1.0"], "parameter 'publish_rate': .* out of range"),
        (["-p", f"scene:={SCENE}", "-p", "publish_rate:=100"], "parameter 'publish_rate' is of the wrong type"),
        (["-p", "scene"], "Couldn't parse parameter override rule: '-p scene'"),
        (["--params-file", "/nope.yaml"], "Couldn't parse params file: '--params-file /nope.yaml'"),
    ],
)
@pytest.mark.usefixtures("environment")
def test_what_is_not_valid_is_said_and_ends_it_with_code_2(arguments, sentence):
    with process([*NODE, *arguments]) as child:
        said = child.stdout.read()
        assert child.wait() == 2, said
    assert len(re.findall(sentence, said)) == 1, said
    assert "Traceback" not in said


class Listener:
    """Collects raw messages of some topics, spun in this thread."""

    def __init__(self, topics):
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.received = {topic: [] for topic in topics}
        for topic, message_type in topics.items():
            append = self.received[topic].append
            self.node.create_subscription(
                ros_class(message_type.ros_type), topic, append, QoSProfile(depth=5000), raw=True
            )

    def until(self, condition, what):
        assert self.wait(condition, DEADLINE), f"waited {DEADLINE:g} s for {what}"

    def wait(self, condition, seconds):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.02)
        return True

    def connected(self):
        return all(self.node.count_publishers(topic) > 0 for topic in self.received)

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


def by_stamp(messages):
    """Topic -> stamp -> last message; the covariance, which has no stamp, goes with the joint state of its turn."""
    decoded = {topic: [decode(TOPICS[topic].ros_type, data) for data in messages[topic]] for topic in TOPICS}
    stamps = [each.header.stamp.sec * 10**9 + each.header.stamp.nanosec for each in decoded["joint_states"]]
    assert {len(sequence) for sequence in decoded.values()} == {len(stamps)}
    return {
        topic: {stamp: encode(message) for stamp, message in zip(stamps, sequence, strict=True)}
        for topic, sequence in decoded.items()
    }


def replayed(bag, out, seconds):
    """What a replay of the bag says."""
    replay(bag, load_scene(SCENE), out, until=seconds)
    messages = {topic: [] for topic in TOPICS}
    for record in open_bag(out).read([f"/{topic}" for topic in TOPICS]):
        messages[record.topic[1:]].append(record.data)
    return by_stamp(messages)


def live(bag, seconds, step, expected):
    """What the node says to a bag that another process publishes."""
    listener = Listener(TOPICS)
    quiet = ("publish_rate:=0.0", "marker_rate:=0.0", "diagnostics_rate:=100.0")
    parameters = [word for each in (f"scene:={SCENE}", *quiet) for word in ("-p", each)]
    player = [sys.executable, str(Path(__file__).with_name("play_bag.py")), str(bag), str(seconds), step, *SOURCES]
    last = {topic: list(expected[topic].values())[-1] for topic in TOPICS}

    def complete():
        """Whether the last of all has come. Bytes after a message are the middleware's."""
        return all(
            sequence and sequence[-1][: len(last[topic])] == last[topic]
            for topic, sequence in listener.received.items()
        )

    try:
        with process([*NODE, *parameters]) as node:
            read_until(node, "ready")
            listener.until(listener.connected, "the node's topics")
            with process(player) as child:
                listener.until(lambda: child.poll() is not None, "the end of the bag")
                assert child.returncode == 0, child.stdout.read()
            listener.wait(complete, STRAGGLERS)  # if it never comes, the comparison tells what came instead
        return by_stamp(listener.received)
    finally:
        listener.close()


TOPICS = {
    topic: message_type
    for topic, message_type in topics_of(load_scene(SCENE)).items()
    if topic not in ("markers", "/diagnostics")
}
SOURCES = [source.topic for source in load_scene(SCENE).measurements]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    bag = tmp_path_factory.mktemp("simulated") / "bag"
    simulate(load_scene(SCENE), bag, duration=1.5)
    return bag


@pytest.mark.usefixtures("environment")
def test_one_core_two_doors_on_a_simulated_bag(simulated, tmp_path):
    expected = replayed(simulated, tmp_path / "out", 10.0)
    said = live(simulated, 10.0, "each", expected)
    assert said == expected
    assert len(said["joint_states"]) == 150  # 151 moments, of which the first only tells where the start is


@pytest.mark.usefixtures("environment")
def test_one_core_two_doors_on_a_rough_recording(tmp_path):
    # outliers, doubles, and arrivals late by up to 60 ms and out of order
    bag = SHARED / "uw_double_pendulum_b_rough"
    if not bag.is_dir():
        pytest.skip(f"needs {bag}")
    expected = replayed(bag, tmp_path / "out", 2.0)
    said = live(bag, 2.0, "each", expected)
    assert said == expected
    assert len(said["joint_states"]) > 100


@pytest.mark.usefixtures("environment")
def test_what_is_known_in_the_end_does_not_depend_on_when_it_came(simulated, tmp_path):
    # all at once: DDS keeps the order of each topic, but not that between topics
    expected = replayed(simulated, tmp_path / "out", 0.8)
    said = live(simulated, 0.8, "all", expected)
    last = max(expected["joint_states"])
    assert {topic: said[topic][last] for topic in TOPICS} == {topic: expected[topic][last] for topic in TOPICS}
