"""The one door to contact geometry: `touch` for two shapes, with the `finder` of their kinds.

A shape is a kind, a size, the centre of its frame and the rotation R of its axes to the world (9-tuple, row-major):

| kind | size, m |
|---|---|
| PLANE | none: the half-space below the frame's z axis |
| SPHERE | radius, 0 |
| CAPSULE | radius, half the length of its axis, which lies along z |
| BOX | half of each edge |
| ELLIPSOID | semi-axes |

A composed step would link, and optimise anew, all geometry that it might call. Through an address it calls what stands
compiled, each pair of kinds once, and only those that a scene names.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from physics_prior.dynamics.algebra import get3, get9, put3, put9, scale
from physics_prior.dynamics.contact.geometry.box_box import box_box
from physics_prior.dynamics.contact.geometry.box_round import box_round
from physics_prior.dynamics.contact.geometry.directions import column
from physics_prior.dynamics.contact.geometry.ellipsoid_ellipsoid import ellipsoid_ellipsoid
from physics_prior.dynamics.contact.geometry.ellipsoid_zonotope import ellipsoid_box, ellipsoid_round
from physics_prior.dynamics.contact.geometry.manifold import ROW, SLOTS, exchange
from physics_prior.dynamics.contact.geometry.plane import plane_box, plane_ellipsoid, plane_round
from physics_prior.dynamics.contact.geometry.segments import round_round
from physics_prior.dynamics.kernel import callback, inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Vector

__all__ = ["ASKED", "BOX", "CAPSULE", "ELLIPSOID", "PLANE", "ROW", "SLOTS", "SPHERE", "finder", "touch"]

PLANE, SPHERE, CAPSULE, BOX, ELLIPSOID = range(5)
NUMBERS = 31  # that a finder is asked with: size, centre and axes of shape a, the same of b, and the reach
ASKED = 4
"""Rows behind those of the manifold that hold what a finder is asked."""
_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.int64(_POINTER, _POINTER)
_SHAPES = {SPHERE: "round", CAPSULE: "round", BOX: "box", ELLIPSOID: "ellipsoid", PLANE: "plane"}


@intrinsic
def _find(_typing_context: Any, address: Any, asked: Any, found: Any) -> Any:
    """Call the finder at an address with its numbers and where the rows go; returns how many rows."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number, pointer = ir.IntType(64), ir.DoubleType().as_pointer()
        function = builder.inttoptr(arguments[0], ir.FunctionType(number, [pointer, pointer]).as_pointer())
        data = [
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        return builder.call(function, data)

    return types.int64(types.int64, asked, found), build


@kernel
def touch(
    address: int,
    exchanged: bool,
    size_a: Vector,
    center_a: Vector,
    R_a: Matrix,
    size_b: Vector,
    center_b: Vector,
    R_b: Matrix,
    reach: float,
    out: Array,
) -> int:
    """Fill the first rows of `out` (SLOTS + ASKED, ROW) with the points where a and b touch or soon will; return how many.

    A row is a point on a (3), a point on b (3), the unit normal from a to b (3) and the gap = normal . (b - a), negative
    where they overlap; world axes, m. Rows have gaps of at most `reach`, but the nearest pair is always there, and its gap
    is the shapes' signed distance: their distance apart, or minus the least depth by which a shallow overlap is left.
    Nothing is allocated, and the same arguments give the same bits.
    """
    asked = out[SLOTS:].reshape(-1)
    a, b = (15, 0) if exchanged else (0, 15)
    put3(asked[a : a + 3], size_a)
    put3(asked[a + 3 : a + 6], center_a)
    put9(asked[a + 6 : a + 15], R_a)
    put3(asked[b : b + 3], size_b)
    put3(asked[b + 3 : b + 6], center_b)
    put9(asked[b + 6 : b + 15], R_b)
    asked[30] = reach
    rows = int(_find(address, asked, out))
    if exchanged:
        exchange(out, rows)
    return rows


@inline_kernel
def _surface(numbers: Array, first: int) -> tuple[Vector, Vector, Matrix]:
    return get3(numbers[first : first + 3]), get3(numbers[first + 3 : first + 6]), get9(numbers[first + 6 : first + 15])


@inline_kernel
def _both(asked: Any, found: Any) -> Any:
    """What a finder is given, as arrays."""
    return carray(asked, NUMBERS), carray(found, (SLOTS, ROW))


def _plane_round(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    _, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return plane_round(a, R_a, size[0], b, scale(size[1], column(R, 2)), numbers[30], out)


def _plane_box(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    _, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return plane_box(a, R_a, size, b, R, numbers[30], out)


def _plane_ellipsoid(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    _, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return plane_ellipsoid(a, R_a, size, b, R, out)


def _round_round(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    axis_a, axis = scale(size_a[1], column(R_a, 2)), scale(size[1], column(R, 2))
    return round_round(size_a[0], a, axis_a, size[0], b, axis, out)


def _box_round(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return box_round(size_a, a, R_a, size[0], b, scale(size[1], column(R, 2)), numbers[30], out)


def _box_box(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return box_box(size_a, a, R_a, size, b, R, numbers[30], out)


def _ellipsoid_round(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return ellipsoid_round(size_a, a, R_a, size[0], b, scale(size[1], column(R, 2)), out)


def _ellipsoid_box(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return ellipsoid_box(size_a, a, R_a, size, b, R, out)


def _ellipsoid_ellipsoid(asked: Any, found: Any) -> int:
    numbers, out = _both(asked, found)
    size_a, a, R_a = _surface(numbers, 0)
    size, b, R = _surface(numbers, 15)
    return ellipsoid_ellipsoid(size_a, a, R_a, size, b, R, out)


_FINDERS: dict[tuple[str, str], Callable[[Any, Any], int]] = {
    ("plane", "round"): _plane_round,
    ("plane", "box"): _plane_box,
    ("plane", "ellipsoid"): _plane_ellipsoid,
    ("round", "round"): _round_round,
    ("box", "round"): _box_round,
    ("box", "box"): _box_box,
    ("ellipsoid", "round"): _ellipsoid_round,
    ("ellipsoid", "box"): _ellipsoid_box,
    ("ellipsoid", "ellipsoid"): _ellipsoid_ellipsoid,
}


def finder(kind_a: int, kind_b: int) -> tuple[int, bool]:
    """Address of the compiled geometry of two kinds of shapes, not both planes, and whether it takes them exchanged."""
    a, b = _SHAPES[kind_a], _SHAPES[kind_b]
    exchanged = (a, b) not in _FINDERS
    return callback(_FINDERS[(b, a) if exchanged else (a, b)], _SIGNATURE), exchanged
