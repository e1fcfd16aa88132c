"""Muscles: torques in joints that nothing tells, found by the estimator."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array, Records
from physics_prior.effects.effect import CompiledForce, Effect, inner_joint
from physics_prior.effects.unknown_force import UnknownForce
from physics_prior.errors import ModelError
from physics_prior.model import Tree

Strength = Annotated[float, Field(ge=0.0)]


@kernel
def apply_muscle(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Add the torques, parameters (nv,)."""
    for k in range(v.shape[0]):
        tau[k] += parameters[k]


@kernel
def differentiate_muscle(
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
    """Add nothing: the torques depend neither on q nor on v."""


class Muscle(Effect):
    """Unknown torques in joints: an Ornstein-Uhlenbeck process each, a state of the estimator; zero in a simulation."""

    kind: ClassVar[str] = "muscle"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(apply_muscle, differentiate_muscle)

    strength: dict[str, Strength | tuple[Strength, Strength, Strength]] = Field(
        min_length=1,
        description="joint name -> N m (revolute, spherical; of this also one for each axis) or N (prismatic):"
        " standard deviation in the long run; >= 0",
    )
    time_constant: float = Field(default=1.0, gt=0.0, description="s, over which torques are forgotten; > 0")

    def check(self, tree: Tree) -> None:
        for joint, strength in self.strength.items():
            if inner_joint(tree, joint, "muscle").joint.nv == 1 and isinstance(strength, tuple):
                raise ModelError(f"joint '{joint}' has one axis: give it one strength, not {list(strength)}")

    def explain(self, tree: Tree) -> str:
        count = sum(tree.link(joint).joint.nv for joint in self.strength)
        return f"{count} unknown torques in {len(self.strength)} joints, each a state of the estimator"

    def parameters(self, tree: Tree) -> np.ndarray:
        return np.zeros(tree.nv)

    def unknown_force(self, tree: Tree) -> UnknownForce:
        deviation = np.zeros(tree.nv)
        for joint, strength in self.strength.items():
            deviation[tree.link(joint).v] = strength
        moved = np.concatenate([np.arange(tree.nv)[tree.link(joint).v] for joint in self.strength])
        freedoms = np.sort(moved)
        return UnknownForce(freedoms, deviation[freedoms], self.time_constant, freedoms=freedoms)
