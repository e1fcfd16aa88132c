"""A half-space against each shape: what of the shape lies deepest, in closed form."""

import math

from physics_prior.dynamics.algebra import dot, minus, plus, scale, times, transposed_times
from physics_prior.dynamics.contact.geometry.directions import column, length, stretched
from physics_prior.dynamics.contact.geometry.manifold import write_row
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector


@inline_kernel
def _write(out: Array, row: int, normal: Vector, height: float, point: Vector) -> None:
    write_row(out, row, minus(point, scale(height, normal)), point, normal, height)


@kernel
def plane_round(
    center_a: Vector, R_a: Matrix, radius: float, center_b: Vector, half_axis: Vector, reach: float, out: Array
) -> int:
    """Plane a against the sphere (half_axis zero) or the capsule b: the balls at the ends of its axis."""
    normal = column(R_a, 2)
    height, rise = dot(normal, minus(center_b, center_a)), dot(normal, half_axis)
    least = height - abs(rise) - radius
    rows = 0
    for side in (-1.0, 1.0):
        gap = height + side * rise - radius
        if (gap <= reach or gap <= least) and (rows == 0 or dot(half_axis, half_axis) > 0.0):
            middle = plus(center_b, scale(side, half_axis))
            _write(out, rows, normal, gap, minus(middle, scale(radius, normal)))
            rows += 1
    return rows


@inline_kernel
def _corner(half: Vector, index: int) -> Vector:
    """Corner of a box in its own axes; bit k of the index is the side along axis k."""
    return (
        half[0] if index & 1 else -half[0],
        half[1] if index & 2 else -half[1],
        half[2] if index & 4 else -half[2],
    )


@kernel
def plane_box(
    center_a: Vector, R_a: Matrix, half: Vector, center_b: Vector, R_b: Matrix, reach: float, out: Array
) -> int:
    """Plane a against box b: its corners, by index."""
    normal = column(R_a, 2)
    height, tilt = dot(normal, minus(center_b, center_a)), transposed_times(R_b, normal)
    least = math.inf
    for index in range(8):
        least = min(least, height + dot(tilt, _corner(half, index)))
    rows = 0
    for index in range(8):
        gap = height + dot(tilt, _corner(half, index))
        if gap <= reach or gap <= least:
            _write(out, rows, normal, gap, plus(center_b, times(R_b, _corner(half, index))))
            rows += 1
    return rows


@inline_kernel
def ellipsoid_support(semi: Vector, direction: Vector) -> Vector:
    """The point of an ellipsoid that lies furthest along a unit direction, A^2 n / |A n|, in its own axes."""
    image = stretched(semi, direction)
    return scale(1.0 / length(image), stretched(semi, image))


@kernel
def plane_ellipsoid(center_a: Vector, R_a: Matrix, semi: Vector, center_b: Vector, R_b: Matrix, out: Array) -> int:
    """Plane a against ellipsoid b: its lowest point."""
    normal = column(R_a, 2)
    tilt = transposed_times(R_b, normal)
    lowest = ellipsoid_support(semi, tilt)
    gap = dot(normal, minus(center_b, center_a)) - dot(tilt, lowest)
    _write(out, 0, normal, gap, minus(center_b, times(R_b, lowest)))
    return 1
