"""Drag of a medium that a part moves through."""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from physics_prior.dynamics.algebra import IDENTITY, dot, get3, minus, minus_outer, scale, scale9, times
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.point_force import (
    add_lever_change,
    add_wrench_column,
    end_of_freedoms,
    point_motion,
    push,
    world_point,
    world_velocity,
)
from physics_prior.dynamics.types import Array, Records, Spatial, Vector
from physics_prior.effects.effect import Anchor, CompiledForce, PointNoise
from physics_prior.effects.switchable import Switchable
from physics_prior.effects.two_points import Vector as Point
from physics_prior.errors import ModelError
from physics_prior.model import Tree


@inline_kernel
def resistance(parameters: Array, work: Records) -> tuple[Vector, Vector, float, Spatial]:
    """Where drag acts, the velocity u against the medium there, |u| and the wrench; parameters as ``apply_drag`` says."""
    link = int(parameters[0])
    p = world_point(work, link, get3(parameters[1:4]))
    against = minus(world_velocity(work, link, p), get3(parameters[7:10]))
    speed = math.sqrt(dot(against, against))
    moment = scale(-parameters[6], get3(work[link].omega))
    return p, against, speed, (moment, scale(-parameters[4] - parameters[5] * speed, against))


@kernel
def apply_drag(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Push with -(c1 + c2 |u|) u and the moment -c w; parameters: link, point, c1, c2, c, wind."""
    p, _, _, wrench = resistance(parameters, work)
    push(work, int(parameters[0]), p, wrench)


@kernel
def differentiate_drag(
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
    """Add the derivatives of that: by the velocity u, -(c1 + c2 |u|) 1 - c2 u u^T / |u|, which is -c1 1 at rest."""
    link, angular = int(parameters[0]), -parameters[6]
    p, against, speed, wrench = resistance(parameters, work)
    by_velocity = scale9(-parameters[4] - parameters[5] * speed, IDENTITY)
    if speed > 0.0:
        by_velocity = minus_outer(by_velocity, scale(parameters[5] / speed, against), against)
    add_lever_change(links, work, freedoms, link, p, wrench, tau_q)
    i = link
    while i >= 0:
        for n in range(links[i].v, end_of_freedoms(links, i, freedoms.shape[0])):
            by_v, by_q = point_motion(work, freedoms[n], composites[link], p)
            change_q = (scale(angular, by_q[0]), times(by_velocity, by_q[1]))
            change_v = (scale(angular, by_v[0]), times(by_velocity, by_v[1]))
            add_wrench_column(links, work, freedoms, link, p, change_q, n, tau_q)
            add_wrench_column(links, work, freedoms, link, p, change_v, n, tau_v)
        i = links[i].parent


class Drag(Switchable):
    """Resistance of a medium to the motion of a point of a part, and to the part's turning."""

    kind: ClassVar[str] = "drag"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(apply_drag, differentiate_drag)
    strengths: ClassVar[tuple[str, ...]] = ("linear", "quadratic", "angular")

    part: str = Field(description="the part that moves through the medium")
    point: Point = Field(default=(0.0, 0.0, 0.0), description="m, in the frame of `part`: where the force acts")
    linear: float = Field(default=0.0, ge=0.0, description="N s/m: force per speed; >= 0")
    quadratic: float = Field(
        default=0.0, ge=0.0, description="N s^2/m^2: force per square of speed, 1/2 density drag coefficient area; >= 0"
    )
    angular: float = Field(default=0.0, ge=0.0, description="N m s/rad: moment per angular speed; >= 0")
    wind: Point = Field(default=(0.0, 0.0, 0.0), description="m/s, velocity of the medium, world axes")
    gusts: Point = Field(
        default=(0.0, 0.0, 0.0), description="N sqrt(s): roots of the spectral densities of a white force, world axes"
    )

    def check(self, tree: Tree) -> None:
        if tree.frame(self.part).link < 0:
            raise ModelError(f"'{self.part}' does not move: drag acts on a part that does")
        if not (self.linear or self.quadratic or self.angular):
            raise ModelError("drag without a coefficient does nothing: give 'linear', 'quadratic' or 'angular'")

    def explain(self, tree: Tree) -> str:
        terms = [
            f"{value:.4g} {unit}"
            for value, unit in ((self.linear, "N s/m"), (self.quadratic, "N s^2/m^2"), (self.angular, "N m s/rad"))
            if value
        ]
        wind = f" in wind{' and gusts' * any(self.gusts)}" if any(self.wind) else " in gusts" * any(self.gusts)
        return f"resists the motion of {self.part}{wind}: {', '.join(terms)}{self._spans()}"

    def parameters(self, tree: Tree) -> np.ndarray:
        link, point, _ = Anchor(self.part, np.array(self.point)).on_link(tree)
        return np.array([link, *point, self.linear, self.quadratic, self.angular, *self.wind])

    def noise(self, tree: Tree) -> Sequence[PointNoise]:
        return [PointNoise(Anchor(self.part, np.array(self.point)), np.array(self.gusts))] if any(self.gusts) else []
