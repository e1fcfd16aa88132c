"""What an innovation does to the square root of a covariance, by reflections that are found first and applied when asked.

With U (n, n), P = U^T U, and the noise's lower factor, orthogonal reflections bring

    [ noise^T  0 ]                          [ R  R^-T H P          ]
    [ U H^T    U ], (m + n, m + n),   to    [ 0  posterior factor  ], all transposed

(Kailath, Sayed and Hassibi 2000, ch. 12). The left columns alone tell them: R^T R is the innovation's covariance, and the
correction P H^T (R^T R)^-1 y is U^T z with z the lower part of the reflections, backwards, of [R^-T y; 0]. Their product is
1 - V S V^T (compact WY form: Schreiber and Van Loan 1989), so that the posterior's factor is two products with U. The upper part
of V is diagonal, for noise^T is triangular and stays so; below it stand the columns B.
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


def work_size(m: int, n: int) -> int:
    """Numbers that the reflections of m rows for n errors need."""
    width = m + -m % NARROW
    return (2 * m + n) * width + width + 3 * m + n + m * n


@inline_kernel
def _sections(work: Array, m: int, n: int) -> Any:
    """R (m, w), B (n, w), products (m, w), scales (m,), rows (m, n), and what only ``reflect`` needs: (w,), (m,), (m,) and (n,).

    Rows of w, the next multiple of NARROW, fill whole registers.
    """
    width = m + (NARROW - m % NARROW) % NARROW
    b = m * width
    p = b + n * width
    c = p + m * width
    r = c + m
    v = r + m * n
    return (
        array_at(work, 0, (m, width), FLOAT),
        array_at(work, b, (n, width), FLOAT),
        array_at(work, p, (m, width), FLOAT),
        array_at(work, c, m, FLOAT),
        array_at(work, r, (m, n), FLOAT),
        array_at(work, v, width, FLOAT),
        array_at(work, v + width, m, FLOAT),
        array_at(work, v + width + m, m, FLOAT),
        array_at(work, v + width + 2 * m, n, FLOAT),
    )


@kernel
def reflect(
    U: Array, H: Array, first: int, noise: Array, y: Array, about: Array, work: Array, correction: Array
) -> tuple[float, float, float]:
    """Find the reflections for an innovation y (m,), to which the rows of H (h, m) make h errors, ``first`` of them on.

    It was found at the errors about (h,), so that y + H^T about meets the prior. Return the squared length of that, whitened,
    the logarithm of the determinant of its covariance, and the largest difference of these errors from where it was found;
    fill the correction (n,) and, in work (``work_size``,), R, B, the products of the columns of B above the diagonal, and the
    scales of ``reflect_onto``. noise (m, m): a lower factor.
    """
    m, n, h = H.shape[1], U.shape[0], H.shape[0]
    R, B, products, scales, _, share, white, leads, z = _sections(work, m, n)
    width = B.shape[1]
    clear(R)
    for i in range(m):
        for j in range(i, m):
            R[i, j] = noise[j, i]
    for begin in range(0, m, NARROW):
        some = min(m - begin, NARROW)
        for k in range(0, n, 2):
            other = min(k + 1, n - 1)
            a, b = get_block(H, begin, NARROW, 0), get_block(H, begin, NARROW, 0)
            for j in range(h):
                own = get_block(H, j * m + begin, NARROW, some)
                a, b = fma(U[k, first + j], own, a), fma(U[other, first + j], own, b)
            put_block(B, k * width + begin, a, NARROW)
            put_block(B, other * width + begin, b, NARROW)
    reflect_onto(R, B, share, leads, scales)
    copy(y, white)
    add_rows(about, H, white)
    nis, determinant = _whiten(R, white)
    for i in range(m):
        _products_with(B, i, share)
        for j in range(i + 1, m):
            products[i, j] = share[j]
    for i in range(m - 1, -1, -1):
        total = -leads[i] * white[i]
        for j in range(i + 1, m):
            total = fma(-products[i, j], share[j], total)
        share[i] = total * scales[i]
    for k in range(n):
        total = 0.0
        for i in range(m):
            total = fma(-share[i], B[k, i], total)
        z[k] = total
    clear(correction)
    add_rows(z, U, correction)
    largest = 0.0
    for j in range(h):
        largest = max(largest, abs(correction[first + j] - about[j]))
    return nis, determinant, largest


@kernel
def apply(work: Array, m: int, U: Array, out: Array) -> None:
    """Fill out (n, n) with the posterior's factor, transposed, from what ``reflect`` has found of m rows for U."""
    n = U.shape[0]
    _, B, products, scales, rows, _, _, _, _ = _sections(work, m, n)
    narrow = n - n % WIDE
    for begin in range(0, narrow, WIDE):
        _apply_to_columns(B, products, scales, U, begin, WIDE, WIDE, rows, out)
    for begin in range(narrow, n, NARROW):
        _apply_to_columns(B, products, scales, U, begin, NARROW, min(n - begin, NARROW), rows, out)


@inline_kernel
def _apply_to_columns(
    B: Array, products: Array, scales: Array, U: Array, begin: int, count: int, some: int, rows: Array, out: Array
) -> None:
    """Do so for some, at most count, columns; two rows of what is found at once, so that what they are made of is read once."""
    m, n = rows.shape
    for i in range(0, m, 2):
        other = min(i + 1, m - 1)
        x, y = get_block(U, begin, count, 0), get_block(U, begin, count, 0)
        for k in range(n):
            own = get_block(U, k * n + begin, count, some)
            x, y = fma(B[k, i], own, x), fma(B[k, other], own, y)
        for j in range(i):
            own = get_block(rows, j * n + begin, count, some)
            x, y = fma(-products[j, i], own, x), fma(-products[j, other], own, y)
        x = scales[i] * x
        put_block(rows, i * n + begin, x, some)
        if other > i:
            put_block(rows, other * n + begin, scales[other] * fma(-products[i, other], x, y), some)
    for k in range(0, n, 2):
        other = min(k + 1, n - 1)
        x, y = get_block(U, k * n + begin, count, some), get_block(U, other * n + begin, count, some)
        for i in range(m):
            own = get_block(rows, i * n + begin, count, some)
            x, y = fma(-B[k, i], own, x), fma(-B[other, i], own, y)
        put_block(out, k * n + begin, x, some)
        put_block(out, other * n + begin, y, some)


@kernel
def reflect_onto(R: Array, B: Array, share: Array, leads: Array, scales: Array) -> None:
    """Bring R (m, w), upper triangular in its first m columns, with B (n, w) below it to an R with nothing below these columns.

    The columns of B stay as the reflections' vectors, below the leads (m,) on the diagonal; scales (m,) are 2 over their squared
    lengths. The diagonal of R is positive at the beginning and at the end. share (w,) is scratch; w a multiple of NARROW.
    """
    m, n, width = R.shape[0], B.shape[0], B.shape[1]
    for i in range(m):
        _products_with(B, i, share)
        head = R[i, i]
        norm = math.sqrt(fma(head, head, share[i]))
        leads[i], scales[i] = head + norm, 1.0 / (norm * (norm + head))
        for j in range(i + 1):
            share[j] = 0.0
        for j in range(i + 1, width):
            share[j] = fma(leads[i], R[i, j], share[j]) * scales[i]
            R[i, j] = fma(leads[i], share[j], -R[i, j])  # turned over: so the diagonal is positive
        R[i, i] = norm
        for begin in range(i - i % NARROW, width, NARROW):
            taken = get_block(share, begin, NARROW, NARROW)
            for k in range(n):
                at = k * width + begin
                put_block(B, at, fma(-B[k, i], taken, get_block(B, at, NARROW, NARROW)), NARROW)


@kernel
def _products_with(B: Array, i: int, out: Array) -> None:
    """Fill out (m,), from the block of i on, with the inner products of a column of B (n, m) with all."""
    n, width = B.shape
    for begin in range(i - i % NARROW, width, NARROW):
        whole = n - n % 2
        even, odd = get_block(B, begin, NARROW, 0), get_block(B, begin, NARROW, 0)
        for k in range(0, whole, 2):
            at = k * width + begin
            even = fma(B[k, i], get_block(B, at, NARROW, NARROW), even)
            odd = fma(B[k + 1, i], get_block(B, at + width, NARROW, NARROW), odd)
        if whole < n:
            even = fma(B[whole, i], get_block(B, whole * width + begin, NARROW, NARROW), even)
        put_block(out, begin, even + odd, NARROW)


@inline_kernel
def _whiten(R: Array, y: Array) -> tuple[float, float]:
    """Replace y (m,) by R^-T y, R upper in R (m, m): return its square, and the logarithm of det R^T R."""
    nis, determinant = 0.0, 0.0
    for i in range(y.shape[0]):
        for j in range(i):
            y[i] -= R[j, i] * y[j]
        y[i] /= R[i, i]
        nis += y[i] * y[i]
        determinant += 2.0 * math.log(R[i, i])
    return nis, determinant
