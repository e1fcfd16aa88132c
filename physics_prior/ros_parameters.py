"""The node's parameters: each stated once, with its description, its range and whether it may change while it runs."""

from collections.abc import Iterable
from dataclasses import dataclass

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from physics_prior.errors import PhysicsPriorError, SceneError
from physics_prior.resources import shipped_scenes
from physics_prior.scene import load_scene

Value = str | float | bool


class ParameterError(PhysicsPriorError):
    """A parameter that the node was started with is not valid."""


@dataclass(frozen=True)
class Setting:
    """A parameter: its default, what it means, its range, and whether it is read once, when the node is configured."""

    default: Value
    description: str
    range: tuple[float, float] | None = None
    read_once: bool = False

    def descriptor(self, read_only: bool = False) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows."""
        ranges = [] if self.range is None else [FloatingPointRange(from_value=self.range[0], to_value=self.range[1])]
        return ParameterDescriptor(description=self.description, floating_point_range=ranges, read_only=read_only)


AUTOSTART = "autostart"
SETTINGS = {
    "scene": Setting("", "scene to estimate: the name of a shipped one or the path of a file", read_once=True),
    "frame_id": Setting("", "world frame of all messages; empty: the scene's own", read_once=True),
    "history_length": Setting(1.0, "s that a measurement may come late and still find its place", (0.0, 60.0), True),
    "lag": Setting(0.0, "s after its stamp that an estimate is told by measurements, and published", (0.0, 10.0), True),
    "prediction_horizon": Setting(0.0, "s that published states are predicted past the newest measurement", (0.0, 1.0)),
    "publish_rate": Setting(100.0, "Hz of predicted states while no measurements come; 0: none", (0.0, 1000.0)),
    "marker_rate": Setting(20.0, "Hz of markers; 0: none", (0.0, 100.0)),
    "diagnostics_rate": Setting(1.0, "Hz of diagnostics; 0: none", (0.0, 100.0)),
    AUTOSTART: Setting(True, "whether the node configures and activates itself; false: a lifecycle manager does"),
}


def declare(node: Node) -> None:
    """Declare all parameters, with the values that the node was started with.

    Raises:
        ParameterError: one of these is of another type, out of range, or names no scene.
    """
    for name, setting in SETTINGS.items():
        try:
            node.declare_parameter(name, setting.default, setting.descriptor(read_only=name == AUTOSTART))
        except InvalidParameterTypeException:
            kind = {str: "a text", float: "a number with a decimal point, such as 1.0", bool: "true or false"}
            raise ParameterError(
                f"parameter '{name}' is of the wrong type: give {kind[type(setting.default)]}"
            ) from None
        except InvalidParameterValueException as error:
            reason = str(error).partition("Reason: ")[2].rpartition(": ")[0]
            raise ParameterError(f"parameter '{name}': {reason}") from None


def why_refused(parameters: Iterable[Parameter], configured: bool) -> str:
    """Return why these may not be set together, in one sentence; empty if they may.

    Types and ranges are rclpy's to check, by the descriptors.
    """
    for parameter in parameters:
        setting = SETTINGS.get(parameter.name)
        if setting is None:
            continue
        if setting.read_once and configured:
            return f"'{parameter.name}' is read when the node is configured: clean it up first"
        if parameter.name == "scene" and parameter.value:
            try:
                load_scene(parameter.value)
            except PhysicsPriorError as error:
                return str(error)
    return ""


def require_scene(name: str) -> str:
    """Return the scene's name; SceneError lists the shipped ones if none is given."""
    if not name:
        raise SceneError(f"parameter 'scene' is missing: give a file or one of {', '.join(shipped_scenes())}")
    return name
