"""Viscous friction in joints."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array, Records
from physics_prior.effects.effect import CompiledForce, inner_joint
from physics_prior.effects.switchable import Switchable
from physics_prior.model import Tree


@kernel
def apply_joint_damping(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Add tau_k = -d_k v_k; parameters (nv,) are the coefficients d."""
    for k in range(v.shape[0]):
        tau[k] -= parameters[k] * v[k]


@kernel
def differentiate_joint_damping(
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
    """Add d tau_k / d v_k = -d_k."""
    for k in range(v.shape[0]):
        tau_v[k, k] -= parameters[k]


class JointDamping(Switchable):
    """Viscous friction: each named joint resists its own velocity in proportion."""

    kind: ClassVar[str] = "joint_damping"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(apply_joint_damping, differentiate_joint_damping)
    strengths: ClassVar[tuple[str, ...]] = ("coefficients",)

    coefficients: dict[str, Annotated[float, Field(ge=0.0)]] = Field(
        min_length=1, description="joint name -> N m s/rad (revolute, spherical) or N s/m (prismatic); >= 0"
    )

    def check(self, tree: Tree) -> None:
        for joint in self.coefficients:
            inner_joint(tree, joint, "joint damping")

    def explain(self, tree: Tree) -> str:
        coefficients = ", ".join(f"{j} {c:.3g}" for j, c in self.coefficients.items())
        return f"joints resist their velocity: {coefficients}{self._spans()}"

    def parameters(self, tree: Tree) -> np.ndarray:
        out = np.zeros(tree.nv)
        for joint, coefficient in self.coefficients.items():
            out[tree.link(joint).v] = coefficient
        return out
