"""Soft ends of a joint's range: a one-sided spring and damper over the last stretch before a stop."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Record, Records
from physics_prior.effects.effect import CompiledForce
from physics_prior.effects.switchable import Switchable
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Tree

NUMBERS = 6  # of each end: link, sign (+1 lower, -1 upper), end, range, stiffness, damping


@inline_kernel
def depth(link: Record, end: Array, q: Array) -> float:
    """How far a joint is inside its soft range, rad or m; negative before it."""
    return float(end[3] - end[1] * (q[link.q] - end[2]))


@inline_kernel
def push_back(end: Array, d: float, rate: float) -> tuple[float, float, float]:
    """Force away from an end at depth d >= 0 that grows at a rate, and its derivatives by depth and rate.

    The spring has the stiffness k d / range up to the end and k beyond: k d^2 / (2 range), then k (d - range / 2). The damper
    comes in with the smooth share x^2 (3 - 2 x) of x = d / range, and holds nothing back: force is never negative.
    """
    reach, k = end[3], end[4]
    x = min(d / reach, 1.0)
    share = x * x * (3.0 - 2.0 * x)
    force = k * (x * d - 0.5 * x * x * reach) + end[5] * share * rate
    if force <= 0.0:
        return 0.0, 0.0, 0.0
    return force, k * x + end[5] * rate * 6.0 * x * (1.0 - x) / reach, end[5] * share


@kernel
def apply_soft_limit(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Add what pushes joints away from the ends of their ranges."""
    for s in range(0, parameters.shape[0], NUMBERS):
        end = parameters[s : s + NUMBERS]
        link = links[int(end[0])]
        d = depth(link, end, q)
        if d > 0.0:
            tau[link.v] += end[1] * push_back(end, d, -end[1] * v[link.v])[0]


@kernel
def differentiate_soft_limit(
    parameters: Array,
    links: Records,
    work: Records,
    freedoms: Records,
    composites: Records,
    q: Array,
    v: Array,
    tau_q: Array,
    tau_v: Array,
) -> None:
    """Subtract the derivatives by depth and rate: both signs, of depth and of force, are the same."""
    for s in range(0, parameters.shape[0], NUMBERS):
        end = parameters[s : s + NUMBERS]
        link = links[int(end[0])]
        d = depth(link, end, q)
        if d > 0.0:
            n = link.v
            _, by_depth, by_rate = push_back(end, d, -end[1] * v[n])
            tau_q[n, n] -= by_depth
            tau_v[n, n] -= by_rate


@kernel
def soft_limit_energy(parameters: Array, links: Records, work: Records, q: Array) -> float:
    """Sum of k d^3 / (6 range), and beyond an end of k (d^2 / 2 - d range / 2 + range^2 / 6)."""
    total = 0.0
    for s in range(0, parameters.shape[0], NUMBERS):
        end = parameters[s : s + NUMBERS]
        d, reach = depth(links[int(end[0])], end, q), end[3]
        if d > reach:
            total += end[4] * (0.5 * d * (d - reach) + reach * reach / 6.0)
        elif d > 0.0:
            total += end[4] * d * d * d / (6.0 * reach)
    return total


class SoftLimit(Switchable):
    """Soft stops: within `range` of an end a spring that stiffens evenly, and a damper; never pulls, and stops nothing hard.

    Together with `joint_limit` of the same ends, what is too fast for the spring meets a hard stop there.
    """

    kind: ClassVar[str] = "soft_limit"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(
        apply_soft_limit, differentiate_soft_limit, soft_limit_energy
    )
    strengths: ClassVar[tuple[str, ...]] = ("stiffness", "damping")

    lower: dict[str, float] = Field(default={}, description="joint name -> rad (revolute) or m (prismatic)")
    upper: dict[str, float] = Field(default={}, description="joint name -> rad (revolute) or m (prismatic)")
    range: dict[str, Annotated[float, Field(gt=0.0)]] = Field(
        description="joint name -> rad (revolute) or m (prismatic), before an end, over which it becomes stiff; > 0"
    )
    stiffness: dict[str, Annotated[float, Field(ge=0.0)]] = Field(
        description="joint name -> N m/rad (revolute) or N/m (prismatic), at an end; >= 0"
    )
    damping: dict[str, Annotated[float, Field(ge=0.0)]] = Field(
        default={}, description="joint name -> N m s/rad (revolute) or N s/m (prismatic), at an end; >= 0"
    )

    def check(self, tree: Tree) -> None:
        if not self.lower and not self.upper:
            raise ModelError("limits no joint: give 'lower' or 'upper', for example 'upper: {knee: 120 deg}'")
        limited = {*self.lower, *self.upper}
        for joint in [*self.lower, *self.upper, *self.range, *self.stiffness, *self.damping]:
            if tree.link(joint).joint.kind not in (JointKind.REVOLUTE, JointKind.PRISMATIC):
                raise ModelError(f"joint '{joint}' has no one coordinate: limits are for revolute and prismatic joints")
            if joint not in limited:
                raise ModelError(f"joint '{joint}' has no end: give it a 'lower' or an 'upper' one, or leave it out")
            for field in ("range", "stiffness"):
                if joint not in getattr(self, field):
                    raise ModelError(f"joint '{joint}' has no {field}: give one to each joint that is limited")
        for joint in self.lower.keys() & self.upper.keys():
            if not self.lower[joint] < self.upper[joint]:
                raise ModelError(
                    f"lower limit {self.lower[joint]:g} of '{joint}' is not below its upper one, {self.upper[joint]:g}"
                )

    def explain(self, tree: Tree) -> str:
        ends = [f"{joint} >= {end:.4g} over {self.range[joint]:.3g}" for joint, end in self.lower.items()]
        ends += [f"{joint} <= {end:.4g} over {self.range[joint]:.3g}" for joint, end in self.upper.items()]
        return (
            f"pushes joints back, ever more stiffly, before the ends of their range: {', '.join(ends)}{self._spans()}"
        )

    def parameters(self, tree: Tree) -> np.ndarray:
        index = {link.joint.name: i for i, link in enumerate(tree.links)}
        return np.array(
            [
                (index[joint], sign, end, self.range[joint], self.stiffness[joint], self.damping.get(joint, 0.0))
                for sign, ends in ((1.0, self.lower), (-1.0, self.upper))
                for joint, end in ends.items()
            ]
        ).ravel()
