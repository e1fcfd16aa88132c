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
def within(numbers: Array, limit: float) -> bool:
    """Whether all numbers (n,) are at most a limit in size; one that is not a number is not. Eight at a time, as no sum is."""
    all_are = True
    for k in range(numbers.shape[0]):
        all_are = all_are and abs(numbers[k]) <= limit
    return all_are


@kernel
def same(a: Array, b: Array) -> bool:
    """Whether the first numbers of a are those of b (n,). Eight at a time."""
    unlike = 0
    for k in range(b.shape[0]):
        unlike += int(a[k] != b[k])
    return unlike == 0
