"""Several numbers side by side in vector registers, where loops over them would leave them in memory.

A block is a value, as a float is. Its sums have an order that is written here: bits do not depend on where it is inlined.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

DOUBLE, LANE = ir.DoubleType(), ir.IntType(32)
REGISTER = 4  # numbers that a sum of products takes at once
NARROW, WIDE = 8, 32  # columns that loops over others leave in registers, and more of them where there are as many


class BlockType(types.Type):  # type: ignore[misc]
    """Numba's type of a block of so many floats."""

    def __init__(self, count: int) -> None:
        super().__init__(f"Block({count})")
        self.count = count


@register_model(BlockType)
class _BlockModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, block: BlockType) -> None:
        super().__init__(manager, block, ir.VectorType(DOUBLE, block.count))


def _define(operation: Any, instruction: str, *kinds: tuple[Any, ...]) -> None:
    """Let blocks, or a block and a number, be added and so on: what algebra.py says of numbers holds of blocks too."""

    def generic(_self: Any, args: tuple[Any, ...], _kws: Any) -> Any:
        block = next((each for each in args if isinstance(each, BlockType)), None)
        return signature(block, *args) if block and set(args) <= {block, types.float64} else None

    def lower(_context: Any, builder: Any, found: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*spread(builder, found.return_type, found.args, args))

    infer_global(operation)(type(f"Block_{instruction}", (AbstractTemplate,), {"generic": generic}))
    for each in kinds:
        lower_builtin(operation, *each)(lower)


_PAIRS = (BlockType, BlockType), (types.Float, BlockType), (BlockType, types.Float)
_define(operator.add, "fadd", *_PAIRS)
_define(operator.sub, "fsub", *_PAIRS)
_define(operator.mul, "fmul", *_PAIRS)
_define(operator.truediv, "fdiv", *_PAIRS)
_define(operator.neg, "fneg", (BlockType,))


@intrinsic
def lanes_of(_typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """A block of four numbers, the last zero."""
    block = BlockType(4)

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _filled(builder, block, arguments)

    return block(types.float64, types.float64, types.float64), build


@intrinsic
def beside(_typing_context: Any, like: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """A block of four numbers, if that is what it is to be like; if a number, the first."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _filled(builder, like, arguments[1:]) if isinstance(like, BlockType) else arguments[1]

    return like(like, *[types.float64] * 4), build


def _filled(builder: Any, block: BlockType, numbers: Any) -> Any:
    """A block that begins with some numbers, zeros behind them."""
    vector = ir.VectorType(DOUBLE, block.count)(None)
    for lane, each in enumerate(numbers):
        vector = builder.insert_element(vector, each, LANE(lane))
    return vector


@intrinsic(prefer_literal=True)
def lane(_typing_context: Any, block: Any, index: Any) -> Any:
    """A number of a block, the index a constant; a number is all lanes of itself."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return (
            builder.extract_element(arguments[0], LANE(index.literal_value))
            if isinstance(block, BlockType)
            else arguments[0]
        )

    return types.float64(block, index), build


@intrinsic
def nothing(_typing_context: Any, like: Any) -> Any:
    """Zero, or a block of zeros, like another."""
    return like(like), lambda context, _builder, _signature, _arguments: context.get_value_type(like)(
        0.0 if like == types.float64 else None
    )


@intrinsic
def at_most(_typing_context: Any, a: Any, b: Any) -> Any:
    """Whether all numbers of a block are at most those of another, or a number; or a number is at most another."""
    block = next((each for each in (a, b) if isinstance(each, BlockType)), None)

    def build(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if block is None:
            return builder.fcmp_ordered("<=", *arguments)
        holds = builder.fcmp_ordered("<=", *spread(builder, block, signature.args, arguments))
        bits = builder.bitcast(holds, ir.IntType(block.count))
        return builder.icmp_unsigned("==", bits, bits.type((1 << block.count) - 1))

    kinds = [each if isinstance(each, BlockType) else types.float64 for each in (a, b)]
    return types.boolean(*kinds), build


@intrinsic
def either(_typing_context: Any, a: Any, b: Any, x: Any, y: Any) -> Any:
    """The number x where a is at most b, else y; or a block of such numbers."""
    block = next((each for each in (a, b, x, y) if isinstance(each, BlockType)), None)

    def build(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if block is not None:
            arguments = spread(builder, block, signature.args, arguments)
        return builder.select(builder.fcmp_ordered("<=", arguments[0], arguments[1]), arguments[2], arguments[3])

    kinds = [each if isinstance(each, BlockType) else types.float64 for each in (a, b, x, y)]
    return (block or types.float64)(*kinds), build


def _alone(function: str, meaning: str) -> Any:
    """An intrinsic of one number or block, by the name that LLVM has for it."""

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        kind = arguments[0].type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        called = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(kind, [kind]), f"llvm.{function}.{suffix}"
        )
        return builder.call(called, arguments)

    def typed(_typing_context: Any, a: Any) -> Any:
        return a(a), build

    typed.__name__, typed.__doc__ = function, meaning
    return intrinsic(typed)


size = _alone("fabs", "The size of a number, or of those of a block.")
root = _alone("sqrt", "The square root of a number, or of those of a block.")


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
def inner(_typing_context: Any, a: Any, b: Any) -> Any:
    """The inner product of two blocks, of which the shorter ends in a register's end."""
    count = min(a.count, b.count)

    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        def part(block: Any, lanes: list[int]) -> Any:
            return builder.shuffle_vector(block, block.type(ir.Undefined), ir.VectorType(LANE, len(lanes))(lanes))

        total = None
        for begin in range(0, count, REGISTER):
            x, y = (part(block, list(range(begin, begin + REGISTER))) for block in arguments)
            total = builder.fmul(x, y) if total is None else fused(builder, x, y, total)
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


def fused(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """The vector a b + c, rounded once."""
    kind = ir.FunctionType(c.type, [c.type] * 3)
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fma.v{c.type.count}f64")
    return builder.call(function, [a, b, c])


def spread(builder: Any, block: BlockType, kinds: Any, arguments: Any) -> list[Any]:
    """The arguments of an operation on blocks, numbers as blocks of themselves."""
    return [
        each if isinstance(kind, BlockType) else _spread(builder, each, block.count)
        for kind, each in zip(kinds, arguments, strict=True)
    ]


def _spread(builder: Any, number: Any, count: int) -> Any:
    """A vector of count times a number."""
    vector = ir.VectorType(number.type, count)
    one = builder.insert_element(vector(ir.Undefined), number, LANE(0))
    return builder.shuffle_vector(one, vector(ir.Undefined), ir.VectorType(LANE, count)([0] * count))
