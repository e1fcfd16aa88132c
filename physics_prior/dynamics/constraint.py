"""Equality constraints by Lagrange multipliers, in the space of the constraints (design eq. 4, 7, 10, 11).

Unit forces of all rows run once through the articulated-body factors: Y = their generalized forces, Z = D^-1 Y, so that
A M^-1 A^T = Y Z^T without A or M ever being formed. Redundant rows leave it singular; the solve is proximal (Carpentier
2021): regularised by 1e-10 of the mean diagonal and refined, so that motion is exact and multipliers are those of least
norm. ``rows`` is one array (m, 2 nv + 2 m + 3): Y | Z | A M^-1 A^T | its Cholesky factor | right side | answer | change.
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
    plus,
    put3,
    scale,
    times,
)
from physics_prior.dynamics.articulated_body import factorize, pull, push
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import move
from physics_prior.dynamics.manifold import displace

REGULARISATION = 1e-10  # of the mean diagonal: small steps are not safer near a singular configuration (design eq. 11)
DEPENDENT = 1e3  # a pivot within this factor of the regularisation belongs to a row that adds nothing
REFINEMENTS = 3
POSITION_TOLERANCE = 1e-13  # m: projection stops there
POSITION_ITERATIONS = 6


@inline_kernel
def direction(pair, row):
    """The unit vector of a row, world axes."""
    return pair.d[3 * row], pair.d[3 * row + 1], pair.d[3 * row + 2]


@kernel
def place(work, pairs):
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
        for row in range(pair.rows):
            d = (pair.directions[3 * row], pair.directions[3 * row + 1], pair.directions[3 * row + 2])
            if pair.is_rod:
                gap = minus(b, a)
                d = scale(1.0 / math.sqrt(dot(gap, gap)), gap)
            elif pair.link_a >= 0:
                d = times(get9(work[pair.link_a].rotation), d)
            put3(pair.d[3 * row : 3 * row + 3], d)


@inline_kernel
def point_velocity(work, link, point):
    """Velocity of a world point that moves with a link."""
    velocity = ZERO
    if link >= 0:
        on = work[link]
        velocity = plus(get3(on.velocity), cross(get3(on.omega), minus(point, get3(on.origin))))
    return velocity


@inline_kernel
def point_acceleration(work, link, point, gravity):
    """Acceleration (less gravity) of a world point that moves with a link."""
    acceleration = (-gravity[0], -gravity[1], -gravity[2])
    if link >= 0:
        on = work[link]
        lever, omega = minus(point, get3(on.origin)), get3(on.omega)
        turning = plus(cross(get3(on.alpha), lever), cross(omega, cross(omega, lever)))
        acceleration = plus(get3(on.acceleration), turning)
    return acceleration


@kernel
def position_error(pairs, out):
    """Fill out (m,) with the rows' errors, m; return the largest magnitude. Needs ``place``."""
    worst = 0.0
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        gap = minus(get3(pair.b), get3(pair.a))
        for row in range(pair.rows):
            error = dot(direction(pair, row), gap)
            if pair.is_rod:
                error -= pair.length
            out[pair.first + row] = error
            worst = max(worst, abs(error))
    return worst


@kernel
def velocity_error(work, pairs, out):
    """Fill out (m,) with the rows' velocities, m/s."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        gap_rate = minus(
            point_velocity(work, pair.link_b, get3(pair.b)), point_velocity(work, pair.link_a, get3(pair.a))
        )
        for row in range(pair.rows):
            out[pair.first + row] = dot(direction(pair, row), gap_rate)


@kernel
def acceleration_error(work, pairs, gravity, out):
    """Fill out (m,) with the rows' accelerations under the links' present ones, m/s^2 (A vdot + Adot v)."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        a, b = get3(pair.a), get3(pair.b)
        gap_acceleration = minus(
            point_acceleration(work, pair.link_b, b, gravity),
            point_acceleration(work, pair.link_a, a, gravity),
        )
        for row in range(pair.rows):
            error = dot(direction(pair, row), gap_acceleration)
            if pair.is_rod:
                gap_rate = minus(point_velocity(work, pair.link_b, b), point_velocity(work, pair.link_a, a))
                along = dot(direction(pair, row), gap_rate)
                gap = minus(b, a)
                error += (dot(gap_rate, gap_rate) - along * along) / math.sqrt(dot(gap, gap))
            out[pair.first + row] = error


@kernel
def assemble(links, work, pairs, nv, rows):
    """Fill Y, Z, A M^-1 A^T and its regularised Cholesky factor; return the rank. Needs factors and ``place``."""
    m = rows.shape[0]
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        for row in range(pair.rows):
            r = pair.first + row
            d = direction(pair, row)
            clear(rows[r, : 2 * nv])
            push(links, work, pair.link_b, get3(pair.b), d, 1.0, rows[r, :nv], rows[r, nv : 2 * nv])
            push(links, work, pair.link_a, get3(pair.a), d, -1.0, rows[r, :nv], rows[r, nv : 2 * nv])
    trace = 0.0
    for r in range(m):
        for s in range(r + 1):
            total = 0.0
            for k in range(nv):
                total += rows[r, k] * rows[s, nv + k]
            rows[r, 2 * nv + s] = total
            rows[s, 2 * nv + r] = total
        trace += rows[r, 2 * nv + r]
    epsilon = REGULARISATION * trace / m
    rank = 0
    L = rows[:, 2 * nv + m : 2 * nv + 2 * m]
    for r in range(m):
        for s in range(r + 1):
            total = rows[r, 2 * nv + s]
            for k in range(s):
                total -= L[r, k] * L[s, k]
            if r == s:
                total += epsilon
                if total > DEPENDENT * epsilon:
                    rank += 1
                L[r, r] = math.sqrt(max(total, 1e-3 * epsilon))
            else:
                L[r, s] = total / L[s, s]
    return rank


@kernel
def multiply(rows, nv):
    """Solve A M^-1 A^T answer = right side, proximally; fills the answer, spoils the right side."""
    m = rows.shape[0]
    S = rows[:, 2 * nv : 2 * nv + m]
    L = rows[:, 2 * nv + m : 2 * nv + 2 * m]
    left = rows[:, 2 * nv + 2 * m]
    answer = rows[:, 2 * nv + 2 * m + 1]
    change = rows[:, 2 * nv + 2 * m + 2]
    for r in range(m):
        answer[r] = 0.0
    for _ in range(REFINEMENTS):
        for r in range(m):
            total = left[r]
            for k in range(r):
                total -= L[r, k] * change[k]
            change[r] = total / L[r, r]
        for r in range(m - 1, -1, -1):
            total = change[r]
            for k in range(r + 1, m):
                total -= L[k, r] * change[k]
            change[r] = total / L[r, r]
            answer[r] += change[r]
        for r in range(m):
            total = 0.0
            for k in range(m):
                total += S[r, k] * change[k]
            left[r] -= total


@kernel
def respond(links, work, rows, nv, z, vdot):
    """Fill vdot (nv,) = M^-1 A^T answer, and the links' increments of acceleration."""
    m = rows.shape[0]
    answer = rows[:, 2 * nv + 2 * m + 1]
    for k in range(nv):
        total = 0.0
        for r in range(m):
            total += rows[r, nv + k] * answer[r]
        z[k] = total
    pull(links, work, z, vdot)


@kernel
def constrain_acceleration(links, work, pairs, rows, gravity, vdot, spare):
    """Add constraint forces to free accelerations: vdot (nv,) and the links'; fill pair.force; return the rank.

    Needs ``accelerate``. The system is design eq. 4 with f_c = +A^T lambda, so that pair.force acts ON link b.
    spare (2, nv) is scratch.
    """
    nv, m = vdot.shape[0], rows.shape[0]
    place(work, pairs)
    rank = assemble(links, work, pairs, nv, rows)
    right = rows[:, 2 * nv + 2 * m]
    acceleration_error(work, pairs, gravity, right)
    for r in range(m):
        right[r] = -right[r]
    multiply(rows, nv)
    respond(links, work, rows, nv, spare[0], spare[1])
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
            force = plus(force, scale(rows[pair.first + row, 2 * nv + 2 * m + 1], direction(pair, row)))
        put3(pair.force, force)
    return rank


@kernel
def load_links(work, pairs):
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
            add3(on.moment, cross(minus(get3(pair.a), get3(on.origin)), back))


@kernel
def project(links, work, pairs, rows, q, v, spare):
    """Put q (nq,) and v (nv,) back onto the constraints in the mass metric; return the position error left, m.

    q moves by -M^-1 A^T (A M^-1 A^T)^-1 e until e is gone, v by the same map of A v (design eq. 11). spare (2, nv).
    """
    nv, m = v.shape[0], rows.shape[0]
    right = rows[:, 2 * nv + 2 * m]
    worst = 0.0
    for _ in range(POSITION_ITERATIONS):
        move(links, work, q, v)
        factorize(links, work)
        place(work, pairs)
        assemble(links, work, pairs, nv, rows)
        worst = position_error(pairs, right)
        if worst <= POSITION_TOLERANCE:
            break
        for r in range(m):
            right[r] = -right[r]
        multiply(rows, nv)
        respond(links, work, rows, nv, spare[0], spare[1])
        displace(links, q, spare[1], q)
    velocity_error(work, pairs, right)
    for r in range(m):
        right[r] = -right[r]
    multiply(rows, nv)
    respond(links, work, rows, nv, spare[0], spare[1])
    for k in range(nv):
        v[k] += spare[1, k]
    return worst
