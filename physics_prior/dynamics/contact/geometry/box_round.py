"""A box against a sphere or a capsule: the box and a segment in the box's axes."""

import math

from physics_prior.dynamics.algebra import cross, dot, minus, plus, scale, times, transposed_times
from physics_prior.dynamics.contact.geometry.directions import axis_vector, clamp, length, sign
from physics_prior.dynamics.contact.geometry.manifold import FLAT, ROUNDING, write_round_row
from physics_prior.dynamics.contact.geometry.segments import nearest_points
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector


@inline_kernel
def nearest_in_box(half: Vector, point: Vector) -> Vector:
    """The point of a box nearest to a point, in the box's axes."""
    return clamp(point[0], half[0]), clamp(point[1], half[1]), clamp(point[2], half[2])


@inline_kernel
def _slope(half: Vector, middle: Vector, half_axis: Vector, t: float) -> float:
    """Half the derivative by t of the squared distance of middle + t half_axis from the box."""
    point = plus(middle, scale(t, half_axis))
    return dot(half_axis, minus(point, nearest_in_box(half, point)))


@kernel
def nearest_on_segment(half: Vector, middle: Vector, half_axis: Vector) -> float:
    """The t in [-1, 1] at which middle + t half_axis is nearest to a box.

    The squared distance is convex and its slope linear between the six crossings of the faces' planes: bracketing the zero
    by all of them leaves a straight piece.
    """
    low, high = -1.0, 1.0
    slope_low, slope_high = _slope(half, middle, half_axis, low), _slope(half, middle, half_axis, high)
    if slope_low >= 0.0:
        return low
    if slope_high <= 0.0:
        return high
    for k in range(3):
        if half_axis[k] != 0.0:
            for side in (-1.0, 1.0):
                t = (side * half[k] - middle[k]) / half_axis[k]
                if low < t < high:
                    slope = _slope(half, middle, half_axis, t)
                    if slope < 0.0:
                        low, slope_low = t, slope
                    else:
                        high, slope_high = t, slope
    return low + (high - low) * slope_low / (slope_low - slope_high)


@inline_kernel
def over_face(half: Vector, middle: Vector, half_axis: Vector, axis: int) -> tuple[float, float]:
    """The range of t in which the segment lies over the faces across an axis; empty where the first is the greater."""
    first, last = -1.0, 1.0
    for k in range(3):
        if k != axis and half_axis[k] != 0.0:
            t = -middle[k] / half_axis[k]
            span = abs(half[k] / half_axis[k])
            first, last = max(first, t - span), min(last, t + span)
        elif k != axis and abs(middle[k]) > half[k]:
            first = 2.0
    return first, last


@inline_kernel
def _on_face(half: Vector, point: Vector, axis: int, side: float) -> Vector:
    """The point moved along an axis onto a face's plane."""
    return (
        side * half[0] if axis == 0 else point[0],
        side * half[1] if axis == 1 else point[1],
        side * half[2] if axis == 2 else point[2],
    )


@inline_kernel
def _shortest_way_out(half: Vector, middle: Vector, half_axis: Vector) -> tuple[Vector, Vector, Vector]:
    """Normal, point of the box and point of a segment that meets it, by separating axes: faces, then edges across it."""
    best, axis, edge = -math.inf, 0, False
    normal = (0.0, 0.0, 1.0)
    tolerance = ROUNDING * length(half)
    for k in range(3):
        separation = abs(middle[k]) - half[k] - abs(half_axis[k])
        if separation > best:
            best, axis, normal = separation, k, axis_vector(k, sign(middle[k]))
    for k in range(3):
        direction = cross(axis_vector(k, 1.0), half_axis)
        size = length(direction)
        if size > ROUNDING * length(half_axis):
            direction = scale(sign(dot(direction, middle)) / size, direction)
            radius = half[0] * abs(direction[0]) + half[1] * abs(direction[1]) + half[2] * abs(direction[2])
            separation = dot(direction, middle) - radius
            if separation > best + tolerance:
                best, axis, edge, normal = separation, k, True, direction
    if edge:
        center = sign(normal[0]) * half[0], sign(normal[1]) * half[1], sign(normal[2]) * half[2]
        along = axis_vector(axis, half[axis])
        on_box, on_segment = nearest_points(minus(center, scale(sign(normal[axis]), along)), along, middle, half_axis)
        return normal, on_box, on_segment
    first, last = over_face(half, middle, half_axis, axis)
    if first > last:
        first, last = -1.0, 1.0
    t = first if dot(normal, half_axis) >= 0.0 else last
    on_segment = plus(middle, scale(t, half_axis))
    return normal, _on_face(half, on_segment, axis, sign(normal[axis])), on_segment


@kernel
def box_round(
    half: Vector,
    center_a: Vector,
    R_a: Matrix,
    radius: float,
    center_b: Vector,
    half_axis_world: Vector,
    reach: float,
    out: Array,
) -> int:
    """Box a against sphere (axis zero) or capsule b: the nearest point, and the other end of what lies over the same face."""
    middle, half_axis = transposed_times(R_a, minus(center_b, center_a)), transposed_times(R_a, half_axis_world)
    nearest = nearest_on_segment(half, middle, half_axis)
    on_segment = plus(middle, scale(nearest, half_axis))
    on_box = nearest_in_box(half, on_segment)
    normal = minus(on_segment, on_box)
    distance = length(normal)
    if distance > ROUNDING * (length(half) + length(half_axis)):
        normal = scale(1.0 / distance, normal)
    else:
        normal, on_box, on_segment = _shortest_way_out(half, middle, half_axis)
    _write(out, 0, center_a, R_a, on_box, on_segment, radius, normal)
    if dot(half_axis, half_axis) == 0.0:
        return 1
    steep = abs(normal[0]), abs(normal[1]), abs(normal[2])
    axis = 0 if steep[0] >= steep[1] and steep[0] >= steep[2] else (1 if steep[1] >= steep[2] else 2)
    first, last = over_face(half, middle, half_axis, axis)
    if steep[axis] < FLAT or first >= last:
        return 1
    here = dot(half_axis, minus(on_segment, middle)) / dot(half_axis, half_axis)
    t = last if abs(last - here) >= abs(first - here) else first
    other = plus(middle, scale(t, half_axis))
    side = sign(normal[axis])
    gap = max(
        side * other[axis] - half[axis] - radius, out[0, 9]
    )  # where the first is an edge's, a face may lie deeper
    if gap > reach:
        return 1
    normal = axis_vector(axis, side)
    _write(out, 1, center_a, R_a, minus(other, scale(gap + radius, normal)), other, radius, normal)
    return 2


@inline_kernel
def _write(
    out: Array, row: int, center: Vector, R: Matrix, on_box: Vector, on_segment: Vector, radius: float, normal: Vector
) -> None:
    """Write a row given in the box's axes."""
    on_a, core = plus(center, times(R, on_box)), plus(center, times(R, on_segment))
    write_round_row(out, row, on_a, 0.0, core, radius, times(R, normal))
