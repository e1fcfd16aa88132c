"""Spheres and capsules against each other: two segments, each the middle of its balls (a sphere's has no length)."""

import math

from physics_prior.dynamics.algebra import cross, dot, minus, plus, scale
from physics_prior.dynamics.contact.geometry.directions import across, clamp, length, sign
from physics_prior.dynamics.contact.geometry.manifold import ROUNDING, write_round_row
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Vector

_TIE = 1.0 - 1e-13  # of the squared distance: an end must be nearer than this to be preferred


@inline_kernel
def _foot(point: Vector, center: Vector, half: Vector) -> float:
    """Where on the segment center + t half, t in [-1, 1], a point is nearest."""
    square = dot(half, half)
    return clamp(dot(half, minus(point, center)) / square, 1.0) if square > 0.0 else 0.0


@inline_kernel
def _along(center: Vector, half: Vector, t: float) -> Vector:
    return plus(center, scale(t, half))


@kernel
def nearest_points(center_a: Vector, half_a: Vector, center_b: Vector, half_b: Vector) -> tuple[Vector, Vector]:
    """The nearest points of the segments center + t half, t in [-1, 1].

    Those of the two lines by cross products (accurate also where the lines are almost parallel; for parallel ones the
    middle of what they share), then each end against the other segment: the nearest pair of all.
    """
    between, normal = minus(center_b, center_a), cross(half_a, half_b)
    square, square_a, square_b = dot(normal, normal), dot(half_a, half_a), dot(half_b, half_b)
    if square > ROUNDING * ROUNDING * square_a * square_b:
        s = clamp(dot(cross(between, half_b), normal) / square, 1.0)
    elif square_a > 0.0:
        middle, overhang = dot(half_a, between) / square_a, abs(dot(half_a, half_b)) / square_a
        s = clamp(0.5 * (max(-1.0, middle - overhang) + min(1.0, middle + overhang)), 1.0)
    else:
        s = 0.0
    point_b = _along(center_b, half_b, _foot(_along(center_a, half_a, s), center_b, half_b))
    point_a = _along(center_a, half_a, _foot(point_b, center_a, half_a))
    gap = minus(point_b, point_a)
    least = dot(gap, gap)
    for end in range(4):
        side = -1.0 if end % 2 == 0 else 1.0
        if end < 2:
            a = _along(center_a, half_a, side)
            b = _along(center_b, half_b, _foot(a, center_b, half_b))
        else:
            b = _along(center_b, half_b, side)
            a = _along(center_a, half_a, _foot(b, center_a, half_a))
        gap = minus(b, a)
        if dot(gap, gap) < _TIE * least:
            least, point_a, point_b = dot(gap, gap), a, b
    return point_a, point_b


@inline_kernel
def _across_both(half_a: Vector, half_b: Vector, between: Vector) -> Vector:
    """The unit normal of two segments that meet: across both, or across the longer one where they are parallel."""
    normal = cross(half_a, half_b)
    square, square_a, square_b = dot(normal, normal), dot(half_a, half_a), dot(half_b, half_b)
    if square > ROUNDING * ROUNDING * square_a * square_b:
        return scale(sign(dot(normal, between)) / math.sqrt(square), normal)
    return across(half_a if square_a >= square_b else half_b)


@kernel
def round_round(
    radius_a: float,
    center_a: Vector,
    half_a: Vector,
    radius_b: float,
    center_b: Vector,
    half_b: Vector,
    out: Array,
) -> int:
    """Sphere or capsule a against sphere or capsule b."""
    point_a, point_b = nearest_points(center_a, half_a, center_b, half_b)
    between = minus(point_b, point_a)
    distance = length(between)
    if distance > ROUNDING * (length(half_a) + length(half_b) + radius_a + radius_b):
        normal = scale(1.0 / distance, between)
    else:
        normal = _across_both(half_a, half_b, minus(center_b, center_a))
    write_round_row(out, 0, point_a, radius_a, point_b, radius_b, normal)
    return 1
