"""Two ellipsoids: the direction n along which they are furthest apart, s(n) = n . c - |n|_A - |n|_B.

|n|_A = sqrt(n . A n) with A = R diag(a^2) R^T is how far an ellipsoid reaches; all in the axes of a. Apart, s is concave
where it is positive and its maximum is the distance; overlapping, it is the depth.
"""

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
from physics_prior.dynamics.contact.geometry.directions import axis_vector, column, length, stretched, transposed
from physics_prior.dynamics.contact.geometry.manifold import ROUNDING, SMALL_STEP, write_row
from physics_prior.dynamics.contact.geometry.plane import ellipsoid_support
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Symmetric, Vector

_BISECTIONS = 10
_ITERATIONS = 60
_HALVINGS = 40
_NOISE = 1e-15  # of the sizes: what a separation may seem to fall by rounding


@inline_kernel
def _reach(semi: Vector, n: Vector) -> float:
    """How far an ellipsoid reaches along n, given in its axes: a sum of squares, which no rounding makes negative."""
    return length(stretched(semi, n))


@inline_kernel
def _separation(semi_a: Vector, semi_b: Vector, R: Matrix, c: Vector, n: Vector) -> float:
    return dot(n, c) - _reach(semi_a, n) - _reach(semi_b, transposed_times(R, n))


@inline_kernel
def _unit(u: Vector) -> Vector:
    return scale(1.0 / length(u), u)


@inline_kernel
def _square(semi: Vector) -> Symmetric:
    return semi[0] * semi[0], 0.0, 0.0, semi[1] * semi[1], 0.0, semi[2] * semi[2]


@kernel
def touching_normal(semi_a: Vector, semi_b: Vector, R: Matrix, c: Vector) -> Vector:
    """The normal ((1 - w) A + w B)^-1 c of the two ellipsoids grown or shrunk until they touch (Perram and Wertheim 1985).

    They touch where (1 - w) |n|_A = w |n|_B; the difference falls with w, so a few bisections will do for a start.
    """
    A, B = _square(semi_a), rotated_inertia(R, _square(semi_b))
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
        if o * _reach(semi_a, n) > w * _reach(semi_b, transposed_times(R, n)):
            low = w
        else:
            high = w
    return _unit(n)


@inline_kernel
def _supports(semi_a: Vector, semi_b: Vector, R: Matrix, n: Vector) -> tuple[Vector, Vector]:
    """The derivatives of |n|_A and |n|_B: the points of either ellipsoid, about its own centre, furthest along n."""
    return ellipsoid_support(semi_a, n), times(R, ellipsoid_support(semi_b, transposed_times(R, n)))


@inline_kernel
def _bend(A: Symmetric, support: Vector, reach: float) -> Symmetric:
    """(A - p p^T) / |n|_A with p the derivative of |n|_A: the second derivative."""
    return (
        (A[0] - support[0] * support[0]) / reach,
        (A[1] - support[0] * support[1]) / reach,
        (A[2] - support[0] * support[2]) / reach,
        (A[3] - support[1] * support[1]) / reach,
        (A[4] - support[1] * support[2]) / reach,
        (A[5] - support[2] * support[2]) / reach,
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
def widest_direction(semi_a: Vector, semi_b: Vector, R: Matrix, c: Vector, n: Vector) -> tuple[Vector, Vector, Vector]:
    """The unit vector n that maximises s, from a start, and the points of the ellipsoids that lie furthest to each other.

    Newton's method on the sphere: (-s'' + s) d = the tangent part of s' (s is homogeneous, so n . s' = s).
    """
    A, B = _square(semi_a), rotated_inertia(R, _square(semi_b))
    s = _separation(semi_a, semi_b, R, c, n)
    noise = _NOISE * (length(c) + length(semi_a) + length(semi_b))
    for _ in range(_ITERATIONS):
        on_a, from_b = _supports(semi_a, semi_b, R, n)
        slope = minus(c, plus(on_a, from_b))
        slope = minus(slope, scale(dot(n, slope), n))
        p, q = _bend(A, on_a, _reach(semi_a, n)), _bend(B, from_b, _reach(semi_b, transposed_times(R, n)))
        H = p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3], p[4] + q[4], p[5] + q[5]
        step = _newton_step(H, s, n, slope)
        if s < 0.0 and not dot(step, slope) > 0.0:
            step = _newton_step(H, 0.0, n, slope)  # deep: without the sphere's own curvature it always climbs
        moved = False
        for _ in range(_HALVINGS):
            trial = _unit(plus(n, step))
            value = _separation(semi_a, semi_b, R, c, trial)
            if value >= s - noise:
                n, s, moved = trial, value, True
                break
            step = scale(0.5, step)
        if not moved or dot(step, step) <= SMALL_STEP * SMALL_STEP:
            break
    on_a, from_b = _supports(semi_a, semi_b, R, n)
    return n, on_a, minus(c, from_b)


@kernel
def ellipsoid_ellipsoid(
    semi_a: Vector, center_a: Vector, R_a: Matrix, semi_b: Vector, center_b: Vector, R_b: Matrix, out: Array
) -> int:
    """Ellipsoid a against ellipsoid b: one row."""
    c, R = transposed_times(R_a, minus(center_b, center_a)), product(transposed(R_a), R_b)
    if length(c) > ROUNDING * (length(semi_a) + length(semi_b)):
        n = _unit(c)
        touching = touching_normal(semi_a, semi_b, R, c)
        if _separation(semi_a, semi_b, R, c, touching) > _separation(semi_a, semi_b, R, c, n):
            n = touching
    else:  # one centre: out along the axis that is shortest
        n = axis_vector(0, 1.0)
        for k in range(6):
            axis = axis_vector(k, 1.0) if k < 3 else column(R, k - 3)
            if _separation(semi_a, semi_b, R, c, axis) > _separation(semi_a, semi_b, R, c, n):
                n = axis
    n, on_a, on_b = widest_direction(semi_a, semi_b, R, c, n)
    gap = dot(n, minus(on_b, on_a))
    write_row(out, 0, plus(center_a, times(R_a, on_a)), plus(center_a, times(R_a, on_b)), times(R_a, n), gap)
    return 1
