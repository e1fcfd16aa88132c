"""Equality constraints by Lagrange multipliers, in the space of the constraints (design eq. 4, 7, 10, 11).

Unit forces of all rows run once through the articulated-body factors: Y = their generalized forces, Z = D^-1 Y, so that
A M^-1 A^T = Y Z^T without A or M ever being formed. row_system.py has the layout of ``rows`` and solves for the multipliers.
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
from physics_prior.dynamics.arrays import clear, same
from physics_prior.dynamics.articulated_body import factorize, gather, load_joints, pull, release
from physics_prior.dynamics.blocks import REGISTER, get_block, put_block
from physics_prior.dynamics.constraint_errors import acceleration_error, direction, place
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import pose, weigh
from physics_prior.dynamics.records import ALL, BOUNDS, MOVED
from physics_prior.dynamics.row_system import (
    INDEPENDENT,
    REGULARISATION,
    bounds,
    factorize_rows,
    multiply,
    row_count,
    weigh_rows,
    width,
)
from physics_prior.dynamics.types import Array, Records, Vector
from physics_prior.dynamics.unit_forces import push
from physics_prior.dynamics.views import rows_at, three_rows

NOTHING = 1e-24  # square of a lever, m, that is rounding
UNMET = 1e-11  # of the right side: more is left of rows that contradict each other, or hardly hold a motion (a fold)
POSITION_TOLERANCE = 1e-11  # m: what projection leaves
ROUNDING = 1e-15  # m: no projection goes below


@inline_kernel
def _couple(rows: Array, a: int, m: int, b: int, n: int, begin: int, end: int) -> None:
    """Fill A M^-1 A^T of m rows from row a on and n rows from row b on, whose columns overlap from begin to end; 1 <= m, n <= 3.

    Nine sums side by side, which do not wait for one another; where rows are fewer, those of the last ones again. What that
    leaves below the diagonal means nothing.
    """
    w, S = width(rows), 2 * width(rows)
    a1, a2, b1, b2 = a + min(m - 1, 1), a + m - 1, b + min(n - 1, 1), b + n - 1
    (y0, y1, y2), (z0, z1, z2) = three_rows(rows, a, m, 0), three_rows(rows, b, n, w)
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for c in range(begin, end):
        p, q, r, x, y, z = y0[c], y1[c], y2[c], z0[c], z1[c], z2[c]
        s0, s1, s2 = fma(p, x, s0), fma(p, y, s1), fma(p, z, s2)
        s3, s4, s5 = fma(q, x, s3), fma(q, y, s4), fma(q, z, s5)
        s6, s7, s8 = fma(r, x, s6), fma(r, y, s7), fma(r, z, s8)
    rows[a, S + b], rows[a, S + b1], rows[a, S + b2] = s0, s1, s2
    rows[a1, S + b], rows[a1, S + b1], rows[a1, S + b2] = s3, s4, s5
    rows[a2, S + b], rows[a2, S + b1], rows[a2, S + b2] = s6, s7, s8


@inline_kernel
def squared_levers(rows: Array, a: int, m: int, begin: int, end: int) -> Vector:
    """The sums of the squared levers, m, of joints under the unit forces of m rows from row a on, over some columns."""
    y0, y1, y2 = three_rows(rows, a, m, 0)
    p, q, r = 0.0, 0.0, 0.0
    for k in range(begin, end):
        p, q, r = fma(y0[k], y0[k], p), fma(y1[k], y1[k], q), fma(y2[k], y2[k], r)
    return p, q, r


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
        alone = pair.active and pair.link_a < 0  # what one side alone moves is overwritten, and the rest stays zero
        if not alone:
            for r in range(first, last):
                clear(rows[r, begin:end])
                clear(rows[r, w + begin : w + end])
        if pair.active:
            y, z, d = rows_at(rows, first, pair.rows, 0), rows_at(rows, first, pair.rows, w), get9(pair.d)
            push(links, work, pair.link_b, get3(pair.b), d, pair.rows, alone, y, z)
            if pair.link_a >= 0:
                push(links, work, pair.link_a, get3(pair.hold), minus9(d), pair.rows, False, y, z)
            active += pair.rows
        squares = squared_levers(rows, first, pair.rows, begin, end)
        for r in range(pair.rows):
            if squares[r] < NOTHING:  # rounding: a rod at its dead centre
                clear(rows[first + r, begin:end])
                clear(rows[first + r, w + begin : w + end])
                scales[first + r] = 0.0
            else:
                scales[first + r] = squares[r]
    for p in range(pairs.shape[0]):
        first, count = pairs[p].first, pairs[p].rows
        begin, end, _, reach = bounds(rows, first)
        for o in range(p, pairs.shape[0]):
            other, number = pairs[o].first, pairs[o].rows
            if other >= reach:
                break
            from_, to, _, _ = bounds(rows, other)
            _couple(rows, first, count, other, number, max(begin, from_), min(end, to))
    weigh_rows(pairs, rows, active)
    rank, least = factorize_rows(pairs, rows, 0.0, INDEPENDENT)
    rows[m, rows.shape[1] - BOUNDS] = 1.0 if least >= INDEPENDENT else 0.0
    if least < INDEPENDENT:
        rank, least = factorize_rows(pairs, rows, REGULARISATION, 0.0)
    known[-2] = rank
    known[-1] = max(POSITION_TOLERANCE * math.sqrt(least), ROUNDING)


@kernel
def gather_rows(pairs: Records, rows: Array, offset: int, out: Array) -> None:
    """Add the columns of the rows, those of Y (offset 0) or of Z (offset w), times the answer to out, (w,) or longer."""
    answer = rows[row_count(rows) + 1]
    for p in range(pairs.shape[0]):
        first, n = pairs[p].first, pairs[p].rows
        begin, end, _, _ = bounds(rows, first)
        a, b, c = three_rows(rows, first, n, offset)
        x, y, z = answer[first], 0.0, 0.0
        if n > 1:
            y = answer[first + 1]
        if n > 2:
            z = answer[first + 2]
        whole = end - (end - begin) % REGISTER
        for k in range(begin, whole, REGISTER):
            own = get_block(out, k, REGISTER, REGISTER)
            own = fma(x, get_block(a, k, REGISTER, REGISTER), own)
            own = fma(z, get_block(c, k, REGISTER, REGISTER), fma(y, get_block(b, k, REGISTER, REGISTER), own))
            put_block(out, k, own, REGISTER)
        for k in range(whole, end):
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
def refresh(links: Records, work: Records, pairs: Records, rows: Array, known: Array, q: Array) -> int:
    """Have the factors and rows of q (nq,) in the workspace, if they are not there yet; return the rank."""
    if work[0].factored and same(known, q):
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
    gather(links, work, tau)
    release(links, work, gravity, MOVED, vdot)
    acceleration_error(work, pairs, get3(gravity), rows[row_count(rows)])
    unmet = multiply(rows)
    clear(scratch)
    gather_rows(pairs, rows, 0, scratch)
    load_joints(links, work, scratch)
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
