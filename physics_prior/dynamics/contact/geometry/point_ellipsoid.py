"""The signed distance of a point from an ellipsoid, and the curvature of its level surfaces."""

import math

from physics_prior.dynamics.algebra import dot, scale
from physics_prior.dynamics.contact.geometry.directions import length, sign, stretched
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Vector

_ITERATIONS = 60
_CENTRAL = 1e-14  # of a semi-axis: nearer to its middle plane a point counts as this far, on its own side


@inline_kernel
def _off_center(x: float, semi: float) -> float:
    return x if abs(x) > _CENTRAL * semi else sign(x) * _CENTRAL * semi


@kernel
def signed_distance(semi: Vector, point: Vector) -> tuple[float, Vector, float, Vector]:
    """Signed distance d, unit normal n = g / |g|, multiplier t and g of a point in the axes of an ellipsoid.

    The foot p satisfies x - p = t g with g_i = p_i / a_i^2, so g_i = x_i / (a_i^2 + t), sum (a_i g_i)^2 = 1 and
    d = t |g|. The root t > -min a^2 is found as u = t + min a^2, whose denominators u + (a_i^2 - min a^2) lose no digits,
    by Newton's method on 1 / |a g|, which is almost straight; it climbs from below.
    """
    x = _off_center(point[0], semi[0]), _off_center(point[1], semi[1]), _off_center(point[2], semi[2])
    square = stretched(semi, semi)
    base = min(square[0], min(square[1], square[2]))
    rest = square[0] - base, square[1] - base, square[2] - base
    u = max(semi[0] * abs(x[0]) - rest[0], max(semi[1] * abs(x[1]) - rest[1], semi[2] * abs(x[2]) - rest[2]))
    for _ in range(_ITERATIONS):
        q = semi[0] * x[0] / (u + rest[0]), semi[1] * x[1] / (u + rest[1]), semi[2] * x[2] / (u + rest[2])
        value = dot(q, q)
        slope = q[0] * q[0] / (u + rest[0]) + q[1] * q[1] / (u + rest[1]) + q[2] * q[2] / (u + rest[2])
        change = value * (math.sqrt(value) - 1.0) / slope
        u += change
        if abs(change) <= 1e-16 * u:
            break
    g = x[0] / (u + rest[0]), x[1] / (u + rest[1]), x[2] / (u + rest[2])
    size = length(g)
    t = u - base
    return t * size, scale(1.0 / size, g), t, g
