"""What equality rows leave open: the errors of point pairs in position, velocity and acceleration (design eq. 4, 7).

A row d . (b - a), d fixed on link a, sees b move against link a's own point at b: so both forces act at b. The two of a
rod act at its ends. The directions of a pair that is not active are zero, and with them all its rows.
"""

import math

from physics_prior.dynamics.algebra import (
    ZERO,
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
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Record, Records, Vector


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
            if not pair.active:
                d = ZERO
            elif pair.is_rod:
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
            if pair.is_rod and pair.active:
                error += pair.length
            out[pair.first + row] = error
            worst = max(worst, abs(error))
    return worst


@inline_kernel
def approach(work: Records, pair: Record) -> Vector:
    """Velocity of point b less that of link a where the force holds it, or of a moving anchor, m/s."""
    rate = ZERO
    if pair.link_b >= 0:
        rate = point_velocity(work[pair.link_b], get3(pair.b))
    if pair.link_a >= 0:
        rate = minus(rate, point_velocity(work[pair.link_a], get3(pair.hold)))
    elif pair.motion > 0:
        rate = minus(rate, get3(pair.drift))
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
def point_increment(on: Record, point: Vector) -> Vector:
    """What a world point that moves with a link is displaced by, to first order, by the link's increments, m."""
    return plus(get3(on.delta_acceleration), cross(get3(on.delta_alpha), minus(point, get3(on.origin))))


@kernel
def error_beyond(work: Records, pairs: Records, errors: Array, out: Array) -> float:
    """Fill out (m,) with what the links' increments leave of errors (m,), NEGATED ones both, m; return the largest magnitude."""
    worst = 0.0
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        moved = ZERO
        if pair.link_b >= 0:
            moved = point_increment(work[pair.link_b], get3(pair.b))
        if pair.link_a >= 0:
            moved = minus(moved, point_increment(work[pair.link_a], get3(pair.hold)))
        for row in range(pair.rows):
            left = errors[pair.first + row] - dot(direction(pair, row), moved)
            out[pair.first + row] = left
            worst = max(worst, abs(left))
    return worst


@inline_kernel
def relative_acceleration(work: Records, pair: Record, gravity: Vector) -> Vector:
    """Acceleration of point b as link a sees it, but for the turning of a rod, m/s^2."""
    between = scale(-1.0, gravity)
    if pair.link_b >= 0:
        between = point_acceleration(work[pair.link_b], get3(pair.b))
    if pair.link_a >= 0:
        on = work[pair.link_a]
        between = minus(between, point_acceleration(on, get3(pair.hold)))
        if not pair.is_rod:
            between = minus(between, scale(2.0, cross(get3(on.omega), approach(work, pair))))
    else:
        between = plus(between, gravity)
        if pair.motion > 0:
            between = minus(between, get3(pair.drift_rate))
    return between


@kernel
def acceleration_error(work: Records, pairs: Records, gravity: Vector, out: Array) -> None:
    """Fill out (m,) with the rows' accelerations under the links' present ones, m/s^2 (A vdot + Adot v), NEGATED."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        between = relative_acceleration(work, pair, gravity)
        for row in range(pair.rows):
            error = dot(direction(pair, row), between)
            if pair.is_rod and pair.active:
                rate = approach(work, pair)
                along = dot(direction(pair, row), rate)
                gap = minus(get3(pair.b), get3(pair.a))
                error += (dot(rate, rate) - along * along) / math.sqrt(dot(gap, gap))
            out[pair.first + row] = -error
