"""What the estimator says: the state, how sure it is, the forces, and its health."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from physics_prior.dynamics.wrench import Wrench


class Level(IntEnum):
    """Health of the estimate, worst last. The numbers are those of DiagnosticStatus OK, WARN, ERROR."""

    OK = 0
    DEGRADED = 1
    LOST = 2


@dataclass(frozen=True)
class Health:
    """Health of the estimate and, where it is not OK, its cause in one sentence."""

    level: Level
    cause: str = ""


@dataclass
class Counts:
    """What became of the measurements.

    Attributes:
        read: arrived.
        used: moved the estimate (late ones included).
        gated: refused by the chi-square gate.
        late: arrived out of order and were put in their place.
        rejected: could not be used: doubled, older than the history, not finite, in an unknown frame.
    """

    read: int = 0
    used: int = 0
    gated: int = 0
    late: int = 0
    rejected: int = 0


@dataclass(frozen=True, eq=False)
class Estimate:
    """The state at one stamp, with its uncertainty and the forces that go with it.

    Attributes:
        stamp: ns.
        q: (nq,) configuration.
        v: (nv,) velocity.
        covariance: (2 nv, 2 nv) of the error (tangent of q, v).
        vdot: (nv,) acceleration.
        effort: (nv,) generalized forces of the effects that push, N or N m.
        wrenches: by joint and constraint effect: ON the carried or held part, world axes.
        wrench_deviations: (6,) standard deviations of force and moment, by the same names.
        constraint_error: the largest error of the constraint rows, m; 0 without constraints.
        rank: of the constraint rows; below their number the split of forces is not unique.
        health: how far to trust all this.
        nis: normalised innovation squared of the measurements at this stamp, and its expectation (their dimension);
            zeros where the stamp has none.
        rows: how many constraint rows act.
        holding: the effects that hold something now.
    """

    stamp: int
    q: np.ndarray
    v: np.ndarray
    covariance: np.ndarray
    vdot: np.ndarray
    effort: np.ndarray
    wrenches: dict[str, Wrench]
    wrench_deviations: dict[str, np.ndarray]
    constraint_error: float
    rank: int
    health: Health
    nis: tuple[float, int] = (0.0, 0)
    rows: int = 0
    holding: tuple[str, ...] = ()
    counts: Counts = field(default_factory=Counts)

    @property
    def position_deviation(self) -> np.ndarray:
        """(nv,) standard deviations of the tangent of q."""
        return np.sqrt(np.diag(self.covariance)[: len(self.v)])

    @property
    def velocity_deviation(self) -> np.ndarray:
        """(nv,) standard deviations of v."""
        return np.sqrt(np.diag(self.covariance)[len(self.v) :])
