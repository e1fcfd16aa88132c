"""The contract of an effect: something that acts on the body, compiled into the step only where a scene names it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from physics_prior.model import Tree


@dataclass(frozen=True)
class Anchor:
    """A point fixed on a part (or on ``world``): the part's name and the point in the part's frame, m."""

    part: str
    point: np.ndarray


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
    """

    a: Anchor
    b: Anchor
    directions: np.ndarray
    length: float | None = None


@dataclass(frozen=True)
class CompiledForce:
    """The two compiled functions of an effect that pushes: imported by name into the generated step.

    Attributes:
        apply: ``apply(parameters, links, work, q, v, tau)`` adds generalized forces to tau (nv,), and wrenches on links to
            ``work[i].force`` and ``work[i].moment`` (world axes, about the link's origin); kinematics are up to date.
        differentiate: ``differentiate(parameters, links, work, q, v, tau_q, tau_v)`` adds the derivatives of tau
            (nv, nv) by the tangent of q and by v.
    """

    apply: Any
    differentiate: Any


class Effect(BaseModel):
    """Base of all effects. One effect is one file: parameters with units and bounds, what it adds, why it is there.

    An effect overrides what it contributes: ``field`` (an acceleration all mass feels), ``compiled`` + ``parameters`` (a
    force), ``point_pairs`` (equality rows).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    kind: ClassVar[str]
    """The key that names this effect in a scene file."""
    compiled: ClassVar[CompiledForce | None] = None

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
