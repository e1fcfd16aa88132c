"""Attachments: a point of a part pinned to the world or to another part, or the whole part held; for ever or for a time."""

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from pydantic import Field

from physics_prior import rotations
from physics_prior.effects.effect import Anchor, PointPair
from physics_prior.effects.holding import Holding
from physics_prior.effects.two_points import Vector
from physics_prior.model import Tree


class Attachment(Holding):
    """A point pinned to a point: a ball joint that closes a loop, a hand on a rail. Three rows."""

    kind: ClassVar[str] = "attachment"
    catches: ClassVar[bool] = True

    def explain(self, tree: Tree) -> str:
        return f"pins a point of {self.part} to {self.to}{self._spans()}: 3 rows"

    def point_pairs(self, tree: Tree) -> Sequence[PointPair]:
        a, b = self.anchors()
        return (PointPair(a, b, np.eye(3), motion=self.motion),)


class Rod(Holding):
    """A massless rod: two points keep their distance. One row."""

    kind: ClassVar[str] = "rod"

    length: float = Field(gt=0.0, description="m, distance the two points keep")

    def explain(self, tree: Tree) -> str:
        return f"keeps a point of {self.part} {self.length:.4g} m from {self.to}{self._spans()}: 1 row"

    def point_pairs(self, tree: Tree) -> Sequence[PointPair]:
        a, b = self.anchors()
        return (PointPair(a, b, np.array([[1.0, 0.0, 0.0]]), self.length, self.motion),)


class Hinge(Holding):
    """A hinge that closes a loop: a common point and a common axis. Five rows."""

    kind: ClassVar[str] = "hinge"

    axis: Vector = Field(description="hinge axis in the frame of `part`")
    to_axis: Vector = Field(description="the same axis in the frame of `to`")

    def explain(self, tree: Tree) -> str:
        return f"hinges {self.part} to {self.to}{self._spans()}: 5 rows"

    def point_pairs(self, tree: Tree) -> Sequence[PointPair]:
        a, b = self.anchors()
        along_a, along_b = _unit(self.to_axis), _unit(self.axis)
        lever = _lever(tree)
        across = _across(along_a)
        far_a, far_b = Anchor(a.part, a.point + lever * along_a), Anchor(b.part, b.point + lever * along_b)
        return (
            PointPair(a, b, np.eye(3), motion=self.motion),
            PointPair(far_a, far_b, across, motion=self.motion),
        )


class Weld(Holding):
    """A part held in place and orientation. Six rows."""

    kind: ClassVar[str] = "weld"
    catches: ClassVar[bool] = True

    orientation: tuple[float, float, float, float] = Field(
        default=(1.0, 0.0, 0.0, 0.0), description="quaternion w, x, y, z: axes of `part` to the frame of `to`"
    )

    def explain(self, tree: Tree) -> str:
        return f"welds {self.part} to {self.to}{self._spans()}: 6 rows"

    def point_pairs(self, tree: Tree) -> Sequence[PointPair]:
        a, b = self.anchors()
        lever = _lever(tree)
        R = rotations.matrix_from_quaternion(rotations.normalize(np.array(self.orientation)))
        x, y, z = np.eye(3)
        rows = ((np.zeros(3), np.eye(3)), (x, np.array([y, z])), (y, np.array([z])))
        return tuple(
            PointPair(
                Anchor(a.part, a.point + lever * along),
                Anchor(b.part, b.point + lever * R.T @ along),
                directions,
                motion=self.motion,
            )
            for along, directions in rows
        )

    def caught(self, position: np.ndarray, orientation: np.ndarray) -> Self:
        return super().caught(position, orientation).model_copy(update={"orientation": tuple(orientation.tolist())})


def _unit(axis: Vector) -> np.ndarray:
    return np.array(axis) / float(np.linalg.norm(axis))


def _across(axis: np.ndarray) -> np.ndarray:
    """(2, 3) two unit vectors across an axis (3,)."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _lever(tree: Tree) -> float:
    """A length typical of the model, m: rows at this lever weigh turning like shifting in the constraint solve."""
    radii = [
        np.sqrt(np.trace(k.mass_properties.inertia) / k.mass_properties.mass)
        for k in tree.links
        if k.mass_properties.mass
    ]
    return float(max(np.max(radii), 1e-6)) if radii else 1.0
