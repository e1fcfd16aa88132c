"""A spring and damper between two points."""

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from physics_prior.dynamics.algebra import IDENTITY, ZERO, dot, get3, minus, minus_outer, plus, scale, scale9
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.point_force import differentiate_point_force, push, world_point, world_velocity
from physics_prior.dynamics.types import Array, Matrix, Records, Vector
from physics_prior.effects.effect import CompiledForce
from physics_prior.effects.switchable import Switchable
from physics_prior.effects.two_points import TwoPoints
from physics_prior.model import Tree

SOFTENING = 1e-9  # m: the length is sqrt(|b - a|^2 + SOFTENING^2), so that no direction is lost where the points meet


@inline_kernel
def ends(parameters: Array, work: Records) -> tuple[int, Vector, int, Vector]:
    """The links and world points a and b of a spring."""
    link_a, link_b = int(parameters[0]), int(parameters[4])
    return (
        link_a,
        world_point(work, link_a, get3(parameters[1:4])),
        link_b,
        world_point(work, link_b, get3(parameters[5:8])),
    )


@inline_kernel
def stretched(parameters: Array, gap: Vector, rate: Vector) -> tuple[float, Vector, float, float]:
    """Length, direction, tension over length and lengthening speed of a spring whose ends are a gap b - a apart."""
    length = math.sqrt(dot(gap, gap) + SOFTENING * SOFTENING)
    along = scale(1.0 / length, gap)
    speed = dot(along, rate)
    return length, along, parameters[8] * (1.0 - parameters[9] / length), speed


@kernel
def apply_spring(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Pull the ends together by k (l - l0) + c ldot; parameters: link and point of a, of b, k, l0, c."""
    link_a, a, link_b, b = ends(parameters, work)
    gap, rate = minus(b, a), minus(world_velocity(work, link_b, b), world_velocity(work, link_a, a))
    _, along, stiffness, speed = stretched(parameters, gap, rate)
    pull = plus(scale(stiffness, gap), scale(parameters[10] * speed, along))
    push(work, link_a, a, (ZERO, pull))
    push(work, link_b, b, (ZERO, scale(-1.0, pull)))


@kernel
def differentiate_spring(
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
    """Add the derivatives of the spring's generalized forces; those of its direction e by the gap are (1 - e e^T)/l."""
    link_a, a, link_b, b = ends(parameters, work)
    gap, rate = minus(b, a), minus(world_velocity(work, link_b, b), world_velocity(work, link_a, a))
    length, along, stiffness, speed = stretched(parameters, gap, rate)
    damping = parameters[10]
    force = scale(-1.0, plus(scale(stiffness, gap), scale(damping * speed, along)))
    across = minus(rate, scale(speed, along))
    by_gap = _diagonal(-stiffness - damping * speed / length)
    by_gap = minus_outer(by_gap, scale(parameters[8] * parameters[9] / length - damping * speed / length, along), along)
    by_gap = minus_outer(by_gap, scale(damping / length, along), across)
    by_rate = minus_outer(_diagonal(0.0), scale(damping, along), along)
    differentiate_point_force(
        links, work, freedoms, composites, link_a, a, link_b, b, force, by_gap, by_rate, tau_q, tau_v
    )


@kernel
def spring_energy(parameters: Array, links: Records, work: Records, q: Array) -> float:
    """1/2 k (l - l0)^2."""
    _, a, _, b = ends(parameters, work)
    length, _, _, _ = stretched(parameters, minus(b, a), ZERO)
    stretch = length - parameters[9]
    energy: float = 0.5 * parameters[8] * stretch * stretch
    return energy


@inline_kernel
def _diagonal(s: float) -> Matrix:
    """The matrix s times one."""
    return scale9(s, IDENTITY)


class Spring(Switchable, TwoPoints):
    """A massless spring, and a damper along it, between a point of a part and a point of another part or of the world.

    With a rest length of zero it pulls with -k (b - a) in all directions. Its length is softened by 1e-9 m, below rounding
    for any spring longer than 0.1 m, so that a spring with a rest length has no force, and not NaN, where its ends meet.
    """

    kind: ClassVar[str] = "spring"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(apply_spring, differentiate_spring, spring_energy)
    strengths: ClassVar[tuple[str, ...]] = ("stiffness", "damping")

    stiffness: float = Field(ge=0.0, description="N/m; >= 0")
    rest_length: float = Field(default=0.0, ge=0.0, description="m, length at which it does not pull")
    damping: float = Field(default=0.0, ge=0.0, description="N s/m, against lengthening and shortening; >= 0")

    def explain(self, tree: Tree) -> str:
        damped = f", {self.damping:.4g} N s/m" if self.damping else ""
        return f"pulls {self.part} to {self.to}: {self.stiffness:.4g} N/m from {self.rest_length:.4g} m{damped}{self._spans()}"

    def parameters(self, tree: Tree) -> np.ndarray:
        a, b = (anchor.on_link(tree) for anchor in self.anchors())
        return np.array([a[0], *a[1], b[0], *b[1], self.stiffness, self.rest_length, self.damping])
