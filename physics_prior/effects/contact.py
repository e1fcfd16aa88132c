"""Contact: two convex surfaces that push each other apart, stick and slip."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from physics_prior import rotations
from physics_prior.effects.effect import Effect
from physics_prior.effects.touching import Footing, Surface, TouchingPair
from physics_prior.errors import ModelError
from physics_prior.model import Tree

Vector = tuple[float, float, float]
Kind = Literal["plane", "sphere", "capsule", "box", "ellipsoid"]
SIZES = {"plane": 0, "sphere": 1, "capsule": 2, "box": 3, "ellipsoid": 3}
"""How many numbers say the size of a surface."""


class Contact(Effect):
    """A part against the ground, or against another part: normal force, Coulomb friction, restitution (design eq. 8)."""

    kind: ClassVar[str] = "contact"
    strengths: ClassVar[tuple[str, ...]] = ("friction", "rolling", "restitution")

    part: str = Field(description="the part that is pushed; the published force acts on it")
    shape: Literal["sphere", "capsule", "box", "ellipsoid"] | None = Field(
        default=None, description="its surface; that of its `shape` or `inertia` in the model where left out"
    )
    size: tuple[float, ...] = Field(
        default=(),
        description="m, of that surface: radius; radius and length between the caps; three edges; three semi-axes",
    )
    position: Vector = Field(default=(0.0, 0.0, 0.0), description="m, of its centre in the frame of `part`")
    orientation: tuple[float, float, float, float] = Field(
        default=(1.0, 0.0, 0.0, 0.0), description="quaternion w, x, y, z: its axes to the frame of `part`"
    )
    to: str = Field(default="world", description="what it touches: another part or 'world'")
    to_shape: Kind | None = Field(default=None, description="the other surface; a plane of the world where left out")
    to_size: tuple[float, ...] = Field(default=(), description="m, as `size`")
    to_position: Vector = Field(default=(0.0, 0.0, 0.0), description="m, in the frame of `to`; a point of a plane")
    to_orientation: tuple[float, float, float, float] = Field(
        default=(1.0, 0.0, 0.0, 0.0), description="quaternion w, x, y, z; a plane's normal is its z axis"
    )
    friction: float = Field(default=0.0, ge=0.0, description="Coulomb's coefficient, sliding and sticking")
    rolling: float = Field(default=0.0, ge=0.0, description="m, largest moment of rolling resistance over normal force")
    restitution: float = Field(default=0.0, ge=0.0, le=1.0, description="speed after an impact over speed before it")
    friction_deviation: float = Field(
        default=0.0, ge=0.0, description="standard deviation of the friction, for the estimator"
    )
    restitution_deviation: float = Field(
        default=0.0, ge=0.0, le=1.0, description="standard deviation of the restitution, for the estimator"
    )
    impulse_deviation: float = Field(
        default=0.0,
        ge=0.0,
        description="standard deviation of an impact's impulse about what the law says, along the normal and each way across"
        " it, over the normal impulse, for the estimator",
    )
    quiet: float = Field(default=1e-2, ge=0.0, description="m/s; slower approach does not bounce")
    velocity: Vector = Field(
        default=(0.0, 0.0, 0.0), description="m/s, world axes, of the other surface's material (a treadmill's belt)"
    )

    def check(self, tree: Tree) -> None:
        if tree.frame(self.part).link == tree.frame(self.to).link:
            raise ModelError(f"'{self.part}' and '{self.to}' are one rigid body: they cannot come into contact")
        self.touching_pairs(tree)

    def explain(self, tree: Tree) -> str:
        pair = self.touching_pairs(tree)[0]
        rows = 1 + 2 * (self.friction > 0.0) + 2 * (self.rolling > 0.0)
        return (
            f"keeps {self.part} ({pair.b.kind}) out of {self.to} ({pair.a.kind}), friction {self.friction:g}: "
            f"{rows} row{'s' if rows > 1 else ''} a point that touches"
        )

    def reactions(self, tree: Tree) -> Sequence[str]:
        return [self.label]

    def footings(self, tree: Tree) -> Mapping[str, Footing]:
        if tree.frame(self.to).link >= 0:
            return {}
        return {self.label: Footing(self.touching_pairs(tree)[0].b, np.array(self.velocity))}

    def touching_pairs(self, tree: Tree) -> Sequence[TouchingPair]:
        b = _surface(tree, self.part, self.shape, self.size, self.position, self.orientation, "")
        to_shape: Kind | None = "plane" if self.to == "world" and self.to_shape is None else self.to_shape
        a = _surface(tree, self.to, to_shape, self.to_size, self.to_position, self.to_orientation, "to_")
        pair = TouchingPair(
            a=a,
            b=b,
            friction=self.friction,
            rolling=self.rolling,
            restitution=self.restitution,
            quiet=self.quiet,
            friction_deviation=self.friction_deviation,
            restitution_deviation=self.restitution_deviation,
            impulse_deviation=self.impulse_deviation,
            velocity=np.array(self.velocity),
        )
        return [pair]


def _surface(
    tree: Tree,
    part: str,
    kind: Kind | None,
    size: tuple[float, ...],
    position: Vector,
    orientation: tuple[float, float, float, float],
    prefix: str,
) -> Surface:
    """The surface that fields name, or that the part is drawn with; ModelError if there is none."""
    if kind is not None:
        if len(size) != SIZES[kind] or not all(0.0 < each < np.inf for each in size):
            raise ModelError(f"'{prefix}size' {list(size)} is not that of a {kind}: give {SIZES[kind]} numbers > 0, m")
        numbers = np.zeros(3)
        numbers[: len(size)] = size
        if kind == "box" or kind == "capsule":
            numbers *= np.array([0.5, 0.5, 0.5]) if kind == "box" else np.array([1.0, 0.5, 1.0])
        turn = rotations.normalize(np.array(orientation))
        return Surface(part, kind, numbers, np.array(position), turn)
    if size or any(position) or orientation != (1.0, 0.0, 0.0, 0.0):
        raise ModelError(f"'{prefix}shape' is missing: say what '{prefix}size', 'position' and 'orientation' belong to")
    drawn = next((each.shape for each in tree.parts if each.name == part), None)
    if drawn is None or drawn.kind == "cylinder":
        what = "no shape" if drawn is None else "a cylinder's shape"
        raise ModelError(f"'{part}' has {what}: give '{prefix}shape' sphere, capsule, box or ellipsoid, and its size")
    halves = 0.5 * np.asarray(drawn.size)
    if drawn.kind in ("sphere", "capsule"):
        halves = np.array([halves[0], halves[2] if drawn.kind == "capsule" else 0.0, 0.0])
    return Surface(part, drawn.kind, halves, np.asarray(drawn.position), np.asarray(drawn.orientation))
