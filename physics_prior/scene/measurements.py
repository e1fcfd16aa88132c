"""What a scene measures: which topic tells what about which part, and how noisily."""

from abc import abstractmethod
from typing import Annotated, ClassVar

from pydantic import Field, model_validator

from physics_prior.model import JointKind, Tree
from physics_prior.scene.quantity import quantity
from physics_prior.scene.schema import Name, Number, Pose, Position, PositiveAngle, PositiveLength, Topic
from physics_prior.scene.section import Section, require_known
from physics_prior.scene.yaml_file import Place


class MeasurementSource(Section):
    """Base of all sources. Noise is a standard deviation per axis, white, of the measured quantity.

    Where a message carries a covariance that is not zero, that one holds instead of the scene's noise.
    """

    message_types: ClassVar[tuple[str, ...]]

    topic: Topic

    @abstractmethod
    def check(self, tree: Tree, place: Place) -> None:
        """Raise SceneError at its place in the file if the source does not fit the model."""


class _PartSource(MeasurementSource):
    message_types = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")

    part: str
    frame: Pose = Pose()
    orientation_noise: PositiveAngle

    def check(self, tree: Tree, place: Place) -> None:
        """Check part, joint and marker names."""
        require_known(place["part"], self.part, part_names(tree), "part")


class PoseSource(_PartSource):
    """The pose of a frame of a part in the world.

    Attributes:
        part, frame: the measured frame, given in the part's.
        position_noise: m.
        orientation_noise: rad, of the rotation vector in the measured frame.
        scale: measured positions are multiplied by it, where a tracker's length scale is known to be off.
    """

    position_noise: PositiveLength
    scale: Annotated[Number, Field(gt=0.0)] = 1.0


class OrientationSource(_PartSource):
    """The orientation of a frame of a part in the world; the position of the message is not read."""


class Marker(Section):
    """A named point, m, of a part; its own noise, m, if it is not that of all."""

    name: Name
    part: str
    point: Position = (0.0, 0.0, 0.0)
    noise: PositiveLength | None = None


class PointsSource(MeasurementSource):
    """Positions of markers in the world, in the order of the PoseArray; a marker of NaN is not seen. Each is gated by itself."""

    message_types = ("geometry_msgs/msg/PoseArray",)

    markers: Annotated[tuple[Marker, ...], Field(min_length=1)]
    noise: PositiveLength

    def check(self, tree: Tree, place: Place) -> None:
        """Check part, joint and marker names."""
        seen: set[str] = set()
        for index, marker in enumerate(self.markers):
            here = place["markers"][index]
            require_known(here["part"], marker.part, part_names(tree), "part")
            if marker.name in seen:
                raise here["name"].error(f"'{marker.name}' is another marker's name: give each its own")
            seen.add(marker.name)


class JointSource(MeasurementSource):
    """Coordinates of revolute and prismatic joints.

    Attributes:
        joints: name in the message -> joint; other names in the message are ignored.
        noise: rad or m.
    """

    message_types = ("sensor_msgs/msg/JointState",)

    joints: Annotated[dict[str, str], Field(min_length=1)]
    noise: Annotated[float, quantity("rad", "m"), Field(gt=0.0)]

    def check(self, tree: Tree, place: Place) -> None:
        """Check part, joint and marker names."""
        known = scalar_joint_names(tree)
        for name, joint in self.joints.items():
            require_known(place["joints"][name], joint, known, "revolute or prismatic joint")


class SwitchSource(MeasurementSource):
    """A force by which an effect is felt that can be switched: it begins to act above one size of it and ends below another.

    Attributes:
        effect: the effect's name.
        above, below: N.
    """

    message_types = ("geometry_msgs/msg/WrenchStamped",)

    effect: str
    above: Annotated[float, quantity("N"), Field(gt=0.0)]
    below: Annotated[float, quantity("N"), Field(gt=0.0)]

    @model_validator(mode="after")
    def _check_order(self) -> "SwitchSource":
        if self.below > self.above:
            raise ValueError(f"below {self.below:g} N is not valid: give at most above, {self.above:g} N")
        return self

    def check(self, tree: Tree, place: Place) -> None:
        """Nothing of the model is named; the loader checks the effect."""


SOURCES: dict[str, type[MeasurementSource]] = {
    "pose": PoseSource,
    "orientation": OrientationSource,
    "points": PointsSource,
    "joints": JointSource,
    "switch": SwitchSource,
}
"""Every kind of measurement, by its key in the scene file."""


def part_names(tree: Tree) -> list[str]:
    """Names of the parts, the world left out."""
    return [part.name for part in tree.parts]


def scalar_joint_names(tree: Tree) -> list[str]:
    """Names of the joints that have one coordinate."""
    return [joint.name for joint in tree.joints if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC)]
