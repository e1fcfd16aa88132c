"""Equality constraints by Lagrange multipliers, in the space of the constraints (design eq. 4, 7, 10, 11).

Unit forces of all rows run once through the articulated-body factors: Y = their generalized forces, Z = D^-1 Y, so that
A M^-1 A^T = Y Z^T without A or M ever being formed. Redundant rows leave it singular; the solve is proximal (Carpentier
2021): regularised by 1e-10 of each row's own scale (``weigh_rows``) and refined, so that motion is exact and multipliers
are those of least norm, rows between other links weighted by their scales. ``rows`` is one array (m + 3, 2 w + 2 m + BOUNDS):
Y | Z | A M^-1 A^T | its factor | bounds, and below them right side, answer and change; w counts the degrees of freedom that the
rows move. Of A M^-1 A^T and its factor only the entries above the diagonal and on it are kept, up to the row's bound: loops in
a row couple neighbours only, and cost in proportion to their number.
"""

import math

from physics_prior.dynamics.algebra import (
    ZERO,
    add3,
    cross,
    fma,
    get3,
    get9,
    minus,
    minus9,
    plus,
    put3,
    scale,
)
from physics_prior.dynamics.arrays import accumulate, clear, copy, drop_rounding
from physics_prior.dynamics.articulated_body import factorize, gather, load_joints, pull, push, release
from physics_prior.dynamics.constraint_errors import acceleration_error, direction, place
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import pose, weigh
from physics_prior.dynamics.records import ALL, BOUNDS
from physics_prior.dynamics.types import Array, Matrix, Records

REGULARISATION = 1e-10  # of a row's scale: small steps are not safer near a singular configuration (design eq. 11)
DEPENDENT = 1e3  # a pivot within this factor of the regularisation belongs to a row that adds nothing
REFINEMENTS = 3
EXACT = 1e-15  # of the right side: refinement stops there
UNMET = 1e-11  # of the right side: more is left of rows that contradict each other, or hardly hold a motion (a fold)
POSITION_TOLERANCE = 1e-11  # m: what projection leaves
ROUNDING = 1e-15  # m: no projection goes below


@inline_kernel
def row_count(rows: Array) -> int:
    """The number m of rows."""
    return int(rows.shape[0] - 3)


@inline_kernel
def width(rows: Array) -> int:
    """The number of degrees of freedom that the rows move."""
    return int((rows.shape[1] - BOUNDS) // 2 - row_count(rows))


@inline_kernel
def bounds(rows: Array, r: int) -> tuple[int, int, int, int]:
    """Where a row's columns begin and end, the first row that it is coupled to, and that behind the last."""
    last = rows.shape[1] - BOUNDS
    return int(rows[r, last]), int(rows[r, last + 1]), int(rows[r, last + 2]), int(rows[r, last + 3])


@inline_kernel
def _overlap(rows: Array, a: int, m: int, b: int, n: int, w: int, begin: int, end: int) -> Matrix:
    """The products of m rows of Y from row a on and n rows of Z from row b on, over some columns; 1 <= m, n <= 3.

    Nine sums side by side, which do not wait for one another. Beyond m and n they mean nothing.
    """
    y0, y1, y2 = rows[a], rows[a + min(m - 1, 1)], rows[a + m - 1]
    z0, z1, z2 = rows[b, w:], rows[b + min(n - 1, 1), w:], rows[b + n - 1, w:]
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        p, q, r, x, y, z = y0[k], y1[k], y2[k], z0[k], z1[k], z2[k]
        s0, s1, s2 = fma(p, x, s0), fma(p, y, s1), fma(p, z, s2)
        s3, s4, s5 = fma(q, x, s3), fma(q, y, s4), fma(q, z, s5)
        s6, s7, s8 = fma(r, x, s6), fma(r, y, s7), fma(r, z, s8)
    return s0, s1, s2, s3, s4, s5, s6, s7, s8


@kernel
def assemble(links: Records, work: Records, pairs: Records, rows: Array, known: Array) -> None:
    """Fill Y, Z, A M^-1 A^T and its regularised Cholesky factor, and the last two of known. Needs factors and ``place``.

    These are the rows' rank and the position error, m, that projection may leave. The factor: L D L^T, D inverted.
    """
    m, w, active = row_count(rows), width(rows), 0
    scales = rows[m + 2]
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        first, last = pair.first, pair.first + pair.rows
        begin, end, _, _ = bounds(rows, first)
        for r in range(first, last):
            for k in range(begin, end):
                rows[r, k] = 0.0
                rows[r, w + k] = 0.0
        if pair.active:
            y, z, d = rows[first:last, :w], rows[first:last, w : 2 * w], get9(pair.d)
            push(links, work, pair.link_b, get3(pair.b), d, pair.rows, y, z)
            push(links, work, pair.link_a, get3(pair.hold), minus9(d), pair.rows, y, z)
            active += pair.rows
        for r in range(first, last):
            scales[r] = drop_rounding(rows[r, begin:end], rows[r, w + begin : w + end])
    S, L = rows[:, 2 * w : 2 * w + m], rows[:, 2 * w + m : 2 * w + 2 * m]
    for p in range(pairs.shape[0]):
        first, count = pairs[p].first, pairs[p].rows
        begin, end, _, reach = bounds(rows, first)
        for o in range(p, pairs.shape[0]):
            other, number = pairs[o].first, pairs[o].rows
            if other >= reach:
                break
            from_, to, _, _ = bounds(rows, other)
            block = _overlap(rows, first, count, other, number, w, max(begin, from_), min(end, to))
            for r in range(count):
                for s in range(number):
                    if first + r <= other + s:
                        S[first + r, other + s] = block[3 * r + s]
                        L[first + r, other + s] = block[3 * r + s]
    weigh_rows(pairs, S, scales, active)
    rank, least = 0, math.inf
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        for s in range(pair.first, pair.first + pair.rows):
            _, _, first, _ = bounds(rows, s)
            for r in range(first, s):
                left = L[r, s]
                for k in range(first, r):
                    left = fma(-L[k, r], L[k, s], left)
                L[r, s] = left
            epsilon = REGULARISATION * scales[s]
            pivot = L[s, s] + epsilon
            for r in range(first, s):
                factor = L[r, s] * L[r, r]
                pivot = fma(-factor, L[r, s], pivot)
                L[r, s] = factor
            if pivot > DEPENDENT * epsilon:
                rank += 1
            pivot = max(pivot, 1e-3 * epsilon)
            if pair.active:
                least = min(least, pivot / scales[s])
            L[s, s] = 1.0 / pivot
    known[-2] = rank
    known[-1] = max(POSITION_TOLERANCE * math.sqrt(least), ROUNDING)


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
    """Fill out (m,) from the right side by the regularised factor; sums whose last term is the last that is known."""
    m, w = row_count(rows), width(rows)
    left, L = rows[m], rows[:, 2 * w + m : 2 * w + 2 * m]
    for s in range(m):
        known = left[s]
        for r in range(bounds(rows, s)[2], s):
            known = fma(-L[r, s], out[r], known)
        out[s] = known
    for s in range(m - 1, -1, -1):
        known = out[s] * L[s, s]
        for r in range(bounds(rows, s)[3] - 1, s, -1):
            known = fma(-L[s, r], out[r], known)
        out[s] = known


@kernel
def gather_rows(pairs: Records, rows: Array, offset: int, out: Array) -> None:
    """Add the columns of the rows, those of Y (offset 0) or of Z (offset w), times the answer to out, (w,) or longer."""
    answer = rows[row_count(rows) + 1]
    for p in range(pairs.shape[0]):
        first, n = pairs[p].first, pairs[p].rows
        begin, end, _, _ = bounds(rows, first)
        a, b, c = rows[first, offset:], rows[first + min(n - 1, 1), offset:], rows[first + n - 1, offset:]
        x, y, z = answer[first], 0.0, 0.0
        if n > 1:
            y = answer[first + 1]
        if n > 2:
            z = answer[first + 2]
        for k in range(begin, end):
            out[k] = fma(z, c[k], fma(y, b[k], fma(x, a[k], out[k])))


@kernel
def respond(links: Records, work: Records, pairs: Records, rows: Array, z: Array, vdot: Array) -> None:
    """Fill vdot (nv,) = M^-1 A^T answer, and the links' increments of acceleration. z (nv,) is scratch."""
    clear(z)
    gather_rows(pairs, rows, width(rows), z)
    pull(links, work, z, ALL, vdot)


@kernel
def responses(links: Records, work: Records, pairs: Records, rows: Array, z: Array, out: Array) -> None:
    """Fill out (m, nv) with M^-1 A^T, transposed; needs ``refresh``. z (nv,) is scratch."""
    m = row_count(rows)
    for r in range(m):
        for s in range(m):
            rows[m + 1, s] = 1.0 if r == s else 0.0
        respond(links, work, pairs, rows, z, out[r])


@kernel
def multiply_columns(rows: Array, left: Array, answer: Array, change: Array) -> None:
    """Solve as ``multiply`` does, for right sides left (m, k), which it spoils, and answers (m, k)."""
    m, w = row_count(rows), width(rows)
    clear(answer)
    for _ in range(REFINEMENTS):
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


@kernel
def refresh(links: Records, work: Records, pairs: Records, rows: Array, known: Array, q: Array) -> int:
    """Have the factors and rows of q (nq,) in the workspace, if they are not there yet; return the rank."""
    if work[0].factored:
        same = True
        for k in range(q.shape[0]):
            same = same and known[k] == q[k]
        if same:
            return int(known[-2])
    pose(links, work, q)
    place(work, pairs)
    complete(links, work, pairs, rows, known, q)
    return int(known[-2])


@kernel
def complete(links: Records, work: Records, pairs: Records, rows: Array, known: Array, q: Array) -> None:
    """Fill the factors and rows of q (nq,), poses and pairs being there."""
    weigh(links, work)
    factorize(links, work)
    assemble(links, work, pairs, rows, known)
    for k in range(q.shape[0]):
        known[k] = q[k]
    work[0].factored = 1


@kernel
def accelerate_constrained(
    links: Records,
    work: Records,
    pairs: Records,
    rows: Array,
    tau: Array,
    gravity: Array,
    vdot: Array,
    scratch: Array,
) -> float:
    """Do as ``accelerate`` under the constraints; fill pair.force; return what ``multiply`` does.

    Needs ``refresh``. The system is design eq. 4 with f_c = +A^T lambda, so that pair.force acts ON link b. Of the free
    motion only what the rows touch is found; then their forces join the others at the joints. scratch (nv,).
    """
    w = width(rows)
    gather(links, work, tau)
    release(links, work, gravity, w, vdot)
    acceleration_error(work, pairs, gravity, rows[row_count(rows)])
    unmet = multiply(rows)
    clear(scratch)
    gather_rows(pairs, rows, 0, scratch)
    load_joints(links, work, w, scratch)
    release(links, work, gravity, ALL, vdot)
    m = row_count(rows)
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        force = ZERO
        for row in range(pair.rows):
            force = plus(force, scale(rows[m + 1, pair.first + row], direction(pair, row)))
        put3(pair.force, force)
    return unmet


@kernel
def load_links(work: Records, pairs: Records) -> None:
    """Add the constraint forces to the external wrenches of the links, so that ``transmit`` sees them."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        force = get3(pair.force)
        if pair.link_b >= 0:
            on = work[pair.link_b]
            add3(on.force, force)
            add3(on.moment, cross(minus(get3(pair.b), get3(on.origin)), force))
        if pair.link_a >= 0:
            on = work[pair.link_a]
            back = scale(-1.0, force)
            add3(on.force, back)
            add3(on.moment, cross(minus(get3(pair.hold), get3(on.origin)), back))
