"""What attachments, rods and springs have in common: a point of a part, and what it is joined to."""

import numpy as np
from pydantic import Field

from physics_prior.effects.effect import Anchor, Effect
from physics_prior.errors import ModelError
from physics_prior.model import Tree

Vector = tuple[float, float, float]


class TwoPoints(Effect):
    """Base of all effects that join a point of a part to a point of another part, or of the world."""

    part: str = Field(description="the part that is held; the published force acts on it")
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="m, in the frame of `part`")
    to: str = Field(default="world", description="what holds it: another part or 'world'")
    at: Vector = Field(default=(0.0, 0.0, 0.0), description="m, in the frame of `to`")

    def check(self, tree: Tree) -> None:
        if tree.frame(self.part).link == tree.frame(self.to).link:
            raise ModelError(
                f"'{self.part}' and '{self.to}' are one rigid body: hold a part by another that can move away"
            )

    def anchors(self) -> tuple[Anchor, Anchor]:
        """The holding point a and the held point b."""
        return Anchor(self.to, np.array(self.at)), Anchor(self.part, np.array(self.point))
