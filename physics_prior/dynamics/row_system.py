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

    Pivots are relative to their rows' scales. The first that is not ``enough`` ends it.
    """
    m, w = row_count(rows), width(rows)
    S, L, scales = rows[:, 2 * w : 2 * w + m], rows[:, 2 * w + m : 2 * w + 2 * m], rows[m + 2]
    rank, least = 0, math.inf
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        for s in range(pair.first, pair.first + pair.rows):
            _, _, first, _ = bounds(rows, s)
            epsilon = regularisation * scales[s]
            pivot = S[s, s] + epsilon
            for r in range(first, s):
                left = S[r, s]
                for k in range(first, r):
                    left = fma(-L[k, r], L[k, s], left)
                L[r, s] = left
                pivot = fma(-left * L[r, r], left, pivot)
            for r in range(first, s):
                L[r, s] *= L[r, r]
            if pivot > DEPENDENT * epsilon:
                rank += 1
            pivot = max(pivot, 1e-3 * epsilon)
            if pair.active:
                least = min(least, pivot / scales[s])
            if least < enough:
                return rank, least
            L[s, s] = 1.0 / pivot if pivot > 0.0 else 0.0
    return rank, least


@kernel
def weigh_rows(pairs: Records, S: Array, scales: Array, active: int) -> None:
    """Replace the rows' squared levers, m^2, in scales by what the diagonal of S = A M^-1 A^T would be of usual levers.

    That is the mean squared lever of the active rows, over the inertia that the rows between two links meet. So a row is
    weak by its lever (a fold), not because a link elsewhere is light. Of rows between the same links it is one number, so
    that redundant ones share by least multipliers.
    """
    levers, first = 0.0, 0
    for r in range(S.shape[0]):
        levers += scales[r]
    for p in range(pairs.shape[0]):
        pair, last = pairs[p], pairs[p].first + pairs[p].rows
        if p + 1 < pairs.shape[0] and pairs[p + 1].link_a == pair.link_a and pairs[p + 1].link_b == pair.link_b:
            continue
        mobility, own = 0.0, 0.0
        for r in range(first, last):
            mobility += S[r, r]
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
    m, w = row_count(rows), width(rows)
    left, L = rows[m], rows[:, 2 * w + m : 2 * w + 2 * m]
    s = 0
    while s + 2 < m:
        x, y, z = left[s], left[s + 1], left[s + 2]
        for r in range(bounds(rows, s)[2], s):
            known = out[r]
            x, y, z = fma(-L[r, s], known, x), fma(-L[r, s + 1], known, y), fma(-L[r, s + 2], known, z)
        y = fma(-L[s, s + 1], x, y)
        out[s], out[s + 1], out[s + 2] = x, y, fma(-L[s + 1, s + 2], y, fma(-L[s, s + 2], x, z))
        s += 3
    for t in range(s, m):
        x = left[t]
        for r in range(bounds(rows, t)[2], t):
            x = fma(-L[r, t], out[r], x)
        out[t] = x
    for t in range(m - 1, s - 1, -1):
        x = out[t] * L[t, t]
        for r in range(t + 1, bounds(rows, t)[3]):
            x = fma(-L[t, r], out[r], x)
        out[t] = x
    while s > 0:
        s -= 3
        x, y, z = out[s] * L[s, s], out[s + 1] * L[s + 1, s + 1], out[s + 2] * L[s + 2, s + 2]
        for r in range(s + 3, bounds(rows, s + 2)[3]):
            known = out[r]
            x, y, z = fma(-L[s, r], known, x), fma(-L[s + 1, r], known, y), fma(-L[s + 2, r], known, z)
        y = fma(-L[s + 1, s + 2], z, y)
        out[s], out[s + 1], out[s + 2] = fma(-L[s, s + 1], y, fma(-L[s, s + 2], z, x)), y, z


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
