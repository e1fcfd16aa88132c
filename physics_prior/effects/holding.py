"""Effects that hold: for ever or for a time, where they are told or where the part is, still or moving."""

from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, field_validator

from physics_prior.effects.anchor_motion import AnchorMotion
from physics_prior.effects.effect import Anchor
from physics_prior.effects.switchable import Switchable, as_tuple
from physics_prior.effects.two_points import TwoPoints, Vector
from physics_prior.errors import ModelError
from physics_prior.model import Tree

HERE = "here"


class Holding(Switchable, TwoPoints):
    """Base of all effects that hold a point: how what holds it moves."""

    words: ClassVar[frozenset[str]] = frozenset({HERE})
    catches: ClassVar[bool] = False
    """Whether it may take hold wherever its part is."""

    at: Vector | None = Field(  # type: ignore[assignment]  # what only pushes has a place where it does
        default=(0.0, 0.0, 0.0),
        description="m, in the frame of `to`; 'here' (None) is where the point is on taking hold",
    )
    motion: AnchorMotion | None = Field(default=None, description="how the anchor is displaced from `at`")

    @field_validator("at", mode="before")
    @classmethod
    def _read_at(cls, value: Any) -> Any:
        if value is None or (isinstance(value, str) and value != HERE):
            raise ValueError(f"{value!r} is not valid: give three numbers or '{HERE}'")
        here = isinstance(value, str)
        if here and not cls.catches:
            raise ValueError(f"'{HERE}' is not valid: a {cls.kind} cannot take hold wherever it is, give three numbers")
        return None if here else as_tuple(value)

    @property
    def comes_and_goes(self) -> bool:
        return True

    def check(self, tree: Tree) -> None:
        super().check(tree)
        if self.motion is not None and tree.frame(self.to).link >= 0:
            raise ModelError(
                f"'{self.to}' moves by itself: an anchor with a motion is on the world or on what is fixed to it"
            )

    def anchors(self) -> tuple[Anchor, Anchor]:
        return Anchor(self.to, np.array(self.at or (0.0, 0.0, 0.0))), Anchor(self.part, np.array(self.point))

    def caught(self, position: np.ndarray, orientation: np.ndarray) -> Self:
        """The same, with the anchor where the part is: its point (3,), m, and axes, a quaternion (4,), in the frame of `to`."""
        return self.model_copy(update={"at": tuple(position.tolist())})
