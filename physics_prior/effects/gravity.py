"""Gravity: a uniform acceleration that all mass feels."""

from typing import ClassVar

import numpy as np
from pydantic import Field

from physics_prior.effects.switchable import Switchable
from physics_prior.model import Tree


class Gravity(Switchable):
    """Uniform gravity. It enters the dynamics as an upward acceleration of the world (Featherstone 2008, ch. 5.3)."""

    kind: ClassVar[str] = "gravity"

    acceleration: tuple[float, float, float] = Field(
        default=(0.0, 0.0, -9.80665), description="m/s^2, world axes; standard gravity where left out"
    )

    def explain(self, tree: Tree) -> str:
        x, y, z = self.acceleration
        return f"all {tree.mass:.4g} kg feel ({x:g}, {y:g}, {z:g}) m/s^2{self._spans()}"

    def field(self) -> np.ndarray:
        return np.array(self.acceleration)
