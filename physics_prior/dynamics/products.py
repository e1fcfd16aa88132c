"""Products of matrices, added where they belong: many columns of a row stay in registers while those of others are added."""

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.blocks import NARROW, WIDE, get_block, put_block
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array


@kernel
def add_product(a: Array, first: int, b: Array, out: Array) -> None:
    """Add the rows of a (n, .), from the first column on, times b (m, k) to the first k columns of out (n, .), all in C order."""
    k = b.shape[1]
    whole = k - k % WIDE
    for column in range(0, whole, WIDE):
        _add_product_to_columns(a, first, b, column, WIDE, WIDE, out)
    for column in range(whole, k, NARROW):
        _add_product_to_columns(a, first, b, column, NARROW, min(k - column, NARROW), out)


@inline_kernel
def _add_product_to_columns(a: Array, first: int, b: Array, column: int, count: int, some: int, out: Array) -> None:
    """Do so for some columns, at most count: those of two rows stay in registers, as long as neither row is zero there."""
    n, m, k, width = a.shape[0], b.shape[0], b.shape[1], out.shape[1]
    for i in range(0, n, 2):
        other = min(i + 1, n - 1)
        begin, end = 0, m
        while begin < end and a[i, first + begin] == 0.0 and a[other, first + begin] == 0.0:
            begin += 1
        while end > begin and a[i, first + end - 1] == 0.0 and a[other, first + end - 1] == 0.0:
            end -= 1
        x = get_block(out, i * width + column, count, some)
        y = get_block(out, other * width + column, count, some)
        for j in range(begin, end):
            row = get_block(b, j * k + column, count, some)
            x, y = fma(a[i, first + j], row, x), fma(a[other, first + j], row, y)
        put_block(out, i * width + column, x, some)
        put_block(out, other * width + column, y, some)


@kernel
def subtract_transposed_product(a: Array, b: Array, out: Array) -> None:
    """Subtract the product of a^T, a (m, n), and b (m, k) from out (n, k)."""
    for i in range(out.shape[0]):
        row = out[i]
        for j in range(a.shape[0]):
            p, x = a[j, i], b[j]
            for c in range(row.shape[0]):
                row[c] -= p * x[c]
