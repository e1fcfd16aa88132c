"""A ROS graph of a test's own, with the node and a peer, and measurements to publish in it."""

import os
import random
import time
from contextlib import suppress
from itertools import islice

import pytest

with suppress(ImportError):  # without ROS the tests of this folder are skipped, and nothing here is used
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.parameter import Parameter
    from rosgraph_msgs.msg import Clock

    from physics_prior.node import PhysicsPriorNode

from physics_prior.dynamics.simulator import Simulator
from physics_prior.recording.cdr import encode
from physics_prior.recording.simulate import message_of, motion
from physics_prior.scene import load_scene

SCENE = "uw_double_pendulum"
TOPICS = ("/link1/pose", "/link2/pose")
DEADLINE = 30.0  # s, for what takes a hundredth of one
PATIENCE = 1.0  # s, until a service is asked again
QUIET = {"publish_rate": 0.0, "marker_rate": 0.0, "diagnostics_rate": 0.0}
DEPTH = 5000  # of queues that lose nothing


class Graph:
    """The node and a peer, each a DDS participant of its own, both spun in this thread until something is so."""

    def __init__(self):
        # of this worker's parity, so that no other worker's graph is the same
        domain = 2 * random.randrange(50) + 2 - int(os.environ["ROS_DOMAIN_ID"]) % 2
        self.contexts = [Context(), Context()]
        for context in self.contexts:
            rclpy.init(context=context, domain_id=domain)
        self.executors = [SingleThreadedExecutor(context=context) for context in self.contexts]
        self.peer = rclpy.create_node("peer", context=self.contexts[1])
        self.executors[1].add_node(self.peer)
        self.nodes = [self.peer]

    def node(self, start=True, **parameters):
        overrides = [Parameter(name, value=value) for name, value in ({"scene": SCENE} | QUIET | parameters).items()]
        node = PhysicsPriorNode(context=self.contexts[0], parameter_overrides=overrides)
        self.nodes.append(node)
        self.executors[0].add_node(node)
        assert not start or node.start()
        return node

    def until(self, condition, what):
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, f"waited {DEADLINE:g} s for {what}"
            for executor in self.executors:
                executor.spin_once(timeout_sec=0.002)

    def publisher(self, ros_type, topic):
        publisher = self.peer.create_publisher(ros_type, topic, DEPTH)
        self.until(lambda: publisher.get_subscription_count() > 0, f"a subscription to {topic}")
        return publisher

    def collect(self, ros_type, topic, raw=False, qos=DEPTH):
        received = []
        self.peer.create_subscription(ros_type, topic, received.append, qos, raw=raw)
        self.until(lambda: self.nodes[-1].count_subscribers(topic) > 0, f"{topic} to be discovered")
        self.until(lambda: self.peer.count_publishers(topic) > 0, f"a publisher of {topic}")
        return received

    def call(self, service_type, name, request):
        """Ask until an answer comes: a client may be served before its reader is known, and the answer lost."""
        client = self.peer.create_client(service_type, name)
        self.until(client.service_is_ready, name)
        asked = []

        def answered():
            if not asked or time.monotonic() - asked[-1][0] > PATIENCE:
                asked.append((time.monotonic(), client.call_async(request)))
            return any(future.done() for _, future in asked)

        self.until(answered, f"the answer of {name}")
        return next(future.result() for _, future in asked if future.done())

    def close(self):
        for executor in self.executors:
            executor.shutdown()
        for node in self.nodes:
            node.destroy_node()
        for context in self.contexts:
            rclpy.try_shutdown(context=context)


@pytest.fixture
def graph(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


@pytest.fixture(scope="module")
def measured(scene):
    """Measurements of a simulated second and a half, in order."""
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    return [each for moment in islice(motion(scene, simulator), 150) for each in moment.measurements]


@pytest.fixture
def send(graph, scene):
    """Publish measurements, each time waiting until the node has taken it in."""
    publishers = {}

    def publish(node, measurements):
        for topic in TOPICS:
            if topic not in publishers:
                publishers[topic] = graph.publisher(PoseStamped, topic)
        for measurement in measurements:
            read = node._estimator.counts.read
            publishers[measurement.topic].publish(encode(message_of(measurement, scene.frame_id)))
            graph.until(lambda read=read: node._estimator.counts.read > read, "a measurement to be read")

    return publish


@pytest.fixture
def clock(graph):
    """Set simulated time, s, and wait until the node has it."""

    def set_time(node, seconds):
        if not hasattr(graph, "clock"):
            graph.clock = graph.publisher(Clock, "/clock")
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(round(seconds * 1e9), 10**9)

        def shown():
            graph.clock.publish(message)  # again and again: the node listens to it with best effort
            return node._now() == round(seconds * 1e9)

        graph.until(shown, f"the clock to show {seconds:g} s")

    return set_time
