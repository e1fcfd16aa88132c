"""What a frame of many markers does to the square root of a covariance: as many reflections as there are freedoms.

U (n, n), P = U^T U, is triangular in its first h columns, those of the errors that are seen: with z of unit covariance these are
S z, S = U^T, h numbers of z and no more. Rows H and y, whitened, are then y ~ A z with A = H S, and reflections bring

    [ 1  0 ]        [ R  c ]
    [ A  y ]   to   [ 0  r ]

(Bierman 1977, ch. 4): R^T R is the inverse of what the covariance of z becomes, R^-1 c where it is, and the squared length of r
is that of y whitened by its covariance.
"""

import math
from typing import Any

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.arrays import clear, copy
from physics_prior.dynamics.blocks import NARROW, WIDE, get_block, put_block
from physics_prior.dynamics.covariance import add_rows
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array
from physics_prior.dynamics.views import FLOAT, array_at
from physics_prior.estimation.reflection import reflect_onto


def work_size(m: int, h: int) -> int:
    """Numbers that a frame of m rows needs for h errors that are seen."""
    width = h + 1 + -(h + 1) % NARROW
    return (h + m) * width + h * h + width + 2 * h


@inline_kernel
def _sections(work: Array, m: int, h: int) -> Any:
    """R (h, w), A (m, w) with y beside it, S (h, h), and vectors (w,), (h,) and (h,); rows of w fill whole registers."""
    width = h + 1 + (NARROW - (h + 1) % NARROW) % NARROW
    a = h * width
    s = a + m * width
    v = s + h * h
    return (
        array_at(work, 0, (h, width), FLOAT),
        array_at(work, a, (m, width), FLOAT),
        array_at(work, s, (h, h), FLOAT),
        array_at(work, v, width, FLOAT),
        array_at(work, v + width, h, FLOAT),
        array_at(work, v + width + h, h, FLOAT),
    )


@inline_kernel
def _see(H: Array, U: Array, S: Array, A: Array) -> None:
    """Fill S (h, h), and the first h columns of A (m, w) with H S, H (m, h)."""
    m, h = H.shape
    width = A.shape[1]
    clear(A)
    for i in range(h):
        for j in range(h):
            S[i, j] = U[j, i]
    for begin in range(0, h, NARROW):
        some = min(h - begin, NARROW)
        for r in range(m):
            own = get_block(S, begin, NARROW, 0)
            for j in range(begin, h):
                own = fma(H[r, j], get_block(S, j * h + begin, NARROW, some), own)
            put_block(A, r * width + begin, own, some)


@kernel
def block_squares(H: Array, y: Array, U: Array, work: Array, L: Array, white: Array, out: Array) -> None:
    """Fill out (k,) with the normalised innovation squared of each block of an innovation alone, H (k block, h), y (k block,).

    Both are whitened: a block's covariance is 1 + a a^T with a of its rows of A, of which reflections turn [1 a] into a lower
    factor, whose diagonal is 1 and more, however little is known. L (block, block) and white (block,) are scratch.
    """
    (m, h), block = H.shape, L.shape[0]
    _, A, S, _, _, _ = _sections(work, m, h)
    _see(H, U, S, A)
    for index in range(out.shape[0]):
        first, out[index] = block * index, 0.0
        for i in range(block):
            own, square = A[first + i], 0.0
            for k in range(h):
                square = fma(own[k], own[k], square)
            norm = math.sqrt(1.0 + square)
            lead, scale = 1.0 + norm, 1.0 / (norm * (norm + 1.0))
            L[i, i] = norm
            for j in range(i + 1, block):
                other, share = A[first + j], 0.0
                for k in range(h):
                    share = fma(other[k], own[k], share)
                share *= scale
                L[j, i] = lead * share
                for k in range(h):
                    other[k] = fma(-share, own[k], other[k])
            white[i] = y[first + i]
            for j in range(i):
                white[i] -= L[i, j] * white[j]
            white[i] /= norm
            out[index] += white[i] * white[i]


@kernel
def reflect_frame(
    U: Array, H: Array, noise: Array, y: Array, about: Array, work: Array, correction: Array
) -> tuple[float, float, float]:
    """``reflect`` of a frame: H (m, h) of the first h errors and y (m,), whitened by noise; fill in work (``work_size``,) R."""
    m, h = H.shape
    R, A, S, share, leads, scales = _sections(work, m, h)
    _see(H, U, S, A)
    for r in range(m):
        A[r, h] = y[r]
        for j in range(h):
            A[r, h] = fma(H[r, j], about[j], A[r, h])
    clear(R)
    for i in range(h):
        R[i, i] = 1.0
    reflect_onto(R, A, share, leads, scales)
    nis, determinant = 0.0, 0.0
    for r in range(m):
        nis = fma(A[r, h], A[r, h], nis)
        determinant += 2.0 * math.log(noise[r, r])
    for i in range(h - 1, -1, -1):
        determinant += 2.0 * math.log(R[i, i])
        leads[i] = R[i, h]
        for j in range(i + 1, h):
            leads[i] = fma(-R[i, j], leads[j], leads[i])
        leads[i] /= R[i, i]
    clear(correction)
    add_rows(leads, U[:h], correction)
    largest = 0.0
    for j in range(h):
        largest = max(largest, abs(correction[j] - about[j]))
    return nis, determinant, largest


@kernel
def apply_frame(work: Array, m: int, h: int, U: Array, out: Array) -> None:
    """Fill out (n, n) with the posterior's factor, transposed: R^-T of the first h rows of U, and the others."""
    n = U.shape[0]
    R, _, _, _, _, _ = _sections(work, m, h)
    narrow = n - n % WIDE
    for begin in range(0, narrow, WIDE):
        _divide_columns(R, U, begin, WIDE, WIDE, out)
    for begin in range(narrow, n, NARROW):
        _divide_columns(R, U, begin, NARROW, min(n - begin, NARROW), out)
    copy(U[h:], out[h:])


@inline_kernel
def _divide_columns(R: Array, U: Array, begin: int, count: int, some: int, out: Array) -> None:
    """Do so for some, at most count, columns of the first rows."""
    n = U.shape[0]
    for i in range(R.shape[0]):
        own = get_block(U, i * n + begin, count, some)
        for j in range(i):
            own = fma(-R[j, i], get_block(out, j * n + begin, count, some), own)
        put_block(out, i * n + begin, (1.0 / R[i, i]) * own, some)
