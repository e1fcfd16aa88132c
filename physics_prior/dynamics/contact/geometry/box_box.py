"""Two boxes: separating axes, then faces clipped against each other, or the nearest edges and corners."""

import math

from physics_prior.dynamics.algebra import dot, minus, plus, product, scale, times, transposed_times
from physics_prior.dynamics.contact.geometry.box_round import nearest_in_box, nearest_on_segment
from physics_prior.dynamics.contact.geometry.directions import axis_vector, column, length, sign, transposed
from physics_prior.dynamics.contact.geometry.face_clip import face_on_face
from physics_prior.dynamics.contact.geometry.manifold import FLAT, ROUNDING, write_row
from physics_prior.dynamics.contact.geometry.segments import nearest_points
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector


@inline_kernel
def _radius(half: Vector, direction: Vector) -> float:
    """How far a box reaches along a direction given in its axes."""
    return half[0] * abs(direction[0]) + half[1] * abs(direction[1]) + half[2] * abs(direction[2])


@kernel
def best_face(half_a: Vector, half_b: Vector, center: Vector, R: Matrix) -> tuple[float, int]:
    """The widest separation along a face's normal, and which: 0 to 2 of a, 3 to 5 of b. b's center and R in a's axes."""
    best, which = -math.inf, 0
    tolerance = ROUNDING * (length(half_a) + length(half_b))
    seen = transposed_times(R, center)
    for k in range(3):
        separation = abs(center[k]) - half_a[k] - _radius(half_b, (R[3 * k], R[3 * k + 1], R[3 * k + 2]))
        if separation > best + tolerance:
            best, which = separation, k
    for k in range(3):
        separation = abs(seen[k]) - half_b[k] - _radius(half_a, column(R, k))
        if separation > best + tolerance:
            best, which = separation, 3 + k
    return best, which


@kernel
def best_edges(half_a: Vector, half_b: Vector, center: Vector, R: Matrix) -> tuple[float, Vector, int, int]:
    """The widest separation across an edge of each box, its direction from a to b and the edges' axes."""
    best, normal, edge_a, edge_b = -math.inf, (0.0, 0.0, 1.0), 0, 0
    for i in range(3):
        one, two = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            along, up = R[3 * one + j], R[3 * two + j]
            size = math.sqrt(along * along + up * up)
            if size > ROUNDING:
                x, y = -up / size, along / size  # axis i crossed with column j has no component along axis i
                direction = (
                    0.0 if i == 0 else (y if i == 1 else x),
                    x if i == 0 else (0.0 if i == 1 else y),
                    y if i == 0 else (x if i == 1 else 0.0),
                )
                separation = (
                    abs(dot(direction, center))
                    - _radius(half_a, direction)
                    - _radius(half_b, transposed_times(R, direction))
                )
                if separation > best:
                    best, edge_a, edge_b = separation, i, j
                    normal = scale(sign(dot(direction, center)), direction)
    return best, normal, edge_a, edge_b


@inline_kernel
def _corner(half: Vector, direction: Vector) -> Vector:
    """The corner of a box that lies furthest along a direction, in its axes."""
    return sign(direction[0]) * half[0], sign(direction[1]) * half[1], sign(direction[2]) * half[2]


@inline_kernel
def _edge(half: Vector, axis: int, direction: Vector) -> tuple[Vector, Vector]:
    """Middle and half of the edge along an axis that lies furthest along a direction across it, in the box's axes."""
    corner, along = _corner(half, direction), axis_vector(axis, half[axis])
    return minus(corner, axis_vector(axis, corner[axis])), along


@kernel
def nearest_edges(half: Vector, other_half: Vector, center: Vector, R: Matrix) -> tuple[Vector, Vector]:
    """The nearest pair of a point of the box and a point on the twelve edges of the other; all in the box's axes."""
    least, on_box, on_edge = math.inf, center, center
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        half_edge = scale(other_half[axis], column(R, axis))
        for corner in range(4):
            across = scale(other_half[one] if corner % 2 == 0 else -other_half[one], column(R, one))
            up = scale(other_half[two] if corner < 2 else -other_half[two], column(R, two))
            middle = plus(center, plus(across, up))
            point = plus(middle, scale(nearest_on_segment(half, middle, half_edge), half_edge))
            foot = nearest_in_box(half, point)
            gap = minus(point, foot)
            if dot(gap, gap) < least:
                least, on_box, on_edge = dot(gap, gap), foot, point
    return on_box, on_edge


@kernel
def nearest_corner(half: Vector, other_half: Vector, center: Vector, R: Matrix) -> tuple[Vector, Vector]:
    """The nearest pair of a point of the box and a corner of the other; all in the box's axes."""
    least, on_box, on_corner = math.inf, center, center
    for index in range(8):
        corner = (
            other_half[0] if index & 1 else -other_half[0],
            other_half[1] if index & 2 else -other_half[1],
            other_half[2] if index & 4 else -other_half[2],
        )
        point = plus(center, times(R, corner))
        foot = nearest_in_box(half, point)
        gap = minus(point, foot)
        if dot(gap, gap) < least:
            least, on_box, on_corner = dot(gap, gap), foot, point
    return on_box, on_corner


@kernel
def nearest_features(half_a: Vector, half_b: Vector, center: Vector, R: Matrix) -> tuple[Vector, Vector]:
    """The nearest points of two boxes apart, in a's axes: on an edge of b, or at a corner of a."""
    on_a, on_b = nearest_edges(half_a, half_b, center, R)
    foot, corner = nearest_corner(half_b, half_a, scale(-1.0, transposed_times(R, center)), transposed(R))
    gap, other = minus(on_b, on_a), minus(foot, corner)
    if dot(other, other) < dot(gap, gap):
        return plus(center, times(R, corner)), plus(center, times(R, foot))
    return on_a, on_b


@kernel
def _faces(
    which: int,
    normal: Vector,
    R: Matrix,
    boxes: tuple[Vector, Vector, Matrix, Vector, Vector, Matrix],
    least: float,
    limit: float,
    out: Array,
    rows: int,
) -> tuple[int, float]:
    """The overlap of the faces whose reference face is `which` (0 to 2 of a, 3 to 5 of b), towards the other box."""
    half_a, center_a, R_a, half_b, center_b, R_b = boxes
    if which < 3:
        side = sign(normal[which])
        return face_on_face(which, side, half_a, center_a, R_a, half_b, center_b, R_b, True, least, limit, out, rows)
    axis = which - 3
    side = -sign(dot(normal, column(R, axis)))
    return face_on_face(axis, side, half_b, center_b, R_b, half_a, center_a, R_a, False, least, limit, out, rows)


@kernel
def box_box(
    half_a: Vector,
    center_a: Vector,
    R_a: Matrix,
    half_b: Vector,
    center_b: Vector,
    R_b: Matrix,
    reach: float,
    out: Array,
) -> int:
    """Box a against box b.

    A separation along an axis is the boxes' distance where points of both lie that far apart along it; where no face and no
    pair of edges has such points, the nearest features are corners. Boxes that overlap are as deep as their widest axis says.
    """
    R, center = product(transposed(R_a), R_b), transposed_times(R_a, minus(center_b, center_a))
    tolerance = ROUNDING * (length(half_a) + length(half_b))
    face, which = best_face(half_a, half_b, center, R)
    edge, normal, edge_a, edge_b = best_edges(half_a, half_b, center, R)
    if edge > face + tolerance:
        middle_a, along_a = _edge(half_a, edge_a, normal)
        middle_b, along_b = _edge(half_b, edge_b, scale(-1.0, transposed_times(R, normal)))
        on_a, on_b = nearest_points(middle_a, along_a, plus(center, times(R, middle_b)), times(R, along_b))
        found = edge <= tolerance or length(minus(on_b, on_a)) <= edge + tolerance
    else:
        normal = axis_vector(which, sign(center[which])) if which < 3 else column(R, which - 3)
        normal = scale(sign(dot(normal, center)), normal)
        boxes = half_a, center_a, R_a, half_b, center_b, R_b
        _, lowest = _faces(which, normal, R, boxes, -math.inf, -math.inf, out, 0)
        if lowest <= face + tolerance:
            rows, _ = _faces(which, normal, R, boxes, lowest, max(reach, lowest), out, 0)
            return rows
        on_b = plus(center, times(R, _corner(half_b, scale(-1.0, transposed_times(R, normal)))))
        on_a = minus(on_b, scale(face, normal))
        found = face <= tolerance
    if not found:
        on_a, on_b = nearest_features(half_a, half_b, center, R)
        normal = minus(on_b, on_a)
        normal = scale(1.0 / length(normal), normal)
    gap = dot(normal, minus(on_b, on_a))
    write_row(out, 0, plus(center_a, times(R_a, on_a)), plus(center_a, times(R_a, on_b)), times(R_a, normal), gap)
    if gap > reach:
        return 1
    seen = transposed_times(R, normal)
    steepest = FLAT
    flat = -1
    for k in range(3):
        if abs(normal[k]) > steepest:
            steepest, flat = abs(normal[k]), k
        if abs(seen[k]) > steepest:
            steepest, flat = abs(seen[k]), 3 + k
    if flat < 0:
        return 1
    rows, _ = _faces(flat, normal, R, (half_a, center_a, R_a, half_b, center_b, R_b), gap, reach, out, 1)
    return rows
