"""Reflections four at a time, for factors of many errors: each pass over the matrix does what four passes did.

A product of reflections 1 - tau v v^T is 1 - V S V^T with S triangular (compact WY form: Schreiber and Van Loan 1989). Four
columns are reduced by themselves first; the others are then moved from memory and back once instead of four times.
"""

import math

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.blocks import NARROW, get_block, put_block
from physics_prior.dynamics.covariance import triangularise_from
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array

WIDTH = 4
FEW = 24  # columns that are left: not worth it

Four = tuple[float, float, float, float]


def scratch_size(N: int, n: int) -> int:
    """Numbers that ``triangularise_in_blocks`` needs for (N, n)."""
    return WIDTH * (N + WIDTH + 1) + N + n


@kernel
def triangularise_in_blocks(T: Array, count: int, scratch: Array) -> None:
    """Clear the first ``count`` columns of T (N, n) below the diagonal as ``triangularise`` does. scratch (``scratch_size``,)."""
    N, n = T.shape
    V, rest = scratch[: WIDTH * N].reshape(N, WIDTH), scratch[WIDTH * N :]
    dots, scales = rest[: WIDTH * WIDTH].reshape(WIDTH, WIDTH), rest[WIDTH * WIDTH : WIDTH * (WIDTH + 1)]
    i = 0
    while n - i > FEW and min(count, N) - i >= WIDTH:
        end = N
        while end > i + WIDTH and _is_nothing(T[end - 1], i):
            end -= 1
        _reflect_block(T, i, end, V, dots, scales)
        right = i + WIDTH
        whole = n - (n - right) % NARROW
        for column in range(right, whole, NARROW):
            _reflect_columns(T, i, end, V, dots, scales, column, NARROW)
        if whole < n:
            _reflect_columns(T, i, end, V, dots, scales, whole, n - whole)
        for k in range(i, right):
            own = T[k, k:]
            if own[0] < 0.0:
                for j in range(n - k):
                    own[j] = -own[j]
        i = right
    triangularise_from(T, i, count, rest)


@inline_kernel
def _reflect_columns(T: Array, i: int, end: int, V: Array, dots: Array, scales: Array, column: int, some: int) -> None:
    """Reflect some columns of T, at most NARROW, from row i on: what they lose of V's columns stays in registers."""
    n = T.shape[1]
    a = b = c = d = get_block(T, column, NARROW, 0)
    for k in range(i, end):
        x = get_block(T, k * n + column, NARROW, some)
        a, b, c, d = fma(V[k, 0], x, a), fma(V[k, 1], x, b), fma(V[k, 2], x, c), fma(V[k, 3], x, d)
    a = scales[0] * a
    b = scales[1] * fma(-dots[1, 0], a, b)
    c = scales[2] * fma(-dots[2, 1], b, fma(-dots[2, 0], a, c))
    d = scales[3] * fma(-dots[3, 2], c, fma(-dots[3, 1], b, fma(-dots[3, 0], a, d)))
    for k in range(i, end):
        x = get_block(T, k * n + column, NARROW, some)
        x = fma(-V[k, 3], d, fma(-V[k, 2], c, fma(-V[k, 1], b, fma(-V[k, 0], a, x))))
        put_block(T, k * n + column, x, some)


@kernel
def _reflect_block(T: Array, i: int, end: int, V: Array, dots: Array, scales: Array) -> None:
    """Reduce the columns of T from i on, WIDTH of them, whose rows end before ``end``.

    Fill V (N, WIDTH) with the Householder vectors, scales (WIDTH,) with 2 over their squared lengths, and the lower part of dots
    (WIDTH, WIDTH) with their products.
    """
    for k in range(i, end):
        for e in range(WIDTH):
            V[k, e] = T[k, i + e]
            T[k, i + e] = 0.0
    for c in range(WIDTH):
        first, even, odd = i + c, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
        whole = end - (end - first) % 2
        for k in range(first, whole, 2):
            even, odd = _onto(even, V[k, c], V[k]), _onto(odd, V[k + 1, c], V[k + 1])
        if whole < end:
            even = _onto(even, V[whole, c], V[whole])
        own, row = dots[c], V[first]
        own[0], own[1], own[2], own[3] = even[0] + odd[0], even[1] + odd[1], even[2] + odd[2], even[3] + odd[3]
        norm, head, pivot, scales[c] = math.sqrt(own[c]), row[c], 0.0, 0.0
        if norm > 0.0:
            pivot, scales[c] = -norm if head > 0.0 else norm, 1.0 / (norm * (norm + abs(head)))
            for e in range(WIDTH):
                own[e] -= pivot * row[e]
            row[c] = head - pivot
        q = -scales[c] * own[1] if c < 1 else 0.0
        r = -scales[c] * own[2] if c < 2 else 0.0
        s = -scales[c] * own[3] if c < 3 else 0.0
        for k in range(first, end):
            x, u = V[k], V[k, c]
            x[1], x[2], x[3] = fma(q, u, x[1]), fma(r, u, x[2]), fma(s, u, x[3])
        T[first, first] = pivot
        for e in range(c + 1, WIDTH):
            T[first, i + e], row[e] = row[e], 0.0


@inline_kernel
def _onto(total: Four, u: float, row: Array) -> Four:
    """The total + u times the row."""
    return fma(u, row[0], total[0]), fma(u, row[1], total[1]), fma(u, row[2], total[2]), fma(u, row[3], total[3])


@inline_kernel
def _is_nothing(row: Array, first: int) -> bool:
    """Whether WIDTH numbers of a row are zero."""
    zeros = 0
    while zeros < WIDTH and row[first + zeros] == 0.0:
        zeros += 1
    return zeros == WIDTH
