"""The system of the constraint rows, A M^-1 A^T: its factor, and the multipliers that meet right sides.

Redundant rows leave it singular; the solve is then proximal (Carpentier 2021): regularised by 1e-10 of each row's own scale
(``weigh_rows``) and refined, so that motion is exact and multipliers are those of least norm, rows between other links weighted
by their scales. Where no row is near to depending on others, neither is needed. ``rows`` is one array
(m + 3, 2 w + 2 m + BOUNDS): Y | Z | A M^-1 A^T | its factor | bounds, and below them right side, answer and change; w counts the
degrees of freedom that the rows move. Behind the right side stands whether the rows are independent. Of A M^-1 A^T and its factor
only the entries above the diagonal and on it are kept, up to the row's bound: loops in a row couple neighbours only, and cost in
proportion to their number.
"""

import math

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.arrays import accumulate, clear, copy
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import BOUNDS
from physics_prior.dynamics.types import Array, Records

REGULARISATION = 1e-10  # of a row's scale: small steps are not safer near a singular configuration (design eq. 11)
INDEPENDENT = 1e-3  # of a row's scale: a smaller pivot calls for regularisation, and that for refinement
DEPENDENT = 1e3  # a pivot within this factor of the regularisation belongs to a row that adds nothing
REFINEMENTS = 3
EXACT = 1e-15  # of the right side: refinement stops there


@inline_kernel
def row_count(rows: Array) -> int:
    """The number m of rows."""
    return int(rows.shape[0] - 3)


@inline_kernel
def width(rows: Array) -> int:
    """The number of degrees of freedom that the rows move."""
    return int((rows.shape[1] - BOUNDS) // 2 - row_count(rows))


@inline_kernel
def independent(rows: Array) -> bool:
    """Whether the factor is that of the rows as they are, none of them near to depending on others."""
    return bool(rows[row_count(rows), rows.shape[1] - BOUNDS] > 0.0)


@inline_kernel
def bounds(rows: Array, r: int) -> tuple[int, int, int, int]:
    """Where a row's columns begin and end, the first row that it is coupled to, and that behind the last."""
    last = rows.shape[1] - BOUNDS
    return int(rows[r, last]), int(rows[r, last + 1]), int(rows[r, last + 2]), int(rows[r, last + 3])


@kernel
def factorize_rows(pairs: Records, rows: Array, regularisation: float, enough: float) -> tuple[int, float]:
    """Fill the Cholesky factor of A M^-1 A^T, regularised by a share of each row's scale; return the rank and the least pivot.

    Pivots are relative to their rows' scales. The first pair that has one that is not ``enough`` ends it. A pair's rows, three or
    fewer, go side by side: their sums do not wait for one another.
    """
    m, w = row_count(rows), width(rows)
    S, L, scales = 2 * w, 2 * w + m, rows[m + 2]
    rank, least = 0, math.inf
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        s, n = pair.first, pair.rows
        t, u = s + min(n - 1, 1), s + n - 1  # the last again where there are fewer
        first = bounds(rows, s)[2]
        shift_s, shift_t, shift_u = regularisation * scales[s], regularisation * scales[t], regularisation * scales[u]
        ss, st, su = rows[s, S + s] + shift_s, rows[s, S + t], rows[s, S + u]
        tt, tu, uu = rows[t, S + t] + shift_t, rows[t, S + u], rows[u, S + u] + shift_u
        for r in range(first, s):
            x, y, z = rows[r, S + s], rows[r, S + t], rows[r, S + u]
            for k in range(first, r):
                known = rows[k, L + r]
                x, y, z = fma(-known, rows[k, L + s], x), fma(-known, rows[k, L + t], y), fma(-known, rows[k, L + u], z)
            rows[r, L + s], rows[r, L + t], rows[r, L + u] = x, y, z
            inverse = rows[r, L + r]
            a, b = -x * inverse, -y * inverse
            ss, st, su = fma(a, x, ss), fma(a, y, st), fma(a, z, su)
            tt, tu, uu = fma(b, y, tt), fma(b, z, tu), fma(-z * inverse, z, uu)
        for r in range(first, s):
            inverse = rows[r, L + r]
            x, y, z = rows[r, L + s] * inverse, rows[r, L + t] * inverse, rows[r, L + u] * inverse
            rows[r, L + s], rows[r, L + t], rows[r, L + u] = x, y, z
        share, inverse, counts = _pivot(ss, shift_s, scales[s])
        rank += counts
        rows[s, L + s] = inverse
        if n > 1:
            a = st * inverse
            rows[s, L + t] = a
            tt, tu = fma(-a, st, tt), fma(-a, su, tu)
            b = su * inverse
            own, inverse, counts = _pivot(tt, shift_t, scales[t])
            rank, share = rank + counts, min(share, own)
            rows[t, L + t] = inverse
            if n > 2:
                c = tu * inverse
                rows[s, L + u], rows[t, L + u] = b, c
                own, inverse, counts = _pivot(fma(-c, tu, fma(-b, su, uu)), shift_u, scales[u])
                rank, share = rank + counts, min(share, own)
                rows[u, L + u] = inverse
        if pair.active:
            least = min(least, share)
        if least < enough:
            break
    return rank, least


@inline_kernel
def _pivot(pivot: float, shift: float, scale: float) -> tuple[float, float, int]:
    """A pivot relative to its row's scale, its inverse, and what its row adds to the rank; shift: by which it is regularised."""
    counts = 1 if pivot > DEPENDENT * shift else 0
    pivot = max(pivot, 1e-3 * shift)
    return pivot / scale, 1.0 / pivot if pivot > 0.0 else 0.0, counts


@kernel
def weigh_rows(pairs: Records, rows: Array, active: int) -> None:
    """Replace the rows' squared levers, m^2, among the changes by what the diagonal of A M^-1 A^T would be of usual levers.

    That is the mean squared lever of the active rows, over the inertia that the rows between two links meet. So a row is
    weak by its lever (a fold), not because a link elsewhere is light. Of rows between the same links it is one number, so
    that redundant ones share by least multipliers.
    """
    m, S, levers, first = row_count(rows), 2 * width(rows), 0.0, 0
    scales = rows[m + 2]
    for r in range(m):
        levers += scales[r]
    for p in range(pairs.shape[0]):
        pair, last = pairs[p], pairs[p].first + pairs[p].rows
        if p + 1 < pairs.shape[0] and pairs[p + 1].link_a == pair.link_a and pairs[p + 1].link_b == pair.link_b:
            continue
        mobility, own = 0.0, 0.0
        for r in range(first, last):
            mobility += rows[r, S + r]
            own += scales[r]
        scale = mobility / own * levers / active if own > 0.0 else 1.0
        for r in range(first, last):
            scales[r] = scale
        first = last


@kernel
def multiply(rows: Array) -> float:
    """Solve A M^-1 A^T answer = right side, proximally; return how much of the right side is left, relative to it.

    Fills the answer, spoils the right side.
    """
    m, w = row_count(rows), width(rows)
    left, answer, change = rows[m], rows[m + 1], rows[m + 2]
    if independent(rows):
        _solve(rows, answer)
        return 0.0
    size, rest = 0.0, 0.0
    for r in range(m):
        answer[r] = 0.0
        size = max(size, abs(left[r]))
    for _ in range(REFINEMENTS):
        _solve(rows, change)
        rest = 0.0
        for s in range(m):
            _, _, first, reach = bounds(rows, s)
            before, after = 0.0, 0.0
            for r in range(first, s):
                before = fma(rows[r, 2 * w + s], change[r], before)
            for r in range(s, reach):
                after = fma(rows[s, 2 * w + r], change[r], after)
            left[s] -= before + after
            answer[s] += change[s]
            rest = max(rest, abs(left[s]))
        if rest <= EXACT * size:
            break
    return rest / size if size > 0.0 else 0.0


@kernel
def multiply_once(rows: Array) -> None:
    """Do so without refinement: the answer is good to the regularisation, and the right side stays."""
    _solve(rows, rows[row_count(rows) + 1])


@inline_kernel
def _solve(rows: Array, out: Array) -> None:
    """Fill out (m,) from the right side by the regularised factor, three rows at a time: their sums do not wait for one another.

    Beyond a row's bounds the factor is zero.
    """
    m = row_count(rows)
    left, L, s = rows[m], 2 * width(rows) + m, 0
    while s + 2 < m:
        x, y, z = left[s], left[s + 1], left[s + 2]
        for r in range(bounds(rows, s)[2], s):
            known = out[r]
            x, y, z = (
                fma(-rows[r, L + s], known, x),
                fma(-rows[r, L + s + 1], known, y),
                fma(-rows[r, L + s + 2], known, z),
            )
        y = fma(-rows[s, L + s + 1], x, y)
        out[s], out[s + 1], out[s + 2] = x, y, fma(-rows[s + 1, L + s + 2], y, fma(-rows[s, L + s + 2], x, z))
        s += 3
    for t in range(s, m):
        x = left[t]
        for r in range(bounds(rows, t)[2], t):
            x = fma(-rows[r, L + t], out[r], x)
        out[t] = x
    for t in range(m - 1, s - 1, -1):
        x = out[t] * rows[t, L + t]
        for r in range(t + 1, bounds(rows, t)[3]):
            x = fma(-rows[t, L + r], out[r], x)
        out[t] = x
    while s > 0:
        s -= 3
        x, y, z = out[s] * rows[s, L + s], out[s + 1] * rows[s + 1, L + s + 1], out[s + 2] * rows[s + 2, L + s + 2]
        for r in range(s + 3, bounds(rows, s + 2)[3]):
            known = out[r]
            x, y, z = (
                fma(-rows[s, L + r], known, x),
                fma(-rows[s + 1, L + r], known, y),
                fma(-rows[s + 2, L + r], known, z),
            )
        y = fma(-rows[s + 1, L + s + 2], z, y)
        out[s], out[s + 1], out[s + 2] = fma(-rows[s, L + s + 1], y, fma(-rows[s, L + s + 2], z, x)), y, z


@kernel
def multiply_columns(rows: Array, left: Array, answer: Array, change: Array) -> None:
    """Solve as ``multiply`` does, for right sides left (m, k), which it spoils, and answers (m, k)."""
    m, w = row_count(rows), width(rows)
    clear(answer)
    for _ in range(1 if independent(rows) else REFINEMENTS):
        copy(left, change)
        for s in range(m):
            _, _, _, reach = bounds(rows, s)
            for r in range(s + 1, reach):
                _subtract(rows[s, 2 * w + m + r], change[s], change[r])
            for c in range(change.shape[1]):
                change[s, c] *= rows[s, 2 * w + m + s]
        for s in range(m - 1, -1, -1):
            _, _, _, reach = bounds(rows, s)
            for r in range(s + 1, reach):
                _subtract(rows[s, 2 * w + m + r], change[r], change[s])
        accumulate(1.0, change, answer)
        for s in range(m):
            _, _, _, reach = bounds(rows, s)
            _subtract(rows[s, 2 * w + s], change[s], left[s])
            for r in range(s + 1, reach):
                _subtract(rows[s, 2 * w + r], change[s], left[r])
                _subtract(rows[s, 2 * w + r], change[r], left[s])


@inline_kernel
def _subtract(s: float, source: Array, out: Array) -> None:
    """Subtract s times a vector from one of the same length."""
    for c in range(out.shape[0]):
        out[c] -= s * source[c]
