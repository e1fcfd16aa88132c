"""Motion under explicit constraints: the block system of equation 4, rank-deficient sets included."""

from dataclasses import dataclass

import numpy as np

from physics_prior.errors import SimulationError

RANK_TOLERANCE = 1e-10
"""Relative to the largest singular value of the scaled rows: below it a row repeats others."""


@dataclass(frozen=True)
class ConstrainedMotion:
    """What moves, and what it takes to hold the constraints.

    Attributes:
        acceleration: (nv,) time derivative of v.
        forces: (pairs, 3) N, ON the part of b of each point pair, at b, world axes; the opposite acts on a's
            part. Where rank is below the number of rows, the motion and the forces' joint effect are unique,
            the split is not: this one has the smallest multipliers.
        rank: number of independent rows among the point pairs' (the joints' rows not counted).
    """

    acceleration: np.ndarray
    forces: np.ndarray
    rank: int


def solve(
    M: np.ndarray, f: np.ndarray, A: np.ndarray, gamma: np.ndarray, typical_inertia: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Solve [M A^T; A 0] [xddot; lambda] = [f; gamma] (equation 4) for xddot (n,), lambda (m,) and rank A.

    M (n, n) may be singular where the constraints hold what has no inertia; A (m, n) may be rank deficient:
    lambda is then the shortest one, and rows that contradict each other are met in the least-squares sense
    while M xddot + A^T lambda = f holds exactly. The null-space method: A's singular vectors split the motion
    into what the constraints prescribe and what they leave free, so that the condition of A is not squared.

    Args:
        M: (n, n) mass matrix.
        f: (n,) force.
        A: (m, n) rows.
        gamma: (m,) their right-hand side, -(d edot/dx) xdot.
        typical_inertia: (n,) positive, about what each coordinate moves: it makes kg and kg m^2 comparable.

    Raises:
        SimulationError: the input is not finite, or some motion is neither constrained nor has inertia.
    """
    if not all(np.all(np.isfinite(array)) for array in (M, f, A, gamma)):
        raise SimulationError("the motion cannot be computed: mass, force or constraint is not finite")
    scale = 1.0 / np.sqrt(typical_inertia)
    mass, force, rows = M * np.outer(scale, scale), f * scale, A * scale
    left, singular, right = np.linalg.svd(rows)
    rank = int(np.sum(singular > RANK_TOLERANCE * singular[0])) if len(singular) else 0
    left, singular, held, free = left[:, :rank], singular[:rank], right[:rank].T, right[rank:].T
    y = held @ (left.T @ gamma / singular)
    reduced = free.T @ mass @ free
    inertias = np.linalg.eigvalsh(reduced)
    if len(inertias) and inertias[0] <= len(f) * np.finfo(float).eps * inertias[-1]:
        raise SimulationError("the motion is not unique: a part that no constraint holds has no inertia")
    y = y + free @ np.linalg.solve(reduced, free.T @ (force - mass @ y))
    multipliers = left @ (held.T @ (force - mass @ y) / singular)
    return scale * y, multipliers, rank
