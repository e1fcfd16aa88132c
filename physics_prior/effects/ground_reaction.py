"""What the ground does to a foot: a wrench that nothing tells, found by the estimator while the foot stands."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from pydantic import Field

from physics_prior import rotations
from physics_prior.dynamics.algebra import get3
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.point_force import add_lever_change, push, world_point
from physics_prior.dynamics.types import Array, Records
from physics_prior.effects.effect import Anchor, CompiledForce, Effect
from physics_prior.effects.touching import Footing, Surface
from physics_prior.effects.unknown_force import Sole, UnknownForce
from physics_prior.errors import ModelError
from physics_prior.model import Tree

Vector = tuple[float, float, float]
FORCE = np.arange(4, 10)  # among the parameters: force, then moment, world axes


@kernel
def apply_ground_reaction(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Put the wrench on the sole; parameters: link, its middle (3), force (3), moment (3)."""
    link = int(parameters[0])
    p = world_point(work, link, get3(parameters[1:4]))
    push(work, link, p, (get3(parameters[7:10]), get3(parameters[4:7])))


@kernel
def differentiate_ground_reaction(
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
    """Add what moving does to the generalized forces of a wrench that stays as it is."""
    link = int(parameters[0])
    p = world_point(work, link, get3(parameters[1:4]))
    wrench = (get3(parameters[7:10]), get3(parameters[4:7]))
    add_lever_change(links, work, freedoms, link, p, wrench, tau_q)


class GroundReaction(Effect):
    """A foot on level ground: an unknown wrench while it stands, never pulling, within friction, its pressure in the sole.

    Force and moment are Ornstein-Uhlenbeck processes, states of the estimator, zero in a simulation. Their means are those of
    standing: the weight, shared by the feet that stand.
    """

    kind: ClassVar[str] = "ground_reaction"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(apply_ground_reaction, differentiate_ground_reaction)

    part: str = Field(description="the part with the sole; the published force acts on it")
    size: tuple[float, float] | None = Field(
        default=None, description="m, of the sole along the part's x and y; the underside of its box where left out"
    )
    position: Vector = Field(default=(0.0, 0.0, 0.0), description="m, of the middle of a sole whose `size` is given")
    vertical: float = Field(ge=0.0, description="N: standard deviation of the vertical force in the long run; >= 0")
    horizontal: float = Field(ge=0.0, description="N: that of the force along each horizontal axis; >= 0")
    moment: float = Field(ge=0.0, description="N m: that about the middle of the sole, each axis; >= 0")
    time_constant: float = Field(default=1.0, gt=0.0, description="s, over which forces are forgotten; > 0")
    friction: float = Field(default=1.0, gt=0.0, description="Coulomb's coefficient; > 0")
    height: float = Field(default=0.0, description="m, of the ground")
    velocity: Vector = Field(default=(0.0, 0.0, 0.0), description="m/s, world axes, of the ground (a treadmill's belt)")
    touch_height: float = Field(
        default=0.03, description="m: the sole's lowest corner stands if it is lower than this and slower than that"
    )
    touch_speed: float = Field(default=0.4, gt=0.0, description="m/s, of the lowest corner over the ground")
    release_height: float = Field(default=0.06, description="m: what is higher is off the ground")
    release_speed: float = Field(default=1.2, gt=0.0, description="m/s: what is faster is off the ground")
    release_force: float = Field(
        default=20.0, ge=0.0, description="N: what does not stand still is off the ground if it carries less"
    )

    def check(self, tree: Tree) -> None:
        if tree.frame(self.part).link < 0:
            raise ModelError(f"'{self.part}' does not move: the ground pushes moving parts")
        if self.label in [link.joint.name for link in tree.links]:
            raise ModelError(f"'{self.label}' is a joint's name: give this effect its own 'name'")
        for what, low, high in (
            ("height", self.touch_height, self.release_height),
            ("speed", self.touch_speed, self.release_speed),
        ):
            if low > high:
                raise ModelError(f"'touch_{what}' {low:g} is above 'release_{what}' {high:g}: it may not be")
        self.sole(tree)

    def explain(self, tree: Tree) -> str:
        length, width = 2.0 * self.sole(tree).half
        return f"unknown wrench on {self.part}, {length:.3g} m x {width:.3g} m, while it stands: six states of the estimator"

    def sole(self, tree: Tree) -> Sole:
        """The sole; ModelError if nothing says what it is."""
        if self.size is not None:
            center, edges = np.array(self.position), np.array(self.size)
        else:
            drawn = next((part.shape for part in tree.parts if part.name == self.part), None)
            if drawn is None or drawn.kind != "box":
                raise ModelError(
                    f"'{self.part}' has no box for a sole: give the 'size' of its sole, m, and its 'position'"
                )
            R = rotations.matrix_from_quaternion(np.asarray(drawn.orientation))
            if not np.allclose(R, np.eye(3)):
                raise ModelError(
                    f"the box of '{self.part}' is turned: give the 'size' of its sole, m, and its 'position'"
                )
            edges = np.asarray(drawn.size)
            center, edges = np.asarray(drawn.position) - [0.0, 0.0, 0.5 * edges[2]], edges[:2]
        if not np.all(edges > 0.0):
            raise ModelError(f"'size' {edges.tolist()} is not that of a sole: give two numbers > 0, m")
        return Sole(
            self.part,
            center,
            0.5 * edges,
            self.friction,
            self.height,
            np.array(self.velocity),
            (self.touch_height, self.touch_speed),
            (self.release_height, self.release_speed),
            self.release_force,
        )

    def parameters(self, tree: Tree) -> np.ndarray:
        link, point, _ = Anchor(self.part, self.sole(tree).center).on_link(tree)
        return np.array([link, *point, *np.zeros(6)])

    def unknown_force(self, tree: Tree) -> UnknownForce:
        deviation = np.array([self.horizontal, self.horizontal, self.vertical, *[self.moment] * 3])
        return UnknownForce(FORCE, deviation, self.time_constant, sole=self.sole(tree))

    def footings(self, tree: Tree) -> Mapping[str, Footing]:
        sole = self.sole(tree)
        surface = Surface(sole.part, "box", np.append(sole.half, 0.0), sole.center, np.array([1.0, 0.0, 0.0, 0.0]))
        return {self.label: Footing(surface, sole.velocity)}

    def reactions(self, tree: Tree) -> Sequence[str]:
        return [self.label]
