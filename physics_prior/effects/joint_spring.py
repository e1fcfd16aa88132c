"""Springs, and dampers with them, in joints."""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from physics_prior import rotations
from physics_prior.dynamics.algebra import dot
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.rotation_vector import inverse_right_jacobian, logarithm
from physics_prior.dynamics.types import Array, Record, Records, Vector
from physics_prior.effects.effect import CompiledForce, inner_joint
from physics_prior.effects.switchable import Switchable
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Link, Tree

SPHERICAL = int(JointKind.SPHERICAL)
NUMBERS = 7  # of each spring: link, stiffness, damping, and the rest: a coordinate or a quaternion

Quaternion = tuple[float, float, float, float]
Coefficients = dict[str, Annotated[float, Field(ge=0.0)]]


@inline_kernel
def deviation(link: Record, spring: Array, q: Array) -> Vector:
    """How far a joint is from its rest: log(rest^-1 q) of a ball joint; q - rest, and zeros, of any other."""
    k = link.q
    if link.kind != SPHERICAL:
        return q[k] - spring[3], 0.0, 0.0
    a, b, c, d = spring[3], -spring[4], -spring[5], -spring[6]
    w, x, y, z = q[k], q[k + 1], q[k + 2], q[k + 3]
    return logarithm(
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


@kernel
def apply_joint_spring(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Add -k deviation - c v.

    The torque of a ball joint stands in the turned axes and is still the gradient of 1/2 k |phi|^2, phi the rotation vector:
    J_r^-T phi = phi.
    """
    for s in range(0, parameters.shape[0], NUMBERS):
        spring = parameters[s : s + NUMBERS]
        link = links[int(spring[0])]
        away, n = deviation(link, spring, q), link.v
        for c in range(3 if link.kind == SPHERICAL else 1):
            tau[n + c] -= spring[1] * away[c] + spring[2] * v[n + c]


@kernel
def differentiate_joint_spring(
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
    """Add -k, of a ball joint -k J_r^-1(phi), and -c."""
    for s in range(0, parameters.shape[0], NUMBERS):
        spring = parameters[s : s + NUMBERS]
        link = links[int(spring[0])]
        n, count = link.v, 3 if link.kind == SPHERICAL else 1
        by_q = inverse_right_jacobian(deviation(link, spring, q) if count == 3 else (0.0, 0.0, 0.0))
        for r in range(count):
            for c in range(count):
                tau_q[n + r, n + c] -= spring[1] * by_q[3 * r + c]
            tau_v[n + r, n + r] -= spring[2]


@kernel
def joint_spring_energy(parameters: Array, links: Records, work: Records, q: Array) -> float:
    """Sum of 1/2 k |deviation|^2."""
    total = 0.0
    for s in range(0, parameters.shape[0], NUMBERS):
        spring = parameters[s : s + NUMBERS]
        away = deviation(links[int(spring[0])], spring, q)
        total += 0.5 * spring[1] * dot(away, away)
    return total


class JointSpring(Switchable):
    """Springs in named joints, linear in the coordinate; of a ball joint, in the rotation vector from its rest.

    That vector is at most half a turn long and flips there: a ball joint that may swing so far is pulled back the other way.
    """

    kind: ClassVar[str] = "joint_spring"
    compiled: ClassVar[CompiledForce | None] = CompiledForce(
        apply_joint_spring, differentiate_joint_spring, joint_spring_energy
    )
    strengths: ClassVar[tuple[str, ...]] = ("stiffness", "damping")

    stiffness: Coefficients = Field(
        min_length=1, description="joint name -> N m/rad (revolute, spherical) or N/m (prismatic); >= 0"
    )
    rest: dict[str, float | Quaternion] = Field(
        default={}, description="joint name -> rad (revolute) or m (prismatic); spherical: quaternion w, x, y, z"
    )
    damping: Coefficients = Field(
        default={}, description="joint name -> N m s/rad (revolute, spherical) or N s/m (prismatic); >= 0"
    )

    def check(self, tree: Tree) -> None:
        for joint in [*self.stiffness, *self.rest, *self.damping]:
            inner_joint(tree, joint, "a joint spring")
            if joint not in self.stiffness:
                raise ModelError(f"joint '{joint}' has no stiffness: 'rest' and 'damping' are for joints named there")
        for joint in self.stiffness:
            self._rest(tree.link(joint))

    def explain(self, tree: Tree) -> str:
        terms = []
        for joint, stiffness in self.stiffness.items():
            slides = tree.link(joint).joint.kind is JointKind.PRISMATIC
            damping = self.damping.get(joint, 0.0)
            damped = f" with {damping:.3g} {'N s/m' if slides else 'N m s/rad'}" if damping else ""
            terms.append(f"{joint} {stiffness:.3g} {'N/m' if slides else 'N m/rad'}{damped}")
        return f"pulls joints to rest: {', '.join(terms)}{self._spans()}"

    def parameters(self, tree: Tree) -> np.ndarray:
        index = {link.joint.name: i for i, link in enumerate(tree.links)}
        out = np.zeros((len(self.stiffness), NUMBERS))
        for row, (joint, stiffness) in zip(out, self.stiffness.items(), strict=True):
            rest = self._rest(tree.link(joint))
            row[:3] = index[joint], stiffness, self.damping.get(joint, 0.0)
            row[3 : 3 + len(rest)] = rest
        return out.ravel()

    def _rest(self, link: Link) -> np.ndarray:
        """(1,) coordinate or (4,) unit quaternion at which a joint's spring is at rest."""
        joint, ball = link.joint.name, link.joint.kind is JointKind.SPHERICAL
        rest = np.atleast_1d(self.rest.get(joint, (1.0, 0.0, 0.0, 0.0) if ball else 0.0))
        if len(rest) != (4 if ball else 1):
            wanted = "a quaternion [w, x, y, z]" if ball else "one number"
            raise ModelError(f"joint '{joint}' is {link.joint.kind.name.lower()}: its rest is {wanted}")
        return rotations.normalize(rest) if ball else rest
