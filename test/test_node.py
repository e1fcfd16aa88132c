"""The node in this process, over real DDS: parameters, life cycle, what comes in, what goes out, and when."""

import random
import time
from itertools import islice

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimator import Estimator
from physics_prior.interface import Output, take_in
from physics_prior.node import PhysicsPriorNode
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.messages import Header
from physics_prior.recording.messages import PoseStamped as OurPose
from physics_prior.recording.simulate import message_of, motion
from physics_prior.resources import share_directory
from physics_prior.ros_parameters import SETTINGS, ParameterError
from physics_prior.scene import load_scene

SCENE = "uw_double_pendulum"
TOPICS = ("/link1/pose", "/link2/pose")
DEADLINE = 30.0  # s, for what takes a hundredth of one
PATIENCE = 1.0  # s, until a service is asked again
QUIET = {"publish_rate": 0.0, "marker_rate": 0.0, "diagnostics_rate": 0.0}
DEEP = QoSProfile(depth=5000)


class Graph:
    """The node and a peer, each a DDS participant of its own, both spun in this thread until something is so."""

    def __init__(self):
        domain = random.randint(1, 101)
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

    def publisher(self, ros_type, topic, qos=DEEP):
        publisher = self.peer.create_publisher(ros_type, topic, qos)
        self.until(lambda: publisher.get_subscription_count() > 0, f"a subscription to {topic}")
        return publisher

    def collect(self, ros_type, topic, raw=False, qos=DEEP):
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


def directly(scene, measurements):
    """An estimator that is given the messages of the measurements without any ROS, and what it says at each stamp."""
    estimator, said = Estimator(scene), {}
    sources = {source.topic: source for source in scene.measurements}
    output = Output(scene, estimator.simulator)
    for measurement in measurements:
        message = message_of(measurement, scene.frame_id)
        if take_in(estimator, sources[measurement.topic], message.ros_type, encode(message)):
            said[estimator.stamp] = encode(dict(output.states(estimator.estimate()))["joint_states"])
    return estimator, said


def by_stamp(received):
    """Last raw joint_states of each stamp; the middleware may add bytes at the end."""
    said = {}
    for data in received:
        message = decode("sensor_msgs/msg/JointState", data)
        said[message.header.stamp.sec * 10**9 + message.header.stamp.nanosec] = encode(message)
    return said


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


# What goes out ----------------------------------------------------------------------------------------------------------


def test_states_are_those_of_the_estimator_bit_by_bit(graph, scene, measured, send):
    node = graph.node()
    received = graph.collect(JointState, "joint_states", raw=True)
    send(node, measured)
    _, expected = directly(scene, measured)
    last = dict([expected.popitem()])
    graph.until(lambda: by_stamp(received[-1:]) == last, "the last state")
    expected |= last
    assert by_stamp(received) == expected
    assert len(expected) >= 148  # of 150 moments; the first two make the start


def test_a_plain_subscriber_reads_every_topic(graph, scene, measured, send):
    node = graph.node(marker_rate=50.0, diagnostics_rate=50.0)
    states = graph.collect(JointState, "joint_states")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    send(node, measured[:20])
    markers = graph.collect(MarkerArray, "markers", qos=latched)  # comes late, and still gets the last
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    graph.until(lambda: markers and diagnostics, "messages")
    estimate = node._latest
    graph.until(lambda: list(states[-1].position) == estimate.q.tolist(), "the last state")
    assert stamp_of(states[-1]) == measured[19].stamp
    assert list(states[-1].name) == ["pivot", "elbow"]
    assert list(states[-1].velocity) == estimate.v.tolist()
    assert list(states[-1].effort) == estimate.effort.tolist()
    assert {marker.ns for marker in markers[-1].markers} == {"parts", "forces", "uncertainty"}
    graph.until(lambda: diagnostics[-1].status[0].level == b"\x00", "health OK")
    values = {value.key: value.value for value in diagnostics[-1].status[0].values}
    assert values["measurements read"] == "20"
    assert values["measurements lost"] == "0"
    assert values["active effects"] == "gravity, joint_damping"


def test_odometry_of_a_free_body(graph):
    scene = load_scene("free_body")
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    node = graph.node(scene="free_body", frame_id="hall")
    odometry = graph.collect(Odometry, "odometry")
    publisher = graph.publisher(PoseStamped, "/box/pose")
    moments = list(islice(motion(scene, simulator), 10))
    for moment in moments:
        publisher.publish(encode(message_of(moment.measurements[0], "hall")))
    graph.until(lambda: odometry and stamp_of(odometry[-1]) == moments[-1].stamp, "odometry")
    last, estimate = odometry[-1], node._latest
    assert (last.header.frame_id, last.child_frame_id) == ("hall", "box")
    assert [last.pose.pose.position.x, last.pose.pose.position.y, last.pose.pose.position.z] == estimate.q[:3].tolist()
    assert [last.twist.twist.angular.x, last.twist.twist.angular.y] == estimate.v[3:5].tolist()
    covariance = np.reshape(last.pose.covariance, (6, 6))
    np.testing.assert_allclose(np.diag(covariance)[:3], np.diag(estimate.covariance)[:3], rtol=1e-12)


def test_states_are_predicted_past_the_newest_measurement(graph, scene, measured, send):
    node = graph.node(prediction_horizon=0.05)
    received = graph.collect(JointState, "joint_states")
    send(node, measured[:20])
    newest = measured[19].stamp
    estimator, _ = directly(scene, measured[:20])
    q = estimator.estimate(newest + 50_000_000).q.tolist()
    graph.until(lambda: received and list(received[-1].position) == q, "the predicted state")
    assert stamp_of(received[-1]) == newest + 50_000_000


# What comes in ----------------------------------------------------------------------------------------------------------


def test_a_looped_bag_gives_the_same_lap_again(graph, scene, measured, send):
    node = graph.node()
    received = graph.collect(JointState, "joint_states", raw=True)
    last = dict([directly(scene, measured)[1].popitem()])
    laps = []
    for _ in range(2):
        received.clear()
        send(node, measured)
        graph.until(lambda: by_stamp(received[-1:]) == last, "the end of the lap")
        laps.append(by_stamp(received))
    # the second lap is known to be one after five measurements that find no place: the first stamps have one estimate
    assert len(laps[0]) >= 148
    assert len(laps[1]) >= 145
    assert all(laps[0][stamp] == said for stamp, said in laps[1].items())


def test_bad_messages_are_counted_and_explained_and_the_node_lives(graph, scene, measured, send):
    node = graph.node(diagnostics_rate=50.0)
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    good = message_of(measured[0], scene.frame_id)
    publisher = graph.publisher(PoseStamped, TOPICS[0])
    publisher.publish(encode(OurPose(Header(good.header.stamp, "moon"), good.pose)))
    graph.until(lambda: node._estimator.counts.rejected == 1, "a rejection")

    def said():
        return {value.key: value.value for value in diagnostics[-1].status[0].values} if diagnostics else {}

    reason = f"topic '{TOPICS[0]}': frame_id 'moon' is not the scene's, 'world': transform the poses first"
    graph.until(lambda: said().get("last rejection") == reason, "the reason")
    publisher.publish(b"\x00\x01\x00\x00\x01")
    publisher.publish(encode(OurPose(good.header)) + b"\0" * 9)  # bytes after the message are left alone
    graph.until(lambda: node._estimator.counts.read == 3, "three messages")
    assert node._estimator.counts.rejected == 2
    send(node, measured)
    assert node._estimator.ready


def test_covariances_are_read_where_the_publisher_has_them(graph, scene, measured):
    node = graph.node()
    publisher = graph.publisher(PoseWithCovarianceStamped, TOPICS[0])
    message = PoseWithCovarianceStamped()
    message.header.frame_id = scene.frame_id
    message.pose.covariance[0] = -1.0
    publisher.publish(message)
    graph.until(lambda: node._estimator.counts.rejected == 1, "a rejection")
    assert "covariance" in node._estimator.last_rejection
    assert TOPICS[0] in node._estimator.last_rejection


def test_best_effort_publishers_are_heard(graph):
    node = graph.node()
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = graph.peer.create_publisher(PoseStamped, TOPICS[0], qos)

    def heard():
        publisher.publish(PoseStamped())
        return node._estimator.counts.read > 0

    graph.until(heard, "a best-effort message")


def test_publishers_of_a_wrong_type_are_named(graph):
    graph.node(diagnostics_rate=50.0)
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    graph.peer.create_publisher(String, TOPICS[0], 1)
    reason = f"topic '{TOPICS[0]}' holds std_msgs/msg/String: valid is geometry_msgs/msg/PoseStamped or"
    graph.until(lambda: diagnostics and diagnostics[-1].status[0].message.startswith(reason), "the reason")
    assert diagnostics[-1].status[0].level == b"\x02"  # still waiting for measurements


def test_lost_measurements_are_counted(graph, measured, scene):
    node = graph.node(diagnostics_rate=50.0)
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    publisher = graph.publisher(PoseStamped, TOPICS[0])
    message = encode(message_of(measured[0], scene.frame_id))
    publisher.publish(message)
    graph.until(lambda: node._estimator.counts.read == 1, "the first")
    for _ in range(150):  # the node is not spun meanwhile and keeps the last 100
        publisher.publish(message)
    publisher.wait_for_all_acked()
    graph.until(lambda: node._estimator.counts.read == 101, "the others")
    assert node._inputs[0].lost == 50
    said = [status.message for array in diagnostics for status in array.status]
    graph.until(
        lambda: any("50 measurements were lost" in status.message for array in diagnostics for status in array.status),
        f"the loss among {set(said)}",
    )


# When -------------------------------------------------------------------------------------------------------------------


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


def test_without_measurements_the_state_is_predicted_until_it_is_lost(graph, clock, scene, measured, send):
    node = graph.node(use_sim_time=True, publish_rate=10.0, diagnostics_rate=50.0)
    clock(node, 1000.0)
    received = graph.collect(JointState, "joint_states")
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    send(node, measured[:20])
    newest = measured[19].stamp
    graph.until(lambda: received and stamp_of(received[-1]) == newest, "the newest state")
    said = (
        (0.12, "OK"),
        (0.3, "no measurement was accepted for 0.30 s"),
        (2.0, "no measurement was accepted for 2.00 s"),
    )
    for ahead, message in said:
        clock(node, 1000.0 + ahead)
        graph.until(lambda ahead=ahead: stamp_of(received[-1]) == newest + round(ahead * 1e9), f"{ahead:g} s ahead")
        graph.until(lambda message=message: diagnostics[-1].status[0].message.startswith(message), message)
        assert diagnostics[-1].status[0].level == (b"\x00" if message == "OK" else b"\x01")
    estimator, _ = directly(scene, measured[:20])
    assert list(received[-1].position) == estimator.estimate(newest + 2 * 10**9).q.tolist()
    clock(node, 1010.0)
    graph.until(lambda: diagnostics[-1].status[0].level == b"\x02", "health LOST")
    assert stamp_of(received[-1]) == newest + 2 * 10**9
    send(node, measured[20:])
    graph.until(lambda: diagnostics[-1].status[0].level == b"\x00", "health OK")
    graph.until(lambda: stamp_of(received[-1]) == measured[-1].stamp, "the newest state")


def test_time_that_jumps_back_starts_the_estimate_anew(graph, clock, measured, send):
    node = graph.node(use_sim_time=True)
    clock(node, 1000.0)
    send(node, measured[:20])
    assert node._estimator.ready
    clock(node, 1001.0)
    assert node._estimator.ready
    clock(node, 999.0)
    assert not node._estimator.ready
    assert node._latest is None


def test_reset_starts_the_estimate_anew(graph, measured, send):
    node = graph.node()
    send(node, measured[:20])
    assert node._estimator.ready
    answer = graph.call(Trigger, "/physics_prior/reset", Trigger.Request())
    assert answer.success
    assert not node._estimator.ready
    send(node, measured[20:40])
    assert node._estimator.ready
    assert node._estimator.counts.read == 40


# Parameters -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("scene", "no_such", "'no_such' is neither a file nor a shipped scene; shipped are ball_on_rod, .*"),
        ("scene", 3, "give a text"),
        ("publish_rate", -1.0, "out of range"),
        ("publish_rate", 100, "such as 1.0"),
        ("publish_rate", float("nan"), "out of range"),
        ("prediction_horizon", 1.5, "out of range"),
        ("prediction_horizon", float("inf"), "out of range"),
        ("history_length", -0.1, "out of range"),
        ("autostart", "yes", "true or false"),
    ],
)
def test_the_node_does_not_start_with_a_wrong_parameter(graph, name, value, reason):
    with pytest.raises(ParameterError, match=f"parameter '{name}'.*{reason}") as refusal:
        graph.node(**{name: value})
    assert "\n" not in str(refusal.value)


def test_a_scene_must_be_given(graph):
    node = graph.node(start=False, scene="")
    assert not node.start()
    assert node._estimator is None


def test_all_of_a_set_of_parameters_or_none(graph):
    node = graph.node()
    bad = [Parameter("marker_rate", value=5.0), Parameter("prediction_horizon", value=-1.0)]
    result = node.set_parameters_atomically(bad)
    assert not result.successful
    assert "prediction_horizon" in result.reason
    assert node.get_parameter("marker_rate").value == 0.0
    for name, value in (("scene", "pendulum"), ("frame_id", "map"), ("history_length", 2.0)):
        result = node.set_parameters_atomically([Parameter("marker_rate", value=5.0), Parameter(name, value=value)])
        assert result.reason == f"'{name}' is read when the node is configured: clean it up first"
    assert node.get_parameter("marker_rate").value == 0.0
    good = [Parameter("marker_rate", value=5.0), Parameter("prediction_horizon", value=0.1)]
    assert node.set_parameters_atomically(good).successful
    assert [timer.timer_period_ns for timer in node._rate_timers] == [200_000_000, 200_000_000]  # markers, publishers


def test_every_parameter_is_described(graph):
    node = graph.node(start=False)
    for name in SETTINGS:
        descriptor = node.describe_parameter(name)
        assert descriptor.description
        if isinstance(SETTINGS[name].default, float):
            (limits,) = descriptor.floating_point_range
            assert limits.from_value == 0.0
            assert limits.to_value > 0.0
    assert not node.set_parameters([Parameter("autostart", value=False)])[0].successful


def test_the_shipped_parameters_are_the_nodes(graph):
    shipped = yaml.safe_load((share_directory() / "config" / "node.yaml").read_text())["/**"]["ros__parameters"]
    assert list(shipped) == list(SETTINGS)
    graph.node(start=False, **shipped)


# Life cycle -------------------------------------------------------------------------------------------------------------


def test_a_manager_takes_it_through_its_states(graph, measured, send):
    node = graph.node(start=False, autostart=False)

    def state():
        return graph.call(GetState, "/physics_prior/get_state", GetState.Request()).current_state.id

    changes = graph.peer.create_client(ChangeState, "/physics_prior/change_state")

    def change(transition, goal):
        graph.until(changes.service_is_ready, "the service")
        changes.call_async(ChangeState.Request(transition=Transition(id=transition)))
        graph.until(lambda: state() == goal, f"state {goal}")

    assert state() == State.PRIMARY_STATE_UNCONFIGURED
    change(Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
    assert node._inputs == []  # announces, does not listen
    assert node.count_publishers("joint_states") == 1
    received = graph.collect(JointState, "joint_states")
    change(Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    send(node, measured[:20])
    graph.until(lambda: received and stamp_of(received[-1]) == measured[19].stamp, "states")
    change(Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    assert node._inputs == []
    assert node._rate_timers == []
    assert not node._estimator.ready  # what is known then is old when it goes on
    change(Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    send(node, measured[20:40])
    graph.until(lambda: stamp_of(received[-1]) == measured[39].stamp, "states again")
    change(Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    change(Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED)
    assert node.count_publishers("joint_states") == 0
    refused = node.set_parameters([Parameter("scene", value="no_such")])[0]
    assert "shipped are ball_on_rod" in refused.reason
    assert node.set_parameters([Parameter("scene", value="free_body")])[0].successful
    change(Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
    assert node.count_publishers("odometry") == 1
    change(Transition.TRANSITION_INACTIVE_SHUTDOWN, State.PRIMARY_STATE_FINALIZED)


def test_a_scene_that_went_bad_leaves_the_node_unconfigured(graph, tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text((share_directory() / "config" / "scenes" / "pendulum.yaml").read_text())
    node = graph.node(start=False, scene=str(path))
    path.write_text("model: 3")
    assert not node.start()
    assert node._estimator is None
    assert node.count_publishers("joint_states") == 0
