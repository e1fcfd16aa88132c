"""Arrays within arrays, without what a slice asks first: whether it begins before the beginning or ends behind the end."""

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import np_cfarray

from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Array

FLOAT = np.dtype(np.float64)


@intrinsic
def array_at(_typing_context: Any, array: Any, index: Any, shape: Any, dtype: Any) -> Any:
    """A bare array of that shape and dtype, C order, that begins at an element of an array: Numba's ``carray``, in one go."""
    made = types.Array(dtype.dtype, len(shape) if isinstance(shape, types.BaseTuple) else 1, "C")

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(array)(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), context.get_value_type(types.voidptr))
        return np_cfarray(context, builder, made(types.voidptr, shape), (address, arguments[2]))

    return made(array, types.intp, shape, dtype), build


@inline_kernel
def three_rows(matrix: Array, r: int, count: int, column: int) -> tuple[Array, Array, Array]:
    """Three rows of a matrix in C order from the r-th on, each from a column on; the last again where count is less."""
    return (
        _row(matrix, r, column),
        _row(matrix, r + min(count - 1, 1), column),
        _row(matrix, r + count - 1, column),
    )


@inline_kernel
def _row(matrix: Array, r: int, column: int) -> Array:
    row: Array = array_at(matrix, r * matrix.shape[1] + column, matrix.shape[1] - column, FLOAT)
    return row


@inline_kernel
def rows_at(matrix: Array, r: int, count: int, column: int) -> Array:
    """So many rows from the r-th on, each from a column on: as long as those of the matrix, behind whose end they reach."""
    rows: Array = array_at(matrix, r * matrix.shape[1] + column, (count, matrix.shape[1]), FLOAT)
    return rows
