"""The node over real DDS: its parameters and its life cycle."""

import pytest
import yaml

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from physics_prior.resources import share_directory
from physics_prior.ros_parameters import SETTINGS, ParameterError


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


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
