"""Two ellipsoids: the direction n along which they are furthest apart, s(n) = n . c - |n|_A - |n|_B.

|n|_A = sqrt(n . A n) with A = R diag(a^2) R^T is how far an ellipsoid reaches. Apart, s is concave where it is positive and
its maximum is the distance; overlapping, it is the depth.
"""

import math

from physics_prior.dynamics.algebra import (
    dot,
    minus,
    plus,
    product,
    rotated_inertia,
    scale,
    symmetric_inverse,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.contact.geometry.directions import axis_vector, column, length, transposed
from physics_prior.dynamics.contact.geometry.manifold import ROUNDING, SMALL_STEP, write_row
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Symmetric, Vector

_BISECTIONS = 10
_ITERATIONS = 60
_HALVINGS = 40
_NOISE = 1e-15  # of the sizes: what a separation may seem to fall by rounding


@inline_kernel
def _reach(A: Symmetric, n: Vector) -> float:
    return math.sqrt(dot(n, symmetric_times(A, n)))


@inline_kernel
def _separation(A: Symmetric, B: Symmetric, c: Vector, n: Vector) -> float:
    return dot(n, c) - _reach(A, n) - _reach(B, n)


@inline_kernel
def _unit(u: Vector) -> Vector:
    return scale(1.0 / length(u), u)


@kernel
def _start(A: Symmetric, B: Symmetric, c: Vector) -> Vector:
    """The normal ((1 - w) A + w B)^-1 c of the two ellipsoids grown or shrunk until they touch (Perram and Wertheim 1985).

    They touch where (1 - w) |n|_A = w |n|_B; the difference falls with w, so a few bisections will do for a start.
    """
    low, high = 0.0, 1.0
    n = c
    for _ in range(_BISECTIONS):
        w = 0.5 * (low + high)
        o = 1.0 - w
        mixed = (
            o * A[0] + w * B[0],
            o * A[1] + w * B[1],
            o * A[2] + w * B[2],
            o * A[3] + w * B[3],
            o * A[4] + w * B[4],
            o * A[5] + w * B[5],
        )
        n = symmetric_times(symmetric_inverse(mixed), c)
        if o * _reach(A, n) > w * _reach(B, n):
            low = w
        else:
            high = w
    return _unit(n)


@inline_kernel
def _minus_hessian(A: Symmetric, n: Vector, An: Vector, reach: float) -> Symmetric:
    """(A - A n (A n)^T / |n|_A^2) / |n|_A, the second derivative of |n|_A."""
    f = 1.0 / (reach * reach)
    return (
        (A[0] - f * An[0] * An[0]) / reach,
        (A[1] - f * An[0] * An[1]) / reach,
        (A[2] - f * An[0] * An[2]) / reach,
        (A[3] - f * An[1] * An[1]) / reach,
        (A[4] - f * An[1] * An[2]) / reach,
        (A[5] - f * An[2] * An[2]) / reach,
    )


@inline_kernel
def _newton_step(H: Symmetric, shift: float, n: Vector, right: Vector) -> Vector:
    """The tangent vector d with (H + shift) d = right: H n = 0, so n n^T times the trace only makes it regular."""
    w = H[0] + H[3] + H[5]
    matrix = (
        H[0] + shift + w * n[0] * n[0],
        H[1] + w * n[0] * n[1],
        H[2] + w * n[0] * n[2],
        H[3] + shift + w * n[1] * n[1],
        H[4] + w * n[1] * n[2],
        H[5] + shift + w * n[2] * n[2],
    )
    return symmetric_times(symmetric_inverse(matrix), right)


@kernel
def widest_direction(A: Symmetric, B: Symmetric, c: Vector, n: Vector) -> Vector:
    """The unit vector that maximises s, from a start, by Newton's method on the sphere: (-s'' + s) d = the tangent part of s'."""
    s = _separation(A, B, c, n)
    noise = _NOISE * (length(c) + math.sqrt(A[0] + A[3] + A[5]) + math.sqrt(B[0] + B[3] + B[5]))
    for _ in range(_ITERATIONS):
        An, Bn = symmetric_times(A, n), symmetric_times(B, n)
        reach_a, reach_b = math.sqrt(dot(n, An)), math.sqrt(dot(n, Bn))
        slope = minus(c, plus(scale(1.0 / reach_a, An), scale(1.0 / reach_b, Bn)))
        slope = minus(slope, scale(dot(n, slope), n))
        p, q = _minus_hessian(A, n, An, reach_a), _minus_hessian(B, n, Bn, reach_b)
        H = p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3], p[4] + q[4], p[5] + q[5]
        step = _newton_step(H, s, n, slope)
        if s < 0.0 and not dot(step, slope) > 0.0:
            step = _newton_step(H, 0.0, n, slope)  # deep: without the sphere's own curvature it always climbs
        factor, moved = 1.0, False
        for _ in range(_HALVINGS):
            trial = _unit(plus(n, scale(factor, step)))
            value = _separation(A, B, c, trial)
            if value >= s - noise:
                n, s, moved = trial, value, True
                break
            factor *= 0.5
        if not moved or dot(step, step) <= SMALL_STEP * SMALL_STEP:
            break
    return n


@kernel
def ellipsoid_ellipsoid(
    semi_a: Vector, center_a: Vector, R_a: Matrix, semi_b: Vector, center_b: Vector, R_b: Matrix, out: Array
) -> int:
    """Ellipsoid a against ellipsoid b: one row."""
    c, R = transposed_times(R_a, minus(center_b, center_a)), product(transposed(R_a), R_b)
    A = semi_a[0] * semi_a[0], 0.0, 0.0, semi_a[1] * semi_a[1], 0.0, semi_a[2] * semi_a[2]
    B = rotated_inertia(R, (semi_b[0] * semi_b[0], 0.0, 0.0, semi_b[1] * semi_b[1], 0.0, semi_b[2] * semi_b[2]))
    if length(c) > ROUNDING * (length(semi_a) + length(semi_b)):
        n = _start(A, B, c)
    else:  # one centre: out along the axis that is shortest
        n = axis_vector(0, 1.0)
        for k in range(6):
            axis = axis_vector(k, 1.0) if k < 3 else column(R, k - 3)
            if _separation(A, B, c, axis) > _separation(A, B, c, n):
                n = axis
    n = widest_direction(A, B, c, n)
    on_a = scale(1.0 / _reach(A, n), symmetric_times(A, n))
    on_b = minus(c, scale(1.0 / _reach(B, n), symmetric_times(B, n)))
    gap = dot(n, minus(on_b, on_a))
    write_row(out, 0, plus(center_a, times(R_a, on_a)), plus(center_a, times(R_a, on_b)), times(R_a, n), gap)
    return 1
