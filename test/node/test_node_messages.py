"""The node over real DDS: what comes in, what goes out, and when."""

from itertools import islice

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.lagged import Lagged
from physics_prior.interface import Output, take_in
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.messages import Header
from physics_prior.recording.messages import PoseStamped as OurPose
from physics_prior.recording.simulate import message_of, motion
from physics_prior.scene import Accuracy, load_scene
from physics_prior.stepping import Choice, Measured

TOPICS = ("/link1/pose", "/link2/pose")


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


def test_lagged_states_are_those_of_a_lagged_replay_bit_by_bit(graph, scene, measured, send):
    node = graph.node(lag=0.05, diagnostics_rate=50.0)
    received = graph.collect(JointState, "joint_states", raw=True)
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    send(node, measured)
    estimator = Estimator(scene, history_length=1.05)
    lagged, output, expected = Lagged(estimator, 50_000_000, 1.0), Output(scene, estimator.simulator), {}
    estimator.on_settled = lagged.settle
    sources = {source.topic: source for source in scene.measurements}
    for measurement in measured:
        message = message_of(measurement, scene.frame_id)
        take_in(estimator, sources[measurement.topic], message.ros_type, encode(message))
        for posterior in lagged.due(estimator.stamp):
            states = dict(output.states(estimator.describe(posterior)))
            expected[posterior.stamp] = encode(states["joint_states"])
    graph.until(lambda: by_stamp(received) == expected, "the states")
    assert len(expected) >= 140  # of 150 moments, the last five owed
    graph.until(lambda: diagnostics, "diagnostics")
    assert {value.key: value.value for value in diagnostics[-1].status[0].values}["lag s"] == "0.05"


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


def test_a_budget_that_does_not_hold_is_said(graph, send, measured, monkeypatch):
    asked = Accuracy(budget=1e-9)

    def settled(scene, report):
        taken = Measured(scheme="rk4", step=scene.step, error=1e-6, us=50.0)
        told = {"work": "estimating", "interval": 0.01, "seconds": 1.0, "reference": 0.0, "kept": False}
        return scene, Choice(asked=asked, taken=taken, others=(), **told)

    monkeypatch.setattr("physics_prior.node.settle", settled)
    node = graph.node(diagnostics_rate=2.0)
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics")
    send(node, measured)
    said = "us each: the scene's budget is 0.001 us"
    graph.until(lambda: any(said in array.status[0].message for array in diagnostics), "the budget to be missed")
    late = next(array.status[0] for array in diagnostics if said in array.status[0].message)
    assert late.level == b"\x01"
    values = {value.key: value.value for value in late.values}
    assert float(values["us a measurement"]) > 0.0
    assert float(values["real time factor"]) > 0.0


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


def test_effects_are_switched_by_a_service(graph, clock):
    """Before the start and after it, at the node's time, which goes on from there."""
    scene = load_scene("caught_pendulum")
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    node = graph.node(scene="caught_pendulum", use_sim_time=True)
    clock(node, 1000.0)
    switch = "/physics_prior/effects/hand"
    assert graph.call(SetBool, switch, SetBool.Request(data=True)).success
    publisher = graph.publisher(PoseStamped, "/lower/pose")
    for moment in islice(motion(scene, simulator), 30):
        (measurement,), read = moment.measurements, node._estimator.counts.read
        publisher.publish(encode(message_of(measurement, scene.frame_id)))
        graph.until(lambda read=read: node._estimator.counts.read > read, "a measurement to be read")
    assert node._estimator.estimate().holding == ("hand",)
    clock(node, 1000.1)
    assert graph.call(SetBool, switch, SetBool.Request(data=False)).success
    assert node._estimator.estimate().holding == ()
    assert node._estimator.stamp == node._present() == moment.stamp + 100_000_000
