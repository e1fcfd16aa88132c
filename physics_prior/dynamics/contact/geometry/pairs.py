"""The one door to contact geometry: `touch` for two shapes of any kinds.

A shape is a kind, a size, the centre of its frame and the rotation R of its axes to the world (9-tuple, row-major):

| kind | size, m |
|---|---|
| PLANE | none: the half-space below the frame's z axis |
| SPHERE | radius |
| CAPSULE | radius, half the length of its axis, which lies along z |
| BOX | half of each edge |
| ELLIPSOID | semi-axes |
"""

from physics_prior.dynamics.algebra import ZERO, scale
from physics_prior.dynamics.contact.geometry.box_box import box_box
from physics_prior.dynamics.contact.geometry.box_round import box_round
from physics_prior.dynamics.contact.geometry.directions import column
from physics_prior.dynamics.contact.geometry.ellipsoid_ellipsoid import ellipsoid_ellipsoid
from physics_prior.dynamics.contact.geometry.ellipsoid_zonotope import ellipsoid_box, ellipsoid_round
from physics_prior.dynamics.contact.geometry.manifold import ROW, SLOTS, exchange
from physics_prior.dynamics.contact.geometry.plane import plane_box, plane_ellipsoid, plane_round
from physics_prior.dynamics.contact.geometry.segments import round_round
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector

__all__ = ["BOX", "CAPSULE", "ELLIPSOID", "PLANE", "ROW", "SLOTS", "SPHERE", "touch"]

PLANE, SPHERE, CAPSULE, BOX, ELLIPSOID = range(5)


@inline_kernel
def _half_axis(kind: int, size: Vector, R: Matrix) -> Vector:
    """Half of a capsule's axis in world axes; a sphere has none."""
    return scale(size[1], column(R, 2)) if kind == CAPSULE else ZERO


@kernel
def touch(
    kind_a: int,
    size_a: Vector,
    center_a: Vector,
    R_a: Matrix,
    kind_b: int,
    size_b: Vector,
    center_b: Vector,
    R_b: Matrix,
    reach: float,
    out: Array,
) -> int:
    """Fill the first rows of `out` (SLOTS, ROW) with the points where shapes a and b touch or soon will; return how many.

    A row is a point on a (3), a point on b (3), the unit normal from a to b (3) and the gap = normal . (b - a), negative
    where they overlap; world axes, m. Rows have gaps of at most `reach`, but the nearest pair is always there, and its gap
    is the shapes' signed distance: their distance apart, or minus the least depth by which a shallow overlap is left.
    One of them may be a plane. Nothing is allocated, and the same arguments give the same bits.
    """
    if kind_b == PLANE or (kind_a != PLANE and kind_a < kind_b):
        rows = _touch_in_order(kind_b, size_b, center_b, R_b, kind_a, size_a, center_a, R_a, reach, out)
        exchange(out, rows)
        return rows
    return _touch_in_order(kind_a, size_a, center_a, R_a, kind_b, size_b, center_b, R_b, reach, out)


@kernel
def _touch_in_order(
    kind_a: int,
    size_a: Vector,
    center_a: Vector,
    R_a: Matrix,
    kind_b: int,
    size_b: Vector,
    center_b: Vector,
    R_b: Matrix,
    reach: float,
    out: Array,
) -> int:
    """The same for a plane first, or for kinds that do not rise."""
    if kind_a == PLANE:
        if kind_b == BOX:
            return plane_box(center_a, R_a, size_b, center_b, R_b, reach, out)
        if kind_b == ELLIPSOID:
            return plane_ellipsoid(center_a, R_a, size_b, center_b, R_b, out)
        return plane_round(center_a, R_a, size_b[0], center_b, _half_axis(kind_b, size_b, R_b), reach, out)
    if kind_b == ELLIPSOID:
        return ellipsoid_ellipsoid(size_a, center_a, R_a, size_b, center_b, R_b, out)
    if kind_b == BOX:
        if kind_a == ELLIPSOID:
            return ellipsoid_box(size_a, center_a, R_a, size_b, center_b, R_b, out)
        return box_box(size_a, center_a, R_a, size_b, center_b, R_b, reach, out)
    half_axis = _half_axis(kind_b, size_b, R_b)
    if kind_a == ELLIPSOID:
        return ellipsoid_round(size_a, center_a, R_a, size_b[0], center_b, half_axis, out)
    if kind_a == BOX:
        return box_round(size_a, center_a, R_a, size_b[0], center_b, half_axis, reach, out)
    return round_round(size_a[0], center_a, _half_axis(kind_a, size_a, R_a), size_b[0], center_b, half_axis, out)
