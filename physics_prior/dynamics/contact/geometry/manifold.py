"""The manifold of a pair: rows of a point on a, a point on b, the unit normal from a to b and the gap along it."""

from physics_prior.dynamics.algebra import dot, minus, plus, scale
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Vector

SLOTS = 8
"""Rows of a manifold: two convex polygons of four corners intersect in one of eight at most."""
ROW = 10
"""Point on a (3), point on b (3), normal (3), gap."""
ROUNDING = 1e-12
"""What counts as nothing, relative to the sizes of the shapes."""
SMALL_STEP = 1e-11
"""The last step of a Newton method, relative: what is left after it is of the order of its square."""
FLAT = 0.999
"""Cosine between the nearest pair's normal and a face's beyond which the shapes lie on that face."""


@inline_kernel
def write_row(out: Array, row: int, on_a: Vector, on_b: Vector, normal: Vector, gap: float) -> None:
    """Write one row of the manifold (SLOTS, ROW)."""
    for k in range(3):
        out[row, k] = on_a[k]
        out[row, 3 + k] = on_b[k]
        out[row, 6 + k] = normal[k]
    out[row, 9] = gap


@inline_kernel
def write_round_row(
    out: Array, row: int, core_a: Vector, radius_a: float, core_b: Vector, radius_b: float, normal: Vector
) -> None:
    """Write the row of two points, each in the middle of a ball of its shape (radius zero: a point of the shape itself)."""
    gap = dot(normal, minus(core_b, core_a)) - radius_a - radius_b
    write_row(out, row, plus(core_a, scale(radius_a, normal)), minus(core_b, scale(radius_b, normal)), normal, gap)


@kernel
def exchange(out: Array, rows: int) -> None:
    """Read the manifold of (b, a) as that of (a, b)."""
    for row in range(rows):
        for k in range(3):
            out[row, k], out[row, 3 + k] = out[row, 3 + k], out[row, k]
            out[row, 6 + k] = -out[row, 6 + k]
