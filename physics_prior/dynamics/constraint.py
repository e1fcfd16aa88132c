"""Equality constraints by Lagrange multipliers, in the space of the constraints (design eq. 4, 7, 10, 11).

Unit forces of all rows run once through the articulated-body factors: Y = their generalized forces, Z = D^-1 Y, so that
A M^-1 A^T = Y Z^T without A or M ever being formed. Redundant rows leave it singular; the solve is proximal (Carpentier
2021): regularised by 1e-10 of the mean diagonal and refined, so that motion is exact and multipliers are those of least
norm. ``rows`` is one array (m, 2 w + 2 m + 3): Y | Z | A M^-1 A^T | its Cholesky factor | right side | answer | change,
where w counts the degrees of freedom that the rows move. A row d . (b - a), d fixed on link a, sees b move against link
a's own point at b: so both forces act at b. The two of a rod act at its ends.
"""

import math

from physics_prior.dynamics.algebra import (
    ZERO,
    add3,
    cross,
    dot,
    get3,
    get9,
    minus,
    minus9,
    plus,
    put3,
    scale,
    times,
)
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.articulated_body import factorize, pull, push
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import flow, pose, weigh
from physics_prior.dynamics.manifold import displace
from physics_prior.dynamics.types import Array, Record, Records, Vector

REGULARISATION = 1e-10  # of the mean diagonal: small steps are not safer near a singular configuration (design eq. 11)
DEPENDENT = 1e3  # a pivot within this factor of the regularisation belongs to a row that adds nothing
REFINEMENTS = 3
EXACT = 1e-15  # of the right side: refinement stops there
POSITION_TOLERANCE = 1e-15  # m: projection stops there
ROUNDING = 1e-13  # m: below it, projection stops where it gains nothing
POSITION_ITERATIONS = 12


@inline_kernel
def direction(pair: Record, row: int) -> Vector:
    """The unit vector of a row, world axes."""
    return pair.d[3 * row], pair.d[3 * row + 1], pair.d[3 * row + 2]


@kernel
def place(work: Records, pairs: Records) -> None:
    """Fill points and directions of all pairs in the world; needs the kinematics."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        a, b = get3(pair.point_a), get3(pair.point_b)
        if pair.link_a >= 0:
            on = work[pair.link_a]
            a = plus(get3(on.origin), times(get9(on.rotation), a))
        if pair.link_b >= 0:
            on = work[pair.link_b]
            b = plus(get3(on.origin), times(get9(on.rotation), b))
        put3(pair.a, a)
        put3(pair.b, b)
        put3(pair.hold, a if pair.is_rod else b)
        for row in range(pair.rows):
            d = (pair.directions[3 * row], pair.directions[3 * row + 1], pair.directions[3 * row + 2])
            if pair.is_rod:
                gap = minus(b, a)
                d = scale(1.0 / math.sqrt(dot(gap, gap)), gap)
            elif pair.link_a >= 0:
                d = times(get9(work[pair.link_a].rotation), d)
            put3(pair.d[3 * row : 3 * row + 3], d)


@inline_kernel
def point_velocity(on: Record, point: Vector) -> Vector:
    """Velocity of a world point that moves with a link."""
    return plus(get3(on.velocity), cross(get3(on.omega), minus(point, get3(on.origin))))


@inline_kernel
def point_acceleration(on: Record, point: Vector) -> Vector:
    """Acceleration (less gravity) of a world point that moves with a link."""
    lever, omega = minus(point, get3(on.origin)), get3(on.omega)
    turning = plus(cross(get3(on.alpha), lever), cross(omega, cross(omega, lever)))
    return plus(get3(on.acceleration), turning)


@kernel
def position_error(pairs: Records, out: Array) -> float:
    """Fill out (m,) with the rows' errors, m, NEGATED; return the largest magnitude. Needs ``place``."""
    worst = 0.0
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        gap = minus(get3(pair.a), get3(pair.b))
        for row in range(pair.rows):
            error = dot(direction(pair, row), gap)
            if pair.is_rod:
                error += pair.length
            out[pair.first + row] = error
            worst = max(worst, abs(error))
    return worst


@inline_kernel
def approach(work: Records, pair: Record) -> Vector:
    """Velocity of point b less that of link a where the force holds it, m/s."""
    rate = ZERO
    if pair.link_b >= 0:
        rate = point_velocity(work[pair.link_b], get3(pair.b))
    if pair.link_a >= 0:
        rate = minus(rate, point_velocity(work[pair.link_a], get3(pair.hold)))
    return rate


@kernel
def velocity_error(work: Records, pairs: Records, out: Array) -> None:
    """Fill out (m,) with the rows' velocities, m/s, NEGATED."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        rate = approach(work, pair)
        for row in range(pair.rows):
            out[pair.first + row] = -dot(direction(pair, row), rate)


@inline_kernel
def relative_acceleration(work: Records, pair: Record, gravity: Array) -> Vector:
    """Acceleration of point b as link a sees it, but for the turning of a rod, m/s^2."""
    between = (-gravity[0], -gravity[1], -gravity[2])
    if pair.link_b >= 0:
        between = point_acceleration(work[pair.link_b], get3(pair.b))
    if pair.link_a >= 0:
        on = work[pair.link_a]
        between = minus(between, point_acceleration(on, get3(pair.hold)))
        if not pair.is_rod:
            between = minus(between, scale(2.0, cross(get3(on.omega), approach(work, pair))))
    else:
        between = plus(between, (gravity[0], gravity[1], gravity[2]))
    return between


@kernel
def acceleration_error(work: Records, pairs: Records, gravity: Array, out: Array) -> None:
    """Fill out (m,) with the rows' accelerations under the links' present ones, m/s^2 (A vdot + Adot v), NEGATED."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        between = relative_acceleration(work, pair, gravity)
        for row in range(pair.rows):
            error = dot(direction(pair, row), between)
            if pair.is_rod:
                rate = approach(work, pair)
                along = dot(direction(pair, row), rate)
                gap = minus(get3(pair.b), get3(pair.a))
                error += (dot(rate, rate) - along * along) / math.sqrt(dot(gap, gap))
            out[pair.first + row] = -error


@inline_kernel
def width(rows: Array) -> int:
    """The number of degrees of freedom that the rows move."""
    return int((rows.shape[1] - 2 * rows.shape[0] - 3) // 2)


@kernel
def assemble(links: Records, work: Records, pairs: Records, rows: Array) -> int:
    """Fill Y, Z, A M^-1 A^T and its regularised Cholesky factor; return the rank. Needs factors and ``place``.

    The factor is L D L^T with unit L, here also above the diagonal, in which stands D inverted.
    """
    m, w = rows.shape[0], width(rows)
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        first, last = pair.first, pair.first + pair.rows
        for r in range(first, last):
            for k in range(2 * w):
                rows[r, k] = 0.0
        y, z, d = rows[first:last, :w], rows[first:last, w : 2 * w], get9(pair.d)
        push(links, work, pair.link_b, get3(pair.b), d, pair.rows, y, z)
        push(links, work, pair.link_a, get3(pair.hold), minus9(d), pair.rows, y, z)
    trace = 0.0
    for r in range(m):
        for s in range(r + 1):
            total = 0.0
            for k in range(w):
                total += rows[r, k] * rows[s, w + k]
            rows[r, 2 * w + s] = total
            rows[s, 2 * w + r] = total
        trace += rows[r, 2 * w + r]
    epsilon = REGULARISATION * trace / m
    rank = 0
    S, L = rows[:, 2 * w : 2 * w + m], rows[:, 2 * w + m : 2 * w + 2 * m]
    for r in range(m):
        for s in range(r, m):
            L[r, s] = S[r, s]
        L[r, r] += epsilon
    for r in range(m):
        pivot = L[r, r]
        if pivot > DEPENDENT * epsilon:
            rank += 1
        inverse = 1.0 / max(pivot, 1e-3 * epsilon)
        L[r, r] = inverse
        for s in range(r + 1, m):
            factor = L[r, s] * inverse
            for k in range(s, m):
                L[s, k] -= factor * L[r, k]
            L[s, r] = factor
        for s in range(r + 1, m):
            L[r, s] = L[s, r]
    return rank


@kernel
def multiply(rows: Array) -> None:
    """Solve A M^-1 A^T answer = right side, proximally; fills the answer, spoils the right side."""
    m, w = rows.shape[0], width(rows)
    left, answer, change = 2 * w + 2 * m, 2 * w + 2 * m + 1, 2 * w + 2 * m + 2
    S, L = 2 * w, 2 * w + m
    size = 0.0
    for r in range(m):
        rows[r, answer] = 0.0
        size = max(size, abs(rows[r, left]))
    for _ in range(REFINEMENTS):
        for r in range(m):
            rows[r, change] = rows[r, left]
        for s in range(m):
            known = rows[s, change]
            for r in range(s + 1, m):
                rows[r, change] -= rows[s, L + r] * known
        for s in range(m):
            rows[s, change] *= rows[s, L + s]
        for s in range(m - 1, -1, -1):
            known = rows[s, change]
            rows[s, answer] += known
            for r in range(s):
                rows[r, change] -= rows[s, L + r] * known
        for s in range(m):
            known = rows[s, change]
            for r in range(m):
                rows[r, left] -= rows[s, S + r] * known
        rest = 0.0
        for r in range(m):
            rest = max(rest, abs(rows[r, left]))
        if rest <= EXACT * size:
            break


@kernel
def respond(links: Records, work: Records, rows: Array, z: Array, vdot: Array) -> None:
    """Fill vdot (nv,) = M^-1 A^T answer, and the links' increments of acceleration. z (nv,) is scratch."""
    m, w = rows.shape[0], width(rows)
    answer = rows[:, 2 * w + 2 * m + 1]
    clear(z)
    for r in range(m):
        known = answer[r]
        for k in range(w):
            z[k] += rows[r, w + k] * known
    pull(links, work, z, vdot)


@kernel
def refresh(links: Records, work: Records, pairs: Records, rows: Array, known: Array, q: Array) -> int:
    """Have the factors and rows of q (nq,) in the workspace, if they are not there yet; return the rank."""
    nq = q.shape[0]
    if work[0].factored:
        same = True
        for k in range(nq):
            same = same and known[k] == q[k]
        if same:
            return int(known[nq])
    pose(links, work, q)
    place(work, pairs)
    return complete(links, work, pairs, rows, known, q)


@kernel
def complete(links: Records, work: Records, pairs: Records, rows: Array, known: Array, q: Array) -> int:
    """Fill the factors and rows of q (nq,), poses and pairs being there; return the rank."""
    weigh(links, work)
    factorize(links, work)
    rank = assemble(links, work, pairs, rows)
    for k in range(q.shape[0]):
        known[k] = q[k]
    known[q.shape[0]] = rank
    work[0].factored = 1
    return rank


@kernel
def constrain_acceleration(
    links: Records, work: Records, pairs: Records, rows: Array, gravity: Array, vdot: Array, spare: Array
) -> None:
    """Add constraint forces to free accelerations: vdot (nv,) and the links'; fill pair.force.

    Needs ``refresh`` and ``accelerate``. The system is design eq. 4 with f_c = +A^T lambda, so that pair.force acts ON link
    b. spare (2, nv) is scratch.
    """
    nv, m, w = vdot.shape[0], rows.shape[0], width(rows)
    acceleration_error(work, pairs, gravity, rows[:, 2 * w + 2 * m])
    multiply(rows)
    respond(links, work, rows, spare[0], spare[1])
    for k in range(nv):
        vdot[k] += spare[1, k]
    for i in range(links.shape[0]):
        here = work[i]
        add3(here.alpha, get3(here.delta_alpha))
        add3(here.acceleration, get3(here.delta_acceleration))
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        force = ZERO
        for row in range(pair.rows):
            force = plus(force, scale(rows[pair.first + row, 2 * w + 2 * m + 1], direction(pair, row)))
        put3(pair.force, force)


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


@kernel
def project(
    links: Records,
    work: Records,
    pairs: Records,
    rows: Array,
    known: Array,
    q: Array,
    v: Array,
    spare: Array,
) -> float:
    """Put q (nq,) and v (nv,) back onto the constraints in the mass metric; return the position error left, m.

    q moves by -M^-1 A^T (A M^-1 A^T)^-1 e until e is gone, v by the same map of A v (design eq. 11). The factors of a
    configuration nearby, which the workspace must hold, serve q as long as they make e ten times smaller (simplified
    Newton's method); the velocity has those of the final q, and the next step finds them there. e goes down to rounding:
    where a mechanism folds, an error e lets it stray by the root of e. spare (2, nv).
    """
    nv, m, w = v.shape[0], rows.shape[0], width(rows)
    right = rows[:, 2 * w + 2 * m]
    before, exact = math.inf, False
    pose(links, work, q)
    place(work, pairs)
    error = position_error(pairs, right)
    for _ in range(POSITION_ITERATIONS):
        if error <= POSITION_TOLERANCE:
            break
        slow = error > 0.1 * before
        if slow:
            if error <= ROUNDING or (exact and error > 0.5 * before):
                break
            complete(links, work, pairs, rows, known, q)
        before, exact = error, slow
        multiply(rows)
        respond(links, work, rows, spare[0], spare[1])
        displace(links, q, spare[1], q)
        pose(links, work, q)
        place(work, pairs)
        error = position_error(pairs, right)
    complete(links, work, pairs, rows, known, q)
    flow(links, work, v)
    velocity_error(work, pairs, right)
    multiply(rows)
    respond(links, work, rows, spare[0], spare[1])
    for k in range(nv):
        v[k] += spare[1, k]
    return error
