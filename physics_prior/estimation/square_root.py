"""Square-root covariance: P = S S^T is never formed, so that it is symmetric and positive semi-definite for ever.

Orthogonal triangularisation from the right (Bierman 1977; Kailath, Sayed and Hassibi 2000, ch. 12): for any orthogonal U,
[A][A]^T = [A U][A U]^T, and a triangular A U is the new factor.
"""

import math

import numpy as np

from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array

ROUNDING = 1e-10  # of the largest standard deviation: below it, another is that of a direction that constraints forbid


@kernel
def triangularise(W: Array) -> None:
    """Make W (n, N >= n) lower triangular in place by Householder reflections of its rows; W W^T stays what it was."""
    n, N = W.shape
    for i in range(n):
        norm = 0.0
        for k in range(i, N):
            norm += W[i, k] * W[i, k]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        head = W[i, i]
        pivot = -norm if head > 0.0 else norm
        W[i, i] = head - pivot  # row i now holds the Householder vector, of squared length 2 (norm^2 + norm |head|)
        scale = 1.0 / (norm * (norm + abs(head)))
        for j in range(i + 1, n):
            total = 0.0
            for k in range(i, N):
                total += W[i, k] * W[j, k]
            total *= scale
            for k in range(i, N):
                W[j, k] -= total * W[i, k]
        W[i, i] = pivot
        for k in range(i + 1, N):
            W[i, k] = 0.0
        if pivot < 0.0:
            for j in range(i, n):
                W[j, i] = -W[j, i]


@kernel
def carry_factor(F: Array, S: Array, G: Array, W: Array) -> None:
    """Fill W (n, n + g) with [F S  G], whose W W^T is the predicted covariance F S S^T F^T + G G^T. S (n, n); G (n, g)."""
    n, g = S.shape[0], G.shape[1]
    for i in range(n):
        for j in range(n):
            W[i, j] = 0.0
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                for j in range(n):
                    W[i, j] += f * S[k, j]
        for j in range(g):
            W[i, n + j] = G[i, j]


def predicted_factor(W: np.ndarray) -> np.ndarray:
    """The lower factor (n, n) of W W^T; W (n, N >= n) is scratch afterwards."""
    triangularise(W)
    return np.ascontiguousarray(W[:, : len(W)])


@kernel
def innovate(S: Array, H: Array, noise: Array, W: Array, whitened: Array, y: Array) -> float:
    """Triangularise [[noise, H S], [0, S]] in W (m + n, m + n) and whiten the innovation y (m,); return its squared length.

    H (m, k <= n) acts on the first k errors; noise (m, m) is a lower factor. Afterwards W = [[factor of the innovation's
    covariance, 0], [gain times it, factor of the posterior]].
    """
    m, n, h = H.shape[0], S.shape[0], H.shape[1]
    for i in range(m):
        for j in range(m):
            W[i, j] = noise[i, j]
        for j in range(n):
            W[i, m + j] = 0.0
        for k in range(h):
            value = H[i, k]
            if value != 0.0:
                for j in range(n):
                    W[i, m + j] += value * S[k, j]
    for i in range(n):
        for j in range(m):
            W[m + i, j] = 0.0
        for j in range(n):
            W[m + i, m + j] = S[i, j]
    triangularise(W)
    nis = 0.0
    for i in range(m):
        total = y[i]
        for j in range(i):
            total -= W[i, j] * whitened[j]
        whitened[i] = total / W[i, i]
        nis += whitened[i] * whitened[i]
    return nis


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
