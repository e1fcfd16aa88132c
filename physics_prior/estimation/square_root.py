"""The square root of a covariance P = S S^T, and what a measurement is against it.

S is kept in Fortran's order, so that its transpose U, which the kernels reflect (dynamics/covariance.py), is in C's.
"""

import numpy as np

from physics_prior.dynamics.blocked import FEW, scratch_size, triangularise_in_blocks
from physics_prior.dynamics.covariance import triangularise
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.types import Array

ROUNDING = 1e-10  # of the largest standard deviation: below it, another is that of a direction that constraints forbid


def covariance_of(S: np.ndarray) -> np.ndarray:
    """(k, k) S S^T of rows S (k, n) of a factor, symmetric to the last bit; summed alike on any number of cores."""
    out = np.zeros((len(S), len(S)))
    add_product(np.ascontiguousarray(S), 0, np.ascontiguousarray(S.T), out)
    return 0.5 * (out + out.T)


def lower_factor(W: np.ndarray) -> np.ndarray:
    """The lower factor (n, n) of W W^T; W (n, N >= n)."""
    return reduced(np.array(W.T, order="C"))


def reduced(T: np.ndarray) -> np.ndarray:
    """The lower factor (n, n) of T^T T; T (N >= n, n) in C's order, which is lost."""
    n = T.shape[1]
    _triangularise(T, n)
    return T[:n].T


def with_first(U: np.ndarray, count: int) -> np.ndarray:
    """A factor (n, n) of the same covariance U^T U, triangular in its first columns: so many rows alone tell of these errors."""
    out = U.copy()
    _triangularise(out, count)
    return out


def _triangularise(T: np.ndarray, count: int) -> None:
    """Clear the first columns below the diagonal; a scene of few errors need not have the blocks compiled for that."""
    clear_columns = triangularise_in_blocks if T.shape[1] > FEW else triangularise
    clear_columns(T, count, np.empty(scratch_size(*T.shape)))


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
