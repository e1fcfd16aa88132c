"""Ends of a joint's range: a stop that it may hit, rest against and leave."""

import math
from collections.abc import Sequence
from typing import ClassVar

from pydantic import Field

from physics_prior.effects.effect import Effect
from physics_prior.effects.touching import JointRange
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Tree


class JointLimit(Effect):
    """Hard stops at the ends of joints' ranges: inequality rows 0 <= q - lower and 0 <= upper - q (design eq. 8)."""

    kind: ClassVar[str] = "joint_limit"
    strengths: ClassVar[tuple[str, ...]] = ("restitution",)

    lower: dict[str, float] = Field(default={}, description="joint name -> rad (revolute) or m (prismatic)")
    upper: dict[str, float] = Field(default={}, description="joint name -> rad (revolute) or m (prismatic)")
    restitution: float = Field(default=0.0, ge=0.0, le=1.0, description="speed after an impact over speed before it")
    restitution_deviation: float = Field(
        default=0.0, ge=0.0, le=1.0, description="standard deviation of the restitution, for the estimator"
    )
    quiet: float = Field(
        default=1e-2, ge=0.0, description="rad/s (revolute) or m/s (prismatic); slower approach does not bounce"
    )

    def check(self, tree: Tree) -> None:
        if not self.lower and not self.upper:
            raise ModelError("limits no joint: give 'lower' or 'upper', for example 'upper: {knee: 120 deg}'")
        for joint in self._joints():
            if tree.link(joint).joint.kind not in (JointKind.REVOLUTE, JointKind.PRISMATIC):
                raise ModelError(f"joint '{joint}' has no one coordinate: limits are for revolute and prismatic joints")
        for joint, lower in self.lower.items():
            upper = self.upper.get(joint, math.inf)
            if not lower < upper:
                raise ModelError(f"lower limit {lower:g} of '{joint}' is not below its upper one, {upper:g}")

    def explain(self, tree: Tree) -> str:
        ends = [f"{joint} >= {end:.4g}" for joint, end in self.lower.items()]
        ends += [f"{joint} <= {end:.4g}" for joint, end in self.upper.items()]
        return f"stops joints at the ends of their range ({', '.join(ends)}): 1 row each while it is there"

    def reactions(self, tree: Tree) -> Sequence[str]:
        joints = self._joints()
        return [self.label] if len(joints) == 1 else [f"{self.label}.{joint}" for joint in joints]

    def joint_ranges(self, tree: Tree) -> Sequence[JointRange]:
        return [
            JointRange(
                joint,
                self.lower.get(joint, -math.inf),
                self.upper.get(joint, math.inf),
                self.restitution,
                self.restitution_deviation,
                self.quiet,
            )
            for joint in self._joints()
        ]

    def _joints(self) -> list[str]:
        return list(dict.fromkeys([*self.lower, *self.upper]))
