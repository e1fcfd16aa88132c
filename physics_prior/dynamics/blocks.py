"""Several numbers side by side in vector registers, where loops over them would leave them in memory.

A block is a value, as a float is. Its sums have an order that is written here: bits do not depend on where it is inlined.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

DOUBLE, LANE = ir.DoubleType(), ir.IntType(32)
REGISTER = 4  # numbers that a sum of products takes at once


class BlockType(types.Type):  # type: ignore[misc]
    """Numba's type of a block of so many floats."""

    def __init__(self, count: int) -> None:
        super().__init__(f"Block({count})")
        self.count = count


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, block: BlockType) -> None:
        super().__init__(manager, block, ir.VectorType(DOUBLE, block.count))


@intrinsic(prefer_literal=True)
def get_block(_typing_context: Any, array: Any, begin: Any, count: Any, some: Any) -> Any:
    """A block of count numbers, a constant, of an array in C order, from its begin-th on; zeros in place of all but ``some``."""
    block = BlockType(count.literal_value)

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place, mask = _lanes(context, builder, signature.args[0], arguments[0], arguments[1], arguments[3], block)
        vector = context.get_value_type(block)
        signature = ir.FunctionType(vector, [place.type, LANE, mask.type, vector])
        load = cgutils.get_or_insert_function(builder.module, signature, f"llvm.masked.load.v{block.count}f64.p0")
        return builder.call(load, [place, LANE(8), mask, vector(None)])

    return block(array, types.intp, count, types.intp), build


@intrinsic
def put_block(_typing_context: Any, array: Any, begin: Any, block: Any, some: Any) -> Any:
    """Store the first ``some`` numbers of a block in an array in C order, from its begin-th on."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place, mask = _lanes(context, builder, signature.args[0], arguments[0], arguments[1], arguments[3], block)
        signature = ir.FunctionType(ir.VoidType(), [arguments[2].type, place.type, LANE, mask.type])
        store = cgutils.get_or_insert_function(builder.module, signature, f"llvm.masked.store.v{block.count}f64.p0")
        builder.call(store, [arguments[2], place, LANE(8), mask])
        return context.get_dummy_value()

    return types.void(array, types.intp, block, types.intp), build


@intrinsic
def scale_block(_typing_context: Any, s: Any, block: Any) -> Any:
    """The product s b of a number and a block."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fmul(_spread(builder, arguments[0], block.count), arguments[1])

    return block(types.float64, block), build


@intrinsic
def minus_scaled(_typing_context: Any, b: Any, s: Any, a: Any) -> Any:
    """The block b - s a, rounded once."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        share = builder.fneg(_spread(builder, arguments[1], b.count))
        return _fma(builder, share, arguments[2], arguments[0])

    return b(b, types.float64, b), build


@intrinsic
def inner(_typing_context: Any, a: Any, b: Any) -> Any:
    """The inner product of two blocks, of which the shorter ends in a register's end."""
    count = min(a.count, b.count)

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        def part(block: Any, lanes: list[int]) -> Any:
            return builder.shuffle_vector(block, block.type(ir.Undefined), ir.VectorType(LANE, len(lanes))(lanes))

        total = None
        for begin in range(0, count, REGISTER):
            x, y = (part(block, list(range(begin, begin + REGISTER))) for block in arguments)
            total = builder.fmul(x, y) if total is None else _fma(builder, x, y, total)
        halves = builder.fadd(part(total, [0, 1]), part(total, [2, 3]))
        return builder.fadd(builder.extract_element(halves, LANE(0)), builder.extract_element(halves, LANE(1)))

    return types.float64(a, b), build


def _lanes(
    context: Any, builder: Any, kind: Any, array: Any, begin: Any, some: Any, block: BlockType
) -> tuple[Any, Any]:
    """The address of a block in an array, and which of its lanes are before ``some``."""
    data = context.make_array(kind)(context, builder, array).data
    place = builder.bitcast(builder.gep(data, [begin]), context.get_value_type(block).as_pointer())
    order = ir.VectorType(some.type, block.count)(list(range(block.count)))
    return place, builder.icmp_signed("<", order, _spread(builder, some, block.count))


def _fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """The vector a b + c, rounded once."""
    kind = ir.FunctionType(c.type, [c.type] * 3)
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{c.type.count}f64")
    return builder.call(function, [a, b, c])


def _spread(builder: Any, number: Any, count: int) -> Any:
    """A vector of count times a number."""
    vector = ir.VectorType(number.type, count)
    one = builder.insert_element(vector(ir.Undefined), number, LANE(0))
    return builder.shuffle_vector(one, vector(ir.Undefined), ir.VectorType(LANE, count)([0] * count))
