"""Contact geometry behind addresses: only for the kinds of surfaces that a scene names, each compiled once.

A composed step would link, and optimise anew, all geometry that it might call; through an address it calls what stands
compiled. A finder takes 31 numbers: size, centre and axes of surface a, the same of b, and the reach.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from physics_prior.dynamics.algebra import get3, get9, scale
from physics_prior.dynamics.contact.geometry.box_box import box_box
from physics_prior.dynamics.contact.geometry.box_round import box_round
from physics_prior.dynamics.contact.geometry.directions import column
from physics_prior.dynamics.contact.geometry.ellipsoid_ellipsoid import ellipsoid_ellipsoid
from physics_prior.dynamics.contact.geometry.ellipsoid_zonotope import ellipsoid_box, ellipsoid_round
from physics_prior.dynamics.contact.geometry.manifold import ROW, SLOTS
from physics_prior.dynamics.contact.geometry.pairs import BOX, CAPSULE, ELLIPSOID, PLANE, SPHERE
from physics_prior.dynamics.contact.geometry.plane import plane_box, plane_ellipsoid, plane_round
from physics_prior.dynamics.contact.geometry.segments import round_round
from physics_prior.dynamics.kernel import callback, inline_kernel
from physics_prior.dynamics.types import Array, Matrix, Vector

NUMBERS = 31
_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.int64(_POINTER, _POINTER)
_LOW_KINDS = {SPHERE: "round", CAPSULE: "round", BOX: "box", ELLIPSOID: "ellipsoid", PLANE: "plane"}


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
    """Address of the compiled geometry of two kinds of surfaces, and whether it takes them in the opposite order."""
    a, b = _LOW_KINDS[kind_a], _LOW_KINDS[kind_b]
    swapped = (a, b) not in _FINDERS
    return callback(_FINDERS[(b, a) if swapped else (a, b)], _SIGNATURE), swapped


@intrinsic
def find(_typing_context: Any, address: Any, asked: Any, found: Any) -> Any:
    """Call the finder at an address with its numbers and where the points go; returns how many points."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number, pointer = ir.IntType(64), ir.DoubleType().as_pointer()
        function = builder.inttoptr(arguments[0], ir.FunctionType(number, [pointer, pointer]).as_pointer())
        data = [
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        return builder.call(function, data)

    return types.int64(types.int64, asked, found), build
