"""Whole-array moves as plain loops: Numba compiles these in a tenth of the time that slice assignment takes.

Vectors are taken as they are: to reshape is a call, which costs as much as to move thirty numbers.
"""

from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array


@kernel
def clear(out: Array) -> None:
    """Fill an array of any shape, C order, with zeros."""
    flat = out if out.ndim == 1 else out.reshape(-1)
    for k in range(flat.shape[0]):
        flat[k] = 0.0


@kernel
def copy(source: Array, out: Array) -> None:
    """Copy an array, C order, into one of the same shape."""
    a, b = source if source.ndim == 1 else source.reshape(-1), out if out.ndim == 1 else out.reshape(-1)
    for k in range(a.shape[0]):
        b[k] = a[k]


@kernel
def accumulate(s: float, source: Array, out: Array) -> None:
    """Add s times an array, C order, to one of the same shape."""
    a, b = source if source.ndim == 1 else source.reshape(-1), out if out.ndim == 1 else out.reshape(-1)
    for k in range(a.shape[0]):
        b[k] += s * a[k]


@kernel
def add_product(a: Array, b: Array, out: Array) -> None:
    """Add the product of a (n, m) and b (m, k) to out (n, k); four rows of b a pass, so that out is seldom moved."""
    m, k = b.shape
    whole = m - m % 4
    for i in range(a.shape[0]):
        row = out[i]
        for j in range(0, whole, 4):
            p, q, r, s = a[i, j], a[i, j + 1], a[i, j + 2], a[i, j + 3]
            x, y, z, w = b[j], b[j + 1], b[j + 2], b[j + 3]
            for c in range(k):
                row[c] += p * x[c] + q * y[c] + r * z[c] + s * w[c]
        for j in range(whole, m):
            p, x = a[i, j], b[j]
            for c in range(k):
                row[c] += p * x[c]


@kernel
def subtract_transposed_product(a: Array, b: Array, out: Array) -> None:
    """Subtract the product of a^T, a (m, n), and b (m, k) from out (n, k)."""
    for i in range(out.shape[0]):
        row = out[i]
        for j in range(a.shape[0]):
            p, x = a[j, i], b[j]
            for c in range(row.shape[0]):
                row[c] -= p * x[c]


@kernel
def within(numbers: Array, limit: float) -> bool:
    """Whether all numbers (n,) are at most a limit in size; one that is not a number is not. Eight at a time, as no sum is."""
    all_are = True
    for k in range(numbers.shape[0]):
        all_are = all_are and abs(numbers[k]) <= limit
    return all_are
