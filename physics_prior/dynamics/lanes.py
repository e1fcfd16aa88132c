"""The numbers of several links side by side: each link has a lane of every block. The same functions serve one link by its index.

Pairs of numbers that stand one after another move together, as half registers do: fields that sweeps take together stand
together in a record.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from physics_prior.dynamics.blocks import DOUBLE, LANE, BlockType
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.records import ALL
from physics_prior.dynamics.types import Records

PAIR, INDEX, BYTE = ir.VectorType(DOUBLE, 2), ir.IntType(64), ir.IntType(8)


@inline_kernel
def visited(links: Records, step: int, which: int) -> tuple[int, int]:
    """The link that a sweep outward visits at a step, -1 behind the last, and how many side by side; which: ALL or MOVED."""
    if which == ALL:
        return links[step].visit, links[step].together
    return links[step].moved, 1


@inline_kernel
def those(links: Records, step: int, some: int) -> tuple[Any, Any]:
    """These links, where they are several, and what they hang on; the last again where they are fewer than lanes."""
    where = integers(links, "visit", (step, step + 1, step + min(2, some - 1), step + some - 1))
    return where, integers(links, "parent", where)


@intrinsic(prefer_literal=True)
def numbers(_typing_context: Any, records: Any, field: Any, count: Any, where: Any) -> Any:
    """The first so many numbers, a constant, of a field of the record that is where, an index, on; or blocks of four records'.

    It may be that they reach into the fields behind it.
    """

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _fields(context, builder, signature.args, arguments[0], signature.args[3], arguments[3])
        return _loaded(context, builder, signature.return_type, places, count.literal_value)

    return _several(where, count.literal_value)(records, field, count, where), build


@intrinsic(prefer_literal=True)
def put_numbers(_typing_context: Any, records: Any, field: Any, where: Any, values: Any) -> Any:
    """Store numbers, or blocks of them, as ``numbers`` reads them."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _fields(context, builder, signature.args, arguments[0], signature.args[2], arguments[2])
        _stored(builder, places, _unpacked(builder, values, arguments[3]))
        return context.get_dummy_value()

    return types.void(records, field, where, values), build


@intrinsic(prefer_literal=True)
def add_numbers(_typing_context: Any, records: Any, field: Any, where: Any, some: Any, values: Any) -> Any:
    """Add numbers, or blocks of them, to those of a field of the first so many records, which may be the same ones.

    The last comes first, as sweeps inward have it.
    """

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _fields(context, builder, signature.args, arguments[0], signature.args[2], arguments[2])
        rows = _rows(builder, len(places), _unpacked(builder, values, arguments[4]))
        for lane, (place, row) in reversed(list(enumerate(zip(places, rows, strict=True)))):
            with builder.if_then(builder.icmp_signed(">", arguments[3], INDEX(lane))):
                _each(builder, place, row, lambda at, value: builder.fadd(builder.load(at, align=8), value))
        return context.get_dummy_value()

    return types.void(records, field, where, types.intp, values), build


@intrinsic(prefer_literal=True)
def elements(_typing_context: Any, array: Any, count: Any, where: Any) -> Any:
    """The numbers of an array from an index on, or blocks of those from four indices on."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _elements(context, builder, array, arguments[0], where, arguments[2])
        return _loaded(context, builder, signature.return_type, places, count.literal_value)

    return _several(where, count.literal_value)(array, count, where), build


@intrinsic
def put_elements(_typing_context: Any, array: Any, where: Any, values: Any) -> Any:
    """Store numbers, or blocks of them, as ``elements`` reads them."""

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        places = _elements(context, builder, array, arguments[0], where, arguments[1])
        _stored(builder, places, _unpacked(builder, values, arguments[2]))
        return context.get_dummy_value()

    return types.void(array, where, values), build


@intrinsic(prefer_literal=True)
def integers(_typing_context: Any, records: Any, field: Any, where: Any) -> Any:
    """A whole number of the record that is where, an index, or those of four."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _fields(context, builder, signature.args, arguments[0], where, arguments[2])
        found = [builder.load(builder.bitcast(place, INDEX.as_pointer())) for place in places]
        return found[0] if len(found) == 1 else context.make_tuple(builder, signature.return_type, found)

    made = types.intp if isinstance(where, types.Integer) else types.UniTuple(types.intp, where.count)
    return made(records, field, where), build


def _several(where: Any, count: int) -> Any:
    """The type of so many numbers, or of blocks."""
    kind = types.float64 if isinstance(where, types.Integer) else BlockType(where.count)
    return kind if count == 1 else types.UniTuple(kind, count)


def _fields(context: Any, builder: Any, kinds: Any, records: Any, where: Any, indices: Any) -> list[Any]:
    """Where a field begins in each of the records."""
    record, offset = kinds[0].dtype, kinds[0].dtype.offset(kinds[1].literal_value)
    data = builder.bitcast(context.make_array(kinds[0])(context, builder, records).data, BYTE.as_pointer())
    out = []
    for each in _unpacked(builder, where, indices):
        byte = builder.add(builder.mul(each, each.type(record.size)), each.type(offset))
        out.append(builder.bitcast(builder.gep(data, [byte]), DOUBLE.as_pointer()))
    return out


def _elements(context: Any, builder: Any, kind: Any, array: Any, where: Any, indices: Any) -> list[Any]:
    """Where in an array the numbers of each of the indices begin."""
    data = context.make_array(kind)(context, builder, array).data
    return [builder.gep(data, [each]) for each in _unpacked(builder, where, indices)]


def _unpacked(builder: Any, kind: Any, values: Any) -> list[Any]:
    return cgutils.unpack_tuple(builder, values) if isinstance(kind, types.BaseTuple) else [values]


def _loaded(context: Any, builder: Any, made: Any, places: list[Any], count: int) -> Any:
    """So many numbers that begin at each of the places."""
    if len(places) == 1:
        out = [builder.load(_at(builder, places[0], k)) for k in range(count)]
    else:
        out = []
        for k in range(0, count - 1, 2):
            a, b, c, d = (builder.load(_pair(builder, _at(builder, place, k)), align=8) for place in places)
            even, odd = _shuffled(builder, a, c, [0, 1, 2, 3]), _shuffled(builder, b, d, [0, 1, 2, 3])
            out += [_shuffled(builder, even, odd, [0, 4, 2, 6]), _shuffled(builder, even, odd, [1, 5, 3, 7])]
        if count % 2:
            block = ir.VectorType(DOUBLE, len(places))(ir.Undefined)
            for lane, place in enumerate(places):
                block = builder.insert_element(block, builder.load(_at(builder, place, count - 1)), LANE(lane))
            out.append(block)
    return out[0] if count == 1 else context.make_tuple(builder, made, out)


def _stored(builder: Any, places: list[Any], values: list[Any]) -> None:
    """Store values so that they begin at each of the places."""
    for place, row in zip(places, _rows(builder, len(places), values), strict=True):
        _each(builder, place, row, lambda _at, value: value)


def _each(builder: Any, place: Any, row: list[Any], value: Callable[[Any, Any], Any]) -> None:
    """Store what becomes of each part of a row, a number or a pair, from a place on."""
    k = 0
    for part in row:
        paired = part.type == PAIR
        at = _pair(builder, _at(builder, place, k)) if paired else _at(builder, place, k)
        builder.store(value(at, part), at, align=8)
        k += 2 if paired else 1


def _rows(builder: Any, lanes: int, values: list[Any]) -> list[list[Any]]:
    """What each lane has of the values: pairs, and a last number where their number is odd."""
    if lanes == 1:
        pairs = [
            builder.insert_element(builder.insert_element(PAIR(ir.Undefined), a, LANE(0)), b, LANE(1))
            for a, b in zip(values[::2], values[1::2], strict=False)
        ]
        return [pairs + values[2 * len(pairs) :]]
    out: list[list[Any]] = [[] for _ in range(lanes)]
    for k in range(0, len(values) - 1, 2):
        even = _shuffled(builder, values[k], values[k + 1], [0, 4, 2, 6])
        odd = _shuffled(builder, values[k], values[k + 1], [1, 5, 3, 7])
        for row, block, half in zip(out, (even, odd, even, odd), ([0, 1], [0, 1], [2, 3], [2, 3]), strict=True):
            row.append(_shuffled(builder, block, block, half))
    if len(values) % 2:
        for lane, row in enumerate(out):
            row.append(builder.extract_element(values[-1], LANE(lane)))
    return out


def _shuffled(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.VectorType(LANE, len(order))(order))


def _at(builder: Any, place: Any, k: int) -> Any:
    return builder.gep(place, [INDEX(k)])


def _pair(builder: Any, place: Any) -> Any:
    return builder.bitcast(place, PAIR.as_pointer())
