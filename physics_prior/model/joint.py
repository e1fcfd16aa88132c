"""Joints: how a part may move relative to its parent."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from physics_prior import rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import LARGEST_NUMBER


class JointKind(IntEnum):
    """The kinds of joints, with the numbers the compiled kernels know them by."""

    FIXED = 0
    REVOLUTE = 1
    PRISMATIC = 2
    SPHERICAL = 3
    FREE = 4


COORDINATES = {
    JointKind.FIXED: 0,
    JointKind.REVOLUTE: 1,
    JointKind.PRISMATIC: 1,
    JointKind.SPHERICAL: 4,
    JointKind.FREE: 7,
}
FREEDOMS = {
    JointKind.FIXED: 0,
    JointKind.REVOLUTE: 1,
    JointKind.PRISMATIC: 1,
    JointKind.SPHERICAL: 3,
    JointKind.FREE: 6,
}


@dataclass(frozen=True)
class Joint:
    """A joint that carries the part ``child`` on the part ``parent``.

    At zero coordinate the child frame stands at ``position`` with ``orientation`` in the parent frame. A revolute
    joint turns the child about ``axis`` by q [rad]; a prismatic one shifts it along ``axis`` by q [m]; a spherical one
    turns it by the quaternion q (child to its zero orientation), velocity = relative angular velocity in the CHILD
    frame; a free one has q = (position, quaternion) in the world and velocity = (linear velocity of the child origin in
    the WORLD frame, angular velocity in the CHILD frame).

    Attributes:
        name: unique in the tree.
        kind: what motion it allows.
        parent: name of the parent part, or ``world``.
        child: name of the part it carries.
        position: (3,) m, child origin in the parent frame at zero.
        orientation: (4,) quaternion, child axes to parent frame at zero.
        axis: (3,) unit vector in the child frame; of use to revolute and prismatic joints only.
        range: lower and upper end, rad or m, that such a joint is known to have, for those who draw or export it. It stops
            nothing: effects do.

    Raises:
        ModelError: a zero or non-finite axis, quaternion or position; a free joint that is not on the world or is given a
            position or orientation, which its q holds.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    orientation: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        position = np.asarray(self.position, dtype=float)
        axis = np.asarray(self.axis, dtype=float)
        if position.shape != (3,) or not np.all(np.abs(position) <= LARGEST_NUMBER):
            raise ModelError(
                f"joint '{self.name}': position {self.position} is not valid: give three finite numbers up to 1e60 [m]"
            )
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(axis)) if axis.shape == (3,) else 0.0
        if not np.isfinite(length) or length < 1e-9:
            raise ModelError(
                f"joint '{self.name}': axis {self.axis} is not valid: give three finite numbers, not all zero"
            )
        if self.kind is JointKind.FREE and self.parent != "world":
            raise ModelError(f"joint '{self.name}': a free joint stands on 'world', not on '{self.parent}'")
        orientation = rotations.normalize(np.asarray(self.orientation, dtype=float))
        if self.kind is JointKind.FREE and (position.any() or abs(orientation[0]) < 1.0):
            raise ModelError(
                f"joint '{self.name}': a free joint has no position or orientation of its own: q is its pose"
            )
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "axis", axis / length)
        object.__setattr__(self, "orientation", orientation)

    @property
    def nq(self) -> int:
        """Number of coordinates in q."""
        return COORDINATES[self.kind]

    @property
    def nv(self) -> int:
        """Number of degrees of freedom, the joint's share of v."""
        return FREEDOMS[self.kind]
