"""The square root of a covariance P = S S^T, and what a measurement is against it.

S is kept in Fortran's order, so that its transpose U, which the kernels reflect (dynamics/covariance.py), is in C's.
"""

import numpy as np

from physics_prior.dynamics.arrays import add_product
from physics_prior.dynamics.covariance import triangularise
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array
from physics_prior.estimation.blocked import scratch_size, triangularise_in_blocks

MANY = 64  # errors; a factor of fewer is reduced as soon without blocks
ROUNDING = 1e-10  # of the largest standard deviation: below it, another is that of a direction that constraints forbid


def covariance_of(S: np.ndarray) -> np.ndarray:
    """(k, k) S S^T of rows S (k, n) of a factor, symmetric to the last bit; summed alike on any number of cores."""
    out = np.zeros((len(S), len(S)))
    add_product(np.ascontiguousarray(S), np.ascontiguousarray(S.T), out)
    return 0.5 * (out + out.T)


def lower_factor(W: np.ndarray) -> np.ndarray:
    """The lower factor (n, n) of W W^T; W (n, N >= n)."""
    return reduced(np.array(W.T, order="C"))


def reduced(T: np.ndarray) -> np.ndarray:
    """The lower factor (n, n) of T^T T; T (N >= n, n) in C's order, which is lost."""
    N, n = T.shape
    if n < MANY:
        triangularise(T, n, np.empty(N + n))
    else:
        triangularise_in_blocks(T, np.empty(scratch_size(N, n)))
    return T[:n].T


def with_first(U: np.ndarray, count: int) -> np.ndarray:
    """A factor (n, n) of the same covariance U^T U, triangular in its first columns: so many rows alone tell of these errors."""
    out = U.copy()
    triangularise(out, count, np.empty(2 * len(U)))
    return out


@kernel
def whiten(noise: Array, block: int, H: Array, y: Array) -> None:
    """Bring H (m, h) and y (m,) in place to standard deviations of the noise (m, m), a lower factor of blocks on its diagonal."""
    for i in range(y.shape[0]):
        scale = 1.0 / noise[i, i]
        for k in range(i - i % block, i):
            share = noise[i, k]
            if share != 0.0:
                y[i] -= share * y[k]
                for j in range(H.shape[1]):
                    H[i, j] -= share * H[k, j]
        y[i] *= scale
        for j in range(H.shape[1]):
            H[i, j] *= scale


@kernel
def block_squares(H: Array, y: Array, U: Array, block: int, T: Array, scratch: Array, out: Array) -> None:
    """Fill out (k,) with the normalised innovation squared of each block of an innovation alone, H (k block, h), y (k block,).

    Both are whitened: a block's covariance is 1 + s^T s with s = U H^T, of which reflections turn T (block + h, block) into a
    factor, whose diagonal is 1 and more, however little is known. U (h, h): the triangular factor of those errors' covariance.
    scratch (h + 2 block,).
    """
    h = H.shape[1]
    for index in range(out.shape[0]):
        first = block * index
        for i in range(block):
            for j in range(block):
                T[i, j] = 1.0 if i == j else 0.0
        for k in range(h):
            row, own = T[block + k], U[k]
            for i in range(block):
                total, seen = 0.0, H[first + i]
                for j in range(k, h):
                    total += own[j] * seen[j]
                row[i] = total
        triangularise(T, block, scratch)
        out[index] = 0.0
        for i in range(block):
            white = y[first + i]
            for j in range(i):
                white -= T[j, i] * scratch[j]
            white /= T[i, i]
            scratch[i] = white
            out[index] += white * white


def compressed(H: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """As few rows as H has columns that tell the same: whitened H (m, h), y (m,) -> Q^T H (h, h), Q^T y (h,) and what is left.

    The rest of Q^T y, of the squared length that is returned, does not depend on the state (Bierman 1977, ch. 4).
    """
    m, h = H.shape
    T = np.column_stack([H, y])
    triangularise(T, h + 1, np.empty(m + h + 1))
    return np.ascontiguousarray(T[:h, :h]), T[:h, h].copy(), float(T[h, h] ** 2)


def deviations(S: np.ndarray) -> np.ndarray:
    """(n,) standard deviations of a factor S (n, n), to scale by: none less than rounding makes of the largest."""
    own = np.sqrt(np.sum(S * S, axis=1))
    return np.asarray(np.maximum(own, max(ROUNDING * float(np.max(own)), 1e-300)))


def normalised_error(S: np.ndarray, error: np.ndarray) -> tuple[float, int]:
    """Normalised estimation error squared of an error (n,) and its degrees of freedom, the rank of the factor S (n, n)."""
    scale = deviations(S)
    U, s, _ = np.linalg.svd(S / scale[:, None])
    rank = int(np.sum(s > 1e-7 * s[0]))
    return float(np.sum((U[:, :rank].T @ (error / scale) / s[:rank]) ** 2)), rank
