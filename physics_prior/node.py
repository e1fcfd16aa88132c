"""The ROS 2 node: measurements in, estimates out. Only the middleware is here; what messages mean is in `interface`."""

import math
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import Any

from physics_prior.errors import PhysicsPriorError

try:
    import rclpy
except ImportError as missing:
    print(
        f"physics_prior_node needs rclpy ({missing}): `pip install physics_prior[ros]`, or source a ROS 2 Jazzy setup file",
        file=sys.stderr,
    )
    raise SystemExit(2) from None

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool, Trigger

from physics_prior.estimation.estimate import Estimate, Health, Level
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.lagged import Lagged
from physics_prior.interface import Output, take_in
from physics_prior.interface.output import Publication
from physics_prior.interface.pace import Pace
from physics_prior.interface.topics import TRANSFORMS, switch_services
from physics_prior.interface.warm_up import warm_up
from physics_prior.recording.cdr import encode
from physics_prior.recording.messages import MarkerArray
from physics_prior.ros_inputs import Input, ros_class
from physics_prior.ros_parameters import AUTOSTART, declare, require_scene, why_refused
from physics_prior.scene import MeasurementSource, load_scene
from physics_prior.stepping import settle

IMPORTED = time.monotonic()
FOLLOW_PERIOD = 0.2  # s, at which publishers are looked at
OUTPUT_QUEUE = 100  # states that a slow reader may lag behind


class PhysicsPriorNode(LifecycleNode):
    """Estimates one scene.

    Parameters: `ros_parameters`; topics: the scene's and `interface.topics`; services: ``~/reset``, ``~/effects/NAME``.

    Configured it has compiled the scene and announced its topics; active it reads and publishes.

    Raises:
        ParameterError: a parameter that it was started with is not valid.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("physics_prior", **options)
        self._estimator: Estimator | None = None
        self._output: Output | None = None
        self._publishers_by_topic: dict[str, Any] = {}
        self._inputs: list[Input] = []
        self._rate_timers: list[Any] = []
        self._offered: list[Any] = []  # services; `_services` is rclpy's own
        self._lost_before = 0
        self._pace = Pace(None)
        self._forget()
        self.add_on_set_parameters_callback(self._judge_parameters)
        declare(self)
        self.add_post_set_parameters_callback(self._use_parameters)
        backward = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
        self._jump_handle = self.get_clock().create_jump_callback(backward, post_callback=self._time_jumped)

    # Lifecycle ------------------------------------------------------------------------------------------------------

    def start(self) -> bool:
        """Configure and activate; return whether that went well. What did not is in the log."""
        transitions = (self.trigger_configure, self.trigger_activate)
        return all(transition() is TransitionCallbackReturn.SUCCESS for transition in transitions)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            self._configure()
        except PhysicsPriorError as error:
            return self._give_up(str(error))
        except Exception:  # rclpy would swallow it without a word
            return self._give_up(traceback.format_exc())
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        assert self._estimator is not None
        result = super().on_activate(state)
        scene = self._estimator.scene
        self._inputs = [Input(self, source, self._receive) for source in scene.measurements]
        self._start_timers()
        topics = ", ".join(each.topic_name for each in self._inputs)
        self.get_logger().info(
            f"ready {time.monotonic() - IMPORTED:.2f} s after imports: scene '{scene.name}' of {scene.tree.nv} degrees of"
            f" freedom in frame '{scene.frame_id}', listening to {topics}"
        )
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tear_down()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tear_down()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tear_down()
        return super().on_error(state)

    def destroy_node(self) -> None:
        self._jump_handle.unregister()
        super().destroy_node()

    def _give_up(self, reason: str) -> TransitionCallbackReturn:
        self.get_logger().error(reason)
        self._tear_down()
        return TransitionCallbackReturn.FAILURE

    def _configure(self) -> None:
        scene = load_scene(require_scene(self._value("scene")))
        self.get_logger().info(
            f"preparing scene '{scene.name}': half a minute where it was never compiled, else a second"
        )
        scene, choice = settle(scene, self.get_logger().info)
        self._pace = Pace(None if choice is None else choice.asked)
        if choice is not None:
            self.get_logger().info(f"step chosen: {choice.taken.scheme}, {1e3 * choice.taken.step.size:g} ms")
        scene = replace(scene, frame_id=self._value("frame_id") or scene.frame_id)
        warm_up(scene)
        lag = self._value("lag")
        self._estimator = Estimator(scene, history_length=self._value("history_length") + lag)
        self._output = Output(scene, self._estimator.simulator, lag)
        rate = self._value("publish_rate")
        self._lagged = Lagged(self._estimator, round(lag * 1e9), 1.0 / rate if rate > 0.0 else math.inf)
        if lag > 0.0:
            self._estimator.on_settled = self._lagged.settle
        for topic, message_type in self._output.topics.items():
            if topic == TRANSFORMS and find_spec("tf2_msgs") is None:
                self.get_logger().info(f"{topic} is not published: it needs the package tf2_msgs")
                continue
            # markers are latched: a viewer that comes late sees the model at once
            latched = message_type is MarkerArray
            durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            depth = 1 if latched else OUTPUT_QUEUE
            self._publishers_by_topic[topic] = self.create_lifecycle_publisher(
                ros_class(message_type.ros_type), topic, QoSProfile(depth=depth, durability=durability)
            )
        self._offered = [self.create_service(Trigger, "~/reset", self._reset_asked)]
        for effect, name in switch_services(scene).items():
            self._offered.append(self.create_service(SetBool, name, partial(self._switch_asked, effect)))

    def _stop(self) -> None:
        for each in self._inputs:
            each.close()
        for timer in self._rate_timers:
            self.destroy_timer(timer)
        self._inputs, self._rate_timers = [], []
        if self._estimator is not None:
            self._reset()

    def _tear_down(self) -> None:
        self._stop()
        for publisher in self._publishers_by_topic.values():
            self.destroy_lifecycle_publisher(publisher)
        for service in self._offered:
            self.destroy_service(service)
        self._publishers_by_topic, self._offered = {}, []
        self._estimator, self._output = None, None

    # Parameters and time --------------------------------------------------------------------------------------------

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _judge_parameters(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        reason = why_refused(parameters, configured=self._estimator is not None)
        return SetParametersResult(successful=not reason, reason=reason)

    def _use_parameters(self, parameters: Iterable[Parameter]) -> None:
        if self._rate_timers:
            self._start_timers()

    def _start_timers(self) -> None:
        """Start what happens at a rate. Only the prediction follows simulated time: people look on in their own."""
        for timer in self._rate_timers:
            self.destroy_timer(timer)
        wall = Clock(clock_type=ClockType.STEADY_TIME)
        actions: list[tuple[float, Callable[[], None], Clock]] = [
            (self._value("publish_rate"), self._predict, self.get_clock()),
            (self._value("marker_rate"), self._draw, wall),
            (self._value("diagnostics_rate"), self._diagnose, wall),
            (1.0 / FOLLOW_PERIOD, self._follow_publishers, wall),
        ]
        self._rate_timers = [
            self.create_timer(1.0 / rate, action, clock=clock) for rate, action, clock in actions if rate > 0.0
        ]

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _time_jumped(self, jump: TimeJump) -> None:
        if self._estimator is not None:
            self.get_logger().warning(f"time jumped by {jump.delta.nanoseconds * 1e-9:.3g} s: the estimate starts anew")
            self._reset()

    # Measurements in, estimates out ---------------------------------------------------------------------------------

    def _forget(self) -> None:
        self._arrived = 0  # when the newest measurement came, ns of the node's clock
        self._latest: Estimate | None = None
        self._drawn: Estimate | None = None
        self._health: Health | None = None

    def _reset(self) -> None:
        assert self._estimator is not None
        self._estimator.reset()
        self._lagged.forget()
        self._forget()

    def _reset_asked(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reset()
        response.success, response.message = True, "the estimate starts anew with the next measurements"
        return response

    def _switch_asked(self, effect: str, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Have an effect take hold or let go now; before the start, at the start."""
        estimator = self._estimator
        assert estimator is not None
        stamp = self._present() if estimator.ready else 0
        estimator.last_rejection = ""
        if estimator.switch(effect, request.data, stamp):
            self._arrived = self._now()
        response.message = estimator.last_rejection
        if not response.message and estimator.ready:
            estimate = estimator.estimate()
            if (effect in estimate.holding) != request.data:
                response.message = estimate.health.cause or f"other commands or forces after {stamp} ns say otherwise"
        response.success = not response.message
        return response

    def _receive(self, source: MeasurementSource, type_name: str, data: bytes) -> None:
        estimator = self._estimator
        assert estimator is not None
        stamp, rejection = estimator.stamp, estimator.last_rejection
        begin = time.thread_time()
        changed = take_in(estimator, source, type_name, data)
        self._pace.add(estimator.stamp, time.thread_time() - begin)
        if estimator.last_rejection != rejection:
            self.get_logger().warning(estimator.last_rejection, throttle_duration_sec=5.0)
        if changed:
            if estimator.stamp != stamp:
                self._arrived = self._now()
            self._publish_states(estimator.stamp)

    def _predict(self) -> None:
        """Publish what is predicted for now, where measurements stay away for longer than a period and are not LOST."""
        estimator = self._estimator
        assert estimator is not None
        if estimator.ready and (self._now() - self._arrived) * 1e-9 * self._value("publish_rate") > 1.0:
            stamp = self._present()
            if self._watch_health().level is not Level.LOST:
                self._publish_states(stamp)

    def _present(self) -> int:
        """Stamp, ns, that a measurement would have that came now."""
        assert self._estimator is not None
        if not self._estimator.ready:
            return self._now()
        return self._estimator.stamp + max(0, self._now() - self._arrived)

    def _publish_states(self, stamp: int) -> None:
        """Publish what is to be told at a time, ns on the clock of the measurements."""
        assert self._output is not None
        try:
            for estimate in self._lagged.estimates(stamp, round(self._value("prediction_horizon") * 1e9)):
                self._publish(self._output.states(estimate))
                before, self._latest = self._latest, estimate
                self._watch_health()
                if before is not None and self._value("diagnostics_rate") > 0.0:
                    active = self._output.active_effects
                    if active(estimate) != active(before):  # told at once: when is as much asked for as which
                        self._diagnose()
        except PhysicsPriorError as error:
            self.get_logger().error(f"{error}; the estimate starts anew")
            self._reset()

    def _draw(self) -> None:
        assert self._output is not None
        if self._latest is not None and self._latest is not self._drawn:
            self._drawn = self._latest
            self._publish(self._output.markers(self._latest))

    def _publish(self, publications: Iterable[Publication]) -> None:
        for topic, message in publications:
            if topic in self._publishers_by_topic:
                self._publishers_by_topic[topic].publish(encode(message))

    # Health ---------------------------------------------------------------------------------------------------------

    def _follow_publishers(self) -> None:
        for each in self._inputs:
            each.follow()

    def _watch_health(self) -> Health:
        """Health now; a change of its level is logged with its cause."""
        assert self._estimator is not None
        health = self._estimator.health_at(self._present())
        if self._health is None or health.level is not self._health.level:
            # rclpy takes one severity a line of code
            if health.level is Level.OK:
                self.get_logger().info("health OK")
            else:
                self.get_logger().warning(f"health {health.level.name}: {health.cause}")
        self._health = health
        return health

    def _diagnose(self) -> None:
        assert self._estimator is not None
        assert self._output is not None
        health, problems = self._watch_health(), [each.problem for each in self._inputs if each.problem]
        lost = sum(each.lost for each in self._inputs)
        if lost > self._lost_before:
            problems.append(
                f"{lost - self._lost_before} measurements were lost: they come faster than they are taken in"
            )
        slow, pace = self._pace.tell()
        if slow:
            problems.append(slow)
        if problems:
            causes = "; ".join([*problems, health.cause] if health.cause else problems)
            health = Health(max(health.level, Level.DEGRADED), causes)
        more = {
            "measurements lost": lost,
            "longest wait ms": f"{1e3 * max((each.longest_wait for each in self._inputs), default=0.0):.1f}",
            "last rejection": self._estimator.last_rejection,
            **pace,
        }
        self._lost_before = lost
        for each in self._inputs:
            each.forget_wait()
        self._publish(self._output.diagnostics(self._present(), health, self._estimator.counts, self._latest, more))


def main(arguments: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code: 0, or 2 where what it was started with is not valid."""
    node: PhysicsPriorNode | None = None
    try:
        rclpy.init(args=arguments)
        executor = SingleThreadedExecutor()  # whole before the node is ready: half of one cannot be interrupted cleanly
        node = PhysicsPriorNode()
        executor.add_node(node)
        if node.get_parameter(AUTOSTART).value and not node.start() and rclpy.ok():
            return 2
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except PhysicsPriorError as error:
        print(f"physics_prior_node: {error}", file=sys.stderr)
        return 2
    except RuntimeError as error:  # rclpy's own root, of errors in its arguments and of all calls after a shutdown
        if node is not None and rclpy.ok():
            raise
        if node is None:
            sentence = str(error).partition(", at /")[0]  # the rest is where rcl's sources stood when it was built
            print(f"physics_prior_node: {sentence}", file=sys.stderr)
            return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
