"""Readouts: named scalars of the state, to plot and to score."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import model_validator

from physics_prior.effects import Effect
from physics_prior.model import JointKind, Tree
from physics_prior.scene.measurements import part_names, scalar_joint_names
from physics_prior.scene.schema import Axis, Name, Position
from physics_prior.scene.section import Section, require_known
from physics_prior.scene.yaml_file import Place


@dataclass(frozen=True)
class Subject:
    """What readouts may read: a tree and the effects on it."""

    tree: Tree
    effects: Sequence[Effect]

    def forces(self) -> list[str]:
        """Names of all constraint forces: of the joints and of the effects that hold something."""
        held = [name for effect in self.effects for name in effect.reactions(self.tree)]
        reacting = [link.joint for link in self.tree.links if link.joint.kind is not JointKind.FREE]
        return [joint.name for joint in reacting] + held


class Readout(Section):
    """Base of all readouts: its name, unique in the scene, and its kind."""

    kind: ClassVar[str]

    name: Name

    def check(self, subject: Subject, place: Place) -> None:
        """Raise SceneError at its place in the file if it reads something that is not there."""


class JointReadout(Readout):
    """Coordinate of a revolute [rad] or prismatic [m] joint; named after the joint where no name is given."""

    kind = "joint"
    shorthand = "joint"

    joint: str

    @model_validator(mode="before")
    @classmethod
    def _name(cls, value: Any) -> Any:
        return _named(value, "joint", cls.shorthand)

    def check(self, subject: Subject, place: Place) -> None:
        """Check that what it reads is there."""
        require_known(
            place.inside(("joint",)),
            self.joint,
            scalar_joint_names(subject.tree),
            "revolute or prismatic joint",
        )


class AngleReadout(Readout):
    """Absolute angle of a part about a world axis, rad.

    The angle by which the part's direction ``zero`` is turned about ``axis`` from the same direction taken in
    world axes, both seen along the axis. For motion in a plane it does not depend on the choice of zero.

    Attributes:
        part: the part.
        axis: (3,) unit vector in world axes.
        zero: (3,) unit vector in the part frame, not along the axis; where left out, the coordinate axis
            that is most across.
    """

    kind = "angle"

    part: str
    axis: Axis
    zero: Axis = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check_zero(self) -> "AngleReadout":
        if not any(self.zero):
            # z first: for the usual axis y of motion in the x-z plane, angles are counted from the vertical
            across = min((2, 0, 1), key=lambda index: abs(self.axis[index]))
            x, y, z = np.eye(3)[across].tolist()
            object.__setattr__(self, "zero", (x, y, z))
        if np.linalg.norm(np.cross(self.zero, self.axis)) < 1e-6:
            raise ValueError(f"zero {list(self.zero)} lies along the axis: give a direction across it")
        return self

    def check(self, subject: Subject, place: Place) -> None:
        """Check that what it reads is there."""
        require_known(place["part"], self.part, part_names(subject.tree), "part")


class PointReadout(Readout):
    """Coordinate of a point of a part, given in the part frame, along a world axis, m."""

    kind = "point"

    part: str
    point: Position = (0.0, 0.0, 0.0)
    axis: Axis

    def check(self, subject: Subject, place: Place) -> None:
        """Check that what it reads is there."""
        require_known(place["part"], self.part, part_names(subject.tree), "part")


class EnergyReadout(Readout):
    """Energy of all parts, J."""

    kind = "energy"
    shorthand = "energy"

    name: Name = "energy"
    energy: Literal["total"] = "total"


class ForceReadout(Readout):
    """Constraint force in world axes, N: what an effect or joint exerts on the part that it holds or carries.

    Attributes:
        constraint: label of an effect that holds something, or name of a joint; the readout
            has its name if it is given none.
        component: one coordinate, the norm, or all three.
    """

    kind = "force"
    shorthand = "constraint"

    constraint: str
    component: Literal["x", "y", "z", "norm", "vector"] = "vector"

    @model_validator(mode="before")
    @classmethod
    def _name(cls, value: Any) -> Any:
        return _named(value, "constraint", cls.shorthand)

    def check(self, subject: Subject, place: Place) -> None:
        """Check that what it reads is there."""
        require_known(place.inside(("constraint",)), self.constraint, subject.forces(), "constraint force")


READOUTS: dict[str, type[Readout]] = {
    readout.kind: readout for readout in (JointReadout, AngleReadout, PointReadout, EnergyReadout, ForceReadout)
}
"""Every kind of readout, by its key in the scene file."""


def _named(value: Any, field: str, shorthand: str | None) -> Any:
    """Name a readout after what it reads where the file gives no name."""
    if isinstance(value, str):
        value = {shorthand: value}
    if isinstance(value, dict) and "name" not in value and field in value:
        value = {"name": value[field], **value}
    return value
