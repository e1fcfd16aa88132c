"""A covariance on its way through a step, as a square root: P = U^T U is never formed.

So it is symmetric and positive semi-definite for ever. Orthogonal triangularisation (Bierman 1977; Kailath, Sayed and Hassibi
2000, ch. 12): for any orthogonal Q, (Q T)^T (Q T) = T^T T, and a triangular Q T is the new factor. U is the transpose of the
lower factor that the books write: reflections then run along rows, where the compiler makes vectors of them.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.types import Array

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator


@kernel
def triangularise(T: Array, count: int, scratch: Array) -> None:
    """Clear the first ``count`` columns of T (N, n) below the diagonal by Householder reflections; T^T T stays what it was.

    The diagonal ends up positive, or zero. Rows that are zero in a column, below the diagonal down to some place and from
    some place on, are not touched by its reflection. scratch (N + n,).
    """
    triangularise_from(T, 0, count, scratch)


@kernel
def triangularise_from(T: Array, first: int, count: int, scratch: Array) -> None:
    """Do so where the first columns are cleared already."""
    N, n = T.shape
    u, w = scratch[:N], scratch[N : N + n]
    for i in range(first, min(count, N)):
        begin, end = i + 1, N
        while begin < end and T[end - 1, i] == 0.0:
            end -= 1
        while begin < end and T[begin, i] == 0.0:
            begin += 1
        own, right = T[i, i:], w[: n - i]
        m, head = own.shape[0], own[0]
        square = head * head
        for k in range(begin, end):
            u[k] = T[k, i]
            square += u[k] * u[k]
        norm = math.sqrt(square)
        if norm == 0.0:
            continue
        pivot = -norm if head > 0.0 else norm
        lead = head - pivot  # with u the Householder vector, of squared length 2 (norm^2 + norm |head|)
        scale = 1.0 / (norm * (norm + abs(head)))
        for j in range(m):
            right[j] = lead * own[j]
        whole = end - (end - begin) % 4
        for k in range(begin, whole, 4):
            p, q, r, s = u[k], u[k + 1], u[k + 2], u[k + 3]
            x, y, z, t = T[k, i:], T[k + 1, i:], T[k + 2, i:], T[k + 3, i:]
            for j in range(m):
                right[j] += p * x[j] + q * y[j] + r * z[j] + s * t[j]
        for k in range(whole, end):
            p, x = u[k], T[k, i:]
            for j in range(m):
                right[j] += p * x[j]
        for j in range(m):
            right[j] *= scale
            own[j] -= lead * right[j]
        for k in range(begin, end):
            p, x = u[k], T[k, i:]
            for j in range(m):
                x[j] -= p * right[j]
            x[0] = 0.0
        own[0] = pivot
        if pivot < 0.0:
            for j in range(m):
                own[j] = -own[j]


@kernel
def add_rows(shares: Array, F: Array, out: Array) -> None:
    """Add the rows of F (n, m), each by its share (n,), to the first m numbers of out; zeros at both ends cost nothing."""
    m, first, end = F.shape[1], 0, F.shape[0]
    while first < end and shares[first] == 0.0:
        first += 1
    while end > first and shares[end - 1] == 0.0:
        end -= 1
    whole = end - (end - first) % 4
    for k in range(first, whole, 4):
        p, q, r, s = shares[k], shares[k + 1], shares[k + 2], shares[k + 3]
        x, y, z, t = F[k], F[k + 1], F[k + 2], F[k + 3]
        for j in range(m):
            out[j] += p * x[j] + q * y[j] + r * z[j] + s * t[j]
    for k in range(whole, end):
        p, x = shares[k], F[k]
        for j in range(m):
            out[j] += p * x[j]


@kernel
def carry_factor(F: Array, G: Array, U: Array, T: Array) -> None:
    """Fill T (n + g, n) with U F^T above G^T: T^T T is the predicted covariance F U^T U F^T + G G^T.

    U (n, n), G (n, g); F (n, n) is transposed afterwards.
    """
    n, g = G.shape
    for i in range(n):
        for j in range(i):
            F[i, j], F[j, i] = F[j, i], F[i, j]
    clear(T[:n])
    add_product(U, 0, F, T)
    for i in range(g):
        row = T[n + i]
        for j in range(n):
            row[j] = G[j, i]


def carry(
    simulator: "Simulator",
    q: np.ndarray,
    v: np.ndarray,
    h: float,
    count: int,
    factor: np.ndarray,
    force_noise: np.ndarray,
) -> np.ndarray:
    """Move q and v in place by count steps of h seconds; return the lower factor (2 nv, 2 nv) of their errors' covariance.

    factor: any at the beginning; force_noise (nv, nv): the columns are independent white generalized forces, N sqrt(s) or
    N m sqrt(s).

    Raises:
        SimulationError: as of ``Simulator.advance``.
    """
    U, T = np.array(factor.T, dtype=float, order="C"), np.empty((4 * simulator.nv, 2 * simulator.nv))
    _carry(simulator, q, v, h, count, force_noise, U, T, True)
    return U.T


def carry_step(
    simulator: "Simulator", q: np.ndarray, v: np.ndarray, h: float, factor: np.ndarray, force_noise: np.ndarray
) -> np.ndarray:
    """Move q and v in place by one step; return (2 nv, 4 nv): F times a factor (2 nv, 2 nv) of their errors, and G.

    F and G as of ``Simulator.linearise``, force_noise and errors as of ``carry``.
    """
    T = np.empty((4 * simulator.nv, 2 * simulator.nv))
    _carry(simulator, q, v, h, 1, force_noise, np.ascontiguousarray(factor.T, dtype=float), T, False)
    return T.T


def _carry(
    simulator: "Simulator",
    q: np.ndarray,
    v: np.ndarray,
    h: float,
    count: int,
    force_noise: np.ndarray,
    U: np.ndarray,
    T: np.ndarray,
    reduced: bool,
) -> None:
    """Call ``carry`` of the step (step.py)."""
    array, tangent, still = simulator.memory.array, simulator.tangent_array(), simulator.still
    noise = np.ascontiguousarray(force_noise, dtype=float)
    simulator.moved(simulator.step.carry(array, tangent, q, v, still, h, count, noise, U, T, reduced), h)
