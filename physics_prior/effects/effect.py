"""The contract of an effect: something that acts on the body, compiled into the step only where a scene names it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from physics_prior import rotations
from physics_prior.effects.anchor_motion import AnchorMotion
from physics_prior.effects.touching import Footing, JointRange, TouchingPair
from physics_prior.effects.unknown_force import UnknownForce
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Link, Tree


@dataclass(frozen=True)
class Anchor:
    """A point fixed on a part (or on ``world``): the part's name and the point in the part's frame, m."""

    part: str
    point: np.ndarray

    def on_link(self, tree: Tree) -> tuple[int, np.ndarray, np.ndarray]:
        """Index of the part's link (-1: the world), the point (3,) in the link's frame, m, and the rotation part to link."""
        frame = tree.frame(self.part)
        R = rotations.matrix_from_quaternion(frame.orientation)
        return frame.link, frame.position + R @ self.point, R


@dataclass(frozen=True)
class PointPair:
    """Equality rows d . (b - a) = 0 for a point pair: every equality constraint is made of these.

    Three independent directions pin b to a. Directions are fixed on a's part, so that a second pair some way along an axis
    with the two directions across it makes a hinge, and a third with one direction makes a weld. With ``length`` set the
    pair is a rod: one row, |b - a| = length, and its direction is that of the rod.

    Attributes:
        a, b: the two points; the published force acts ON b's part (the opposite one on a's).
        directions: (k, 3) unit vectors in the frame of a's part, k = 1..3 (unused by a rod).
        length: m, of a rod; None where the points coincide.
        motion: how point a moves, which then is on the world; None where it stays.
    """

    a: Anchor
    b: Anchor
    directions: np.ndarray
    length: float | None = None
    motion: AnchorMotion | None = None


@dataclass(frozen=True)
class PointNoise:
    """A white force on a point: what an effect does not know of its own force (gusts, a current's eddies).

    Attributes:
        at: where it acts.
        density: (3,) roots of its spectral densities along the world's axes, N sqrt(s): over one second the impulse along an
            axis has this standard deviation.
    """

    at: Anchor
    density: np.ndarray


@dataclass(frozen=True)
class CompiledForce:
    """The compiled functions of an effect that pushes: imported by name into the generated step.

    Attributes:
        apply: ``apply(parameters, links, work, q, v, tau)`` adds generalized forces to tau (nv,), and wrenches on links to
            ``work[i].force`` and ``work[i].moment`` (world axes, about the link's origin); kinematics are up to date.
        differentiate: ``differentiate(parameters, links, work, freedoms, composites, q, v, tau_q, tau_v)`` adds the
            derivatives (nv, nv), by the tangent of q and by v, of tau and of what its wrenches add to that;
            ``dynamics/point_force.py`` has what wrenches need.
        energy: ``energy(parameters, links, work, q)`` returns the potential energy, J, whose negative gradient the force
            without damping is; None where there is none. Poses are up to date.
    """

    apply: Any
    differentiate: Any
    energy: Any = None


class Effect(BaseModel):
    """Base of all effects. One effect is one file: parameters with units and bounds, what it adds, why it is there.

    An effect overrides what it contributes: ``field`` (an acceleration all mass feels), ``compiled`` + ``parameters`` (a
    force), ``unknown_force`` (parameters of it that the estimator finds), ``point_pairs`` (equality rows), ``joint_ranges`` and
    ``touching_pairs`` (inequality rows), ``noise``. One with equality rows may come and go, and one that pushes and says so
    (switchable.py): ``active_at``, ``switch_times``.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, allow_inf_nan=False)

    kind: ClassVar[str]
    """The key that names this effect in a scene file."""
    compiled: ClassVar[CompiledForce | None] = None
    words: ClassVar[frozenset[str]] = frozenset()
    """Texts that may stand where its fields have quantities."""
    strengths: ClassVar[tuple[str, ...]] = ()
    """Fields, a number >= 0 or one per joint, that say how strongly it acts, so that a recording may be asked for them: where one
    is zero that side of the effect is not there."""

    name: str = Field(default="", description="name of its outputs, unique in the scene; the kind where left out")

    @property
    def label(self) -> str:
        """The name of the effect's outputs."""
        return self.name or self.kind

    def check(self, tree: Tree) -> None:
        """Raise SceneError or ModelError if the effect does not fit the model (unknown part or joint)."""

    def explain(self, tree: Tree) -> str:
        """One line for ``physics-prior check``: what it does and why the scene pays for it."""
        raise AssertionError(f"effect '{self.kind}' explains nothing")

    def field(self) -> np.ndarray:
        """(3,) m/s^2: acceleration that all mass feels, world axes."""
        return np.zeros(3)

    def parameters(self, tree: Tree) -> np.ndarray:
        """(k,) numbers that the compiled force reads, k fixed by the effect and the tree."""
        return np.zeros(0)

    def point_pairs(self, tree: Tree) -> Sequence[PointPair]:
        """Equality rows; empty for effects that only push."""
        return ()

    def noise(self, tree: Tree) -> Sequence[PointNoise]:
        """White forces that simulations add and the estimator reckons with, beside the scene's own noise of forces."""
        return ()

    def unknown_force(self, tree: Tree) -> UnknownForce | None:
        """Those of its parameters that nothing tells, states of the estimator; None where there are none."""
        return None

    @property
    def comes_and_goes(self) -> bool:
        """Whether it may act at some times only, also where all that it does is to push."""
        return False

    def switchable(self, tree: Tree) -> bool:
        """Whether it can be switched."""
        return self.comes_and_goes or bool(self.point_pairs(tree))

    def active_at(self, time: float) -> bool:
        """Whether it acts by itself at a time, s since the scene's beginning; commands may say otherwise."""
        return True

    def switch_times(self) -> tuple[float, ...]:
        """When ``active_at`` changes, s."""
        return ()

    def joint_ranges(self, tree: Tree) -> Sequence[JointRange]:
        """Joints that it keeps in a range: inequality rows."""
        return ()

    def touching_pairs(self, tree: Tree) -> Sequence[TouchingPair]:
        """Surfaces that it keeps apart: inequality rows."""
        return ()

    def footings(self, tree: Tree) -> Mapping[str, Footing]:
        """Of its published forces those that the ground, fixed on the world, exerts: name -> what stands on it."""
        return {}

    def reactions(self, tree: Tree) -> Sequence[str]:
        """Names of the forces that it publishes: its label where it holds something, unless it says otherwise."""
        return [self.label] if self.point_pairs(tree) else []


def inner_joint(tree: Tree, joint: str, effect: str) -> Link:
    """The link that a revolute, prismatic or spherical joint carries, for an effect that acts in joints.

    Raises:
        ModelError: an unknown joint, a fixed one, or a free one, which has nothing to act between.
    """
    link = tree.link(joint)
    if link.joint.kind is JointKind.FREE:
        raise ModelError(f"joint '{joint}' is free: {effect} acts in revolute, prismatic and spherical joints")
    return link
