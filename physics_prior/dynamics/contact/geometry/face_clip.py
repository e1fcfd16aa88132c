"""Face on face: the corners of one box's face that lie over the other's, and where their outlines cross."""

import math

from physics_prior.dynamics.algebra import dot, minus, plus, scale, transposed_times
from physics_prior.dynamics.contact.geometry.directions import column, length, sign
from physics_prior.dynamics.contact.geometry.manifold import ROUNDING, SLOTS, write_row
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector

_SAME = 1e-9  # of the sizes: two corners nearer than this are one


@inline_kernel
def _clip(start: float, change: float, half: float, first: float, last: float) -> tuple[float, float]:
    """The range of t in [first, last] where |start + t change| <= half; empty where the first is the greater."""
    if change == 0.0:
        return (first if abs(start) <= half else 2.0), last
    middle, span = -start / change, abs(half / change)
    return max(first, middle - span), min(last, middle + span)


@inline_kernel
def _is_new(out: Array, rows: int, columns: int, point: Vector, tolerance: float) -> bool:
    for row in range(rows):
        x, y, z = out[row, columns] - point[0], out[row, columns + 1] - point[1], out[row, columns + 2] - point[2]
        if x * x + y * y + z * z <= tolerance * tolerance:
            return False
    return True


@kernel
def face_on_face(
    axis: int,
    side: float,
    half: Vector,
    center: Vector,
    R: Matrix,
    other_half: Vector,
    other_center: Vector,
    other_R: Matrix,
    is_a: bool,
    least: float,
    limit: float,
    out: Array,
    rows: int,
) -> tuple[int, float]:
    """Add the corners of the overlap whose gap is at most `limit`; return how many rows there are, and the lowest gap.

    The reference face of the box (half, center, R) has the outward normal side * (column `axis` of R); the incident one is
    the other box's that faces it most. `is_a` says that the reference box is shape a. No gap is written below `least`:
    with a normal slightly off the nearest pair's, a corner may lie a little deeper than the boxes do.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    normal, U, V = scale(side, column(R, axis)), column(R, u), column(R, v)
    origin = plus(center, scale(half[axis], normal))
    facing = transposed_times(other_R, normal)
    steep = abs(facing[0]), abs(facing[1]), abs(facing[2])
    k = 0 if steep[0] >= steep[1] and steep[0] >= steep[2] else (1 if steep[1] >= steep[2] else 2)
    k1, k2 = (k + 1) % 3, (k + 2) % 3
    face = plus(minus(other_center, origin), scale(-sign(facing[k]) * other_half[k], column(other_R, k)))
    edge, brim = scale(other_half[k1], column(other_R, k1)), scale(other_half[k2], column(other_R, k2))
    # in the axes of the reference face, height last: the incident face's middle and half its edges
    f = dot(U, face), dot(V, face), dot(normal, face)
    p = dot(U, edge), dot(V, edge), facing[k1] * other_half[k1]
    q = dot(U, brim), dot(V, brim), facing[k2] * other_half[k2]
    size = length(half) + length(other_half)
    half_u, half_v = half[u] + ROUNDING * size, half[v] + ROUNDING * size
    determinant = p[0] * q[1] - p[1] * q[0]
    lowest = math.inf
    for candidate in range(12):
        if candidate < 8:  # where an edge of the incident face enters (even) and leaves (odd) the outline
            turn = candidate // 2
            along = 1.0 if turn == 0 or turn == 1 else -1.0
            shift = 1.0 if turn == 1 or turn == 2 else -1.0
            if turn % 2 == 0:
                start, change = plus(f, plus(scale(-along, p), scale(shift, q))), scale(2.0 * along, p)
            else:
                start, change = plus(f, plus(scale(shift, p), scale(-along, q))), scale(2.0 * along, q)
            first, last = _clip(start[0], change[0], half_u, 0.0, 1.0)
            first, last = _clip(start[1], change[1], half_v, first, last)
            valid = first <= last and (candidate % 2 == 0 or last < 1.0)
            point = plus(start, scale(first if candidate % 2 == 0 else last, change))
        else:  # a corner of the reference face, seen on the incident one
            x = half[u] if candidate % 2 == 0 else -half[u]
            y = half[v] if candidate < 10 else -half[v]
            s = ((x - f[0]) * q[1] - (y - f[1]) * q[0]) / determinant
            t = ((y - f[1]) * p[0] - (x - f[0]) * p[1]) / determinant
            valid = abs(s) <= 1.0 and abs(t) <= 1.0
            point = x, y, f[2] + s * p[2] + t * q[2]
        if valid:
            lowest = min(lowest, point[2])
            if point[2] <= limit and rows < SLOTS:
                incident = plus(origin, plus(plus(scale(point[0], U), scale(point[1], V)), scale(point[2], normal)))
                if _is_new(out, rows, 3 if is_a else 0, incident, _SAME * size):
                    gap = max(point[2], least)
                    reference = minus(incident, scale(gap, normal))
                    if is_a:
                        write_row(out, rows, reference, incident, normal, gap)
                    else:
                        write_row(out, rows, incident, reference, scale(-1.0, normal), gap)
                    rows += 1
    return rows, lowest
