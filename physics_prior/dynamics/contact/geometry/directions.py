"""Directions: columns of a rotation, unit vectors, a vector across another, signs and clamps."""

import math

from physics_prior.dynamics.algebra import cross, dot, scale
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Matrix, Vector


@inline_kernel
def column(R: Matrix, k: int) -> Vector:
    """Column k of a 3x3 matrix."""
    return R[k], R[3 + k], R[6 + k]


@inline_kernel
def transposed(R: Matrix) -> Matrix:
    """The transpose of a 3x3 matrix."""
    return R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]


@inline_kernel
def axis_vector(k: int, length: float) -> Vector:
    """The vector along coordinate axis k."""
    return (length if k == 0 else 0.0), (length if k == 1 else 0.0), (length if k == 2 else 0.0)


@inline_kernel
def length(u: Vector) -> float:
    """The norm |u|."""
    return math.sqrt(dot(u, u))


@inline_kernel
def stretched(semi: Vector, u: Vector) -> Vector:
    """The vector u stretched along the axes, component by component."""
    return semi[0] * u[0], semi[1] * u[1], semi[2] * u[2]


@inline_kernel
def sign(x: float) -> float:
    """1 or -1; zero counts as positive."""
    return 1.0 if x >= 0.0 else -1.0


@inline_kernel
def clamp(x: float, limit: float) -> float:
    """The number nearest to x in [-limit, limit]."""
    return min(max(x, -limit), limit)


@inline_kernel
def across(u: Vector) -> Vector:
    """A unit vector perpendicular to u, made with the coordinate axis that u leans on least; z for a zero vector."""
    x, y, z = abs(u[0]), abs(u[1]), abs(u[2])
    least = 0 if x <= y and x <= z else (1 if y <= z else 2)
    w = cross(u, axis_vector(least, 1.0))
    size = length(w)
    return scale(1.0 / size, w) if size > 0.0 else (0.0, 0.0, 1.0)
