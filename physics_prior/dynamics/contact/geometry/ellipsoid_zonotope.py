"""An ellipsoid against a sphere, a capsule or a box: the point of their core that lies deepest.

A core is x = c + G y with y in [-1, 1]^3: no column of G but zero for a sphere, one for a capsule's segment, three for a
box. The signed distance of x from the ellipsoid is convex, so a projected Newton method finds its minimum.
"""

import math

from physics_prior.dynamics.algebra import (
    dot,
    minus,
    plus,
    product,
    scale,
    symmetric_inverse,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.contact.geometry.directions import clamp, column, length, sign, stretched, transposed
from physics_prior.dynamics.contact.geometry.manifold import SMALL_STEP, write_round_row
from physics_prior.dynamics.contact.geometry.plane import ellipsoid_support
from physics_prior.dynamics.contact.geometry.point_ellipsoid import signed_distance
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Symmetric, Vector

_ITERATIONS = 50
_HALVINGS = 40
_ARMIJO = 1e-4
_MARGIN = 0.1  # of a coordinate's range: the widest strip along a bound that counts as on it
_NOISE = 1e-15  # of the sizes: what a distance may seem to rise by rounding


@inline_kernel
def _to_bound(y: float, slope: float, margin: float) -> float:
    """The way to the bound that a coordinate is within a margin of and that the distance falls towards; else infinity."""
    if y >= 1.0 - margin and slope <= 0.0:
        return 1.0 - y
    if y <= margin - 1.0 and slope >= 0.0:
        return -1.0 - y
    return math.inf


@inline_kernel
def _still_to_go(y: float, slope: float, length: float) -> float:
    """How far a step down the slope would take a coordinate, within its bounds."""
    return abs(clamp(y - slope / length, 1.0) - y) if length > 0.0 else 0.0


@inline_kernel
def _curvature(semi: Vector, columns: Matrix, normal: Vector, t: float, g: Vector) -> Symmetric:
    """G^T H G, H = P (D + t D g g^T D / (g . A^2 D g)) P / |g| with D = (A^2 + t)^-1 and P the projection across the normal.

    From g = D x and |A g| = 1: dx moves t by dt = (g . A^2 D dx) / (g . A^2 D g), and dn = P (D dx - D g dt) / |g|.
    """
    square = stretched(semi, semi)
    D = 1.0 / (square[0] + t), 1.0 / (square[1] + t), 1.0 / (square[2] + t)
    pull = stretched(D, g)
    weight = t / dot(pull, stretched(square, g))
    u, v, w = column(columns, 0), column(columns, 1), column(columns, 2)
    u = minus(u, scale(dot(normal, u), normal))
    v = minus(v, scale(dot(normal, v), normal))
    w = minus(w, scale(dot(normal, w), normal))
    Du, Dv, Dw = stretched(D, u), stretched(D, v), stretched(D, w)
    gu, gv, gw = dot(pull, u), dot(pull, v), dot(pull, w)
    s = 1.0 / dot(g, normal)
    return (
        s * (dot(u, Du) + weight * gu * gu),
        s * (dot(u, Dv) + weight * gu * gv),
        s * (dot(u, Dw) + weight * gu * gw),
        s * (dot(v, Dv) + weight * gv * gv),
        s * (dot(v, Dw) + weight * gv * gw),
        s * (dot(w, Dw) + weight * gw * gw),
    )


@inline_kernel
def _newton_step(H: Symmetric, slopes: Vector, bounds: Vector, scale: float) -> Vector:
    """The Newton step for the square of (distance + a constant) = scale, where a coordinate's way to its bound is infinite.

    It has the same minimum, and a slope along the normal too: (H + slopes slopes^T / scale) step = -slopes. The other
    coordinates go to their bounds (Bertsekas 1982).
    """
    a, b, c = bounds[0] < math.inf, bounds[1] < math.inf, bounds[2] < math.inf
    x, y, z = slopes
    matrix = (
        1.0 if a else H[0] + x * x / scale,
        0.0 if a or b else H[1] + x * y / scale,
        0.0 if a or c else H[2] + x * z / scale,
        1.0 if b else H[3] + y * y / scale,
        0.0 if b or c else H[4] + y * z / scale,
        1.0 if c else H[5] + z * z / scale,
    )
    right = bounds[0] if a else -x, bounds[1] if b else -y, bounds[2] if c else -z
    return symmetric_times(symmetric_inverse(matrix), right)


@inline_kernel
def _start(column: Vector, center: Vector) -> float:
    square = dot(column, column)
    return clamp(-dot(column, center) / square, 1.0) if square > 0.0 else 0.0


@kernel
def deepest_point(semi: Vector, center: Vector, columns: Matrix) -> tuple[float, Vector, Vector]:
    """Signed distance, unit normal of the ellipsoid and the core's deepest point, all in the ellipsoid's axes.

    It begins at the core's point nearest to the ellipsoid's centre. Armijo's rule along the projected path.
    """
    u, v, w = column(columns, 0), column(columns, 1), column(columns, 2)
    sizes = length(u), length(v), length(w)
    size = sizes[0] + sizes[1] + sizes[2] + length(semi)
    least_scale = 2.0 * min(semi[0], min(semi[1], semi[2]))  # no point is deeper than half of this
    y = _start(u, center), _start(v, center), _start(w, center)
    x = plus(center, times(columns, y))
    distance, normal, t, g = signed_distance(semi, x)
    for _ in range(_ITERATIONS):
        slopes = transposed_times(columns, normal)
        to_go = _still_to_go(y[0], slopes[0], sizes[0]), _still_to_go(y[1], slopes[1], sizes[1])
        margin = min(_MARGIN, max(max(to_go[0], to_go[1]), _still_to_go(y[2], slopes[2], sizes[2])))
        bounds = (
            _to_bound(y[0], slopes[0], margin) if sizes[0] > 0.0 else 0.0,
            _to_bound(y[1], slopes[1], margin) if sizes[1] > 0.0 else 0.0,
            _to_bound(y[2], slopes[2], margin) if sizes[2] > 0.0 else 0.0,
        )
        if bounds[0] == 0.0 and bounds[1] == 0.0 and bounds[2] == 0.0:
            break
        step = _newton_step(_curvature(semi, columns, normal, t, g), slopes, bounds, distance + least_scale)
        moved = math.inf
        for _ in range(_HALVINGS):
            trial = clamp(y[0] + step[0], 1.0), clamp(y[1] + step[1], 1.0), clamp(y[2] + step[2], 1.0)
            change = minus(trial, y)
            point = plus(center, times(columns, trial))
            value, trial_normal, trial_t, trial_g = signed_distance(semi, point)
            if value <= distance + _ARMIJO * dot(slopes, change) + _NOISE * size:
                moved = length(times(columns, change))
                y, x, distance, normal, t, g = trial, point, value, trial_normal, trial_t, trial_g
                break
            step = scale(0.5, step)
        if moved == math.inf or moved <= SMALL_STEP * size:
            break
    return distance, normal, x


@inline_kernel
def _write(
    out: Array, center: Vector, R: Matrix, on_ellipsoid: Vector, core: Vector, radius: float, normal: Vector
) -> None:
    """Write the row given in the ellipsoid's axes."""
    on_a, core_b = plus(center, times(R, on_ellipsoid)), plus(center, times(R, core))
    write_round_row(out, 0, on_a, 0.0, core_b, radius, times(R, normal))


@kernel
def ellipsoid_round(
    semi: Vector, center_a: Vector, R_a: Matrix, radius: float, center_b: Vector, half_axis: Vector, out: Array
) -> int:
    """Ellipsoid a against sphere (axis zero) or capsule b: one row."""
    c, axis = transposed_times(R_a, minus(center_b, center_a)), transposed_times(R_a, half_axis)
    columns = axis[0], 0.0, 0.0, axis[1], 0.0, 0.0, axis[2], 0.0, 0.0
    distance, normal, x = deepest_point(semi, c, columns)
    _write(out, center_a, R_a, minus(x, scale(distance, normal)), x, radius, normal)
    return 1


@kernel
def ellipsoid_box(
    semi: Vector, center_a: Vector, R_a: Matrix, half: Vector, center_b: Vector, R_b: Matrix, out: Array
) -> int:
    """Ellipsoid a against box b: one row; in closed form where the ellipsoid's nearest point lies over a face."""
    c, R = transposed_times(R_a, minus(center_b, center_a)), product(transposed(R_a), R_b)
    seen = scale(-1.0, transposed_times(R, c))
    best, face, normal = -math.inf, 0, (0.0, 0.0, 1.0)
    for k in range(3):
        outward = scale(sign(seen[k]), column(R, k))
        separation = abs(seen[k]) - half[k] - length(stretched(semi, outward))
        if separation > best:
            best, face, normal = separation, k, scale(-1.0, outward)
    on_a = ellipsoid_support(semi, normal)
    foot = transposed_times(R, minus(on_a, c))
    over = True
    within = True
    for k in range(3):
        over = over and (k == face or abs(foot[k]) <= half[k])
        within = within and abs(seen[k]) <= half[k]
    if over or within:  # with its centre within, an ellipsoid leaves by the nearest face
        _write(out, center_a, R_a, on_a, plus(on_a, scale(best, normal)), 0.0, normal)
        return 1
    a, b, d = half
    columns = R[0] * a, R[1] * b, R[2] * d, R[3] * a, R[4] * b, R[5] * d, R[6] * a, R[7] * b, R[8] * d
    distance, normal, x = deepest_point(semi, c, columns)
    _write(out, center_a, R_a, minus(x, scale(distance, normal)), x, 0.0, normal)
    return 1
