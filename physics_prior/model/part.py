"""A part: one rigid body of the model, described in its own frame."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties

MASSLESS = MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class Shape:
    """What a part looks like in a marker display; it has no influence on the motion.

    Attributes:
        kind: ``box`` (size = edge lengths), ``sphere`` (size = 3 equal diameters), ``ellipsoid`` (3 diameters),
            ``cylinder`` (size = diameter, diameter, length along z) or ``capsule`` (the same, without its caps).
        size: (3,) m.
        position: (3,) centre of the shape in the part frame, m.
        orientation: (4,) quaternion, shape axes to part frame.
    """

    kind: Literal["box", "sphere", "ellipsoid", "cylinder", "capsule"]
    size: np.ndarray
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    orientation: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class Part:
    """A rigid body. Its frame has its origin at the joint that carries the part (the URDF link frame).

    Attributes:
        name: unique in the tree; ``world`` is taken by the ground.
        mass_properties: mass, centre of mass and inertia in the part frame; a massless part may connect joints.
        shape: what to draw, or None.
    """

    name: str
    mass_properties: MassProperties = MASSLESS
    shape: Shape | None = None

    def __post_init__(self) -> None:
        if not self.name or self.name == "world":
            raise ModelError(f"part name {self.name!r} is not valid: use a non-empty name other than 'world'")
