"""Projection onto the constraints in the mass metric, of positions and velocities (design eq. 11)."""

import math

from physics_prior.dynamics.algebra import ZERO, fma
from physics_prior.dynamics.arrays import clear, within
from physics_prior.dynamics.articulated_body import pull
from physics_prior.dynamics.constraint import complete, gather_rows, respond
from physics_prior.dynamics.constraint_errors import (
    acceleration_error,
    error_beyond,
    place,
    position_error,
    velocity_error,
)
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import flow_part, pose, take_increments
from physics_prior.dynamics.manifold import displace
from physics_prior.dynamics.records import ALL, MOVED
from physics_prior.dynamics.row_system import REFINEMENTS, multiply, multiply_once, row_count, width
from physics_prior.dynamics.types import Array, Records

ITERATIONS = 40  # at a fold each makes the error but four times smaller
FARTHEST = 0.5  # rad or m, of a freedom in one pass: where rows hardly hold a motion, they ask for any distance
CLOSE = 1e-4  # m: of errors below it, what a pass leaves in second order is told beforehand, where that may matter
APART = 1e-6  # m: a step that leaves more is refused
STALL = 1e-13  # m: below it, projection stops where it gains little


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
    tolerance: float,
) -> float:
    """Put q (nq,) and v (nv,) back onto the constraints in the mass metric; return the position error left, m.

    q moves by -M^-1 A^T (A M^-1 A^T)^-1 e until e is within tolerance, v by the same map of A v (design eq. 11). The factors of a
    configuration nearby, which the workspace must hold, serve q as long as they make e ten times smaller; the velocity has
    those of the final q, and the next step finds them there. spare: two vectors (nv,).
    """
    right = rows[row_count(rows)]
    z, delta = spare[0], spare[1]
    before, exact = math.inf, False
    pose(links, work, q)
    place(work, pairs)
    error = position_error(pairs, right)
    for _ in range(ITERATIONS):
        target = min(known[-1], tolerance)
        if error <= target:
            break
        slow = error > 0.1 * before
        if slow:
            if error <= STALL or (exact and error > 0.5 * before):
                break
            complete(links, work, pairs, rows, known, q)
        before, exact = error, slow
        meet(links, work, pairs, rows, error, target, z, delta)
        if not within(delta, FARTHEST):
            farthest = 0.0
            for k in range(v.shape[0]):
                farthest = max(farthest, abs(delta[k]))
            for k in range(v.shape[0]):
                delta[k] *= FARTHEST / farthest
        displace(links, q, delta, q)
        pose(links, work, q)
        place(work, pairs)
        error = position_error(pairs, right)
    complete(links, work, pairs, rows, known, q)
    project_velocity(links, work, pairs, rows, v, spare)
    return error


@kernel
def meet(
    links: Records, work: Records, pairs: Records, rows: Array, error: float, target: float, z: Array, delta: Array
) -> None:
    """Fill z and delta, (nv,) both, with the displacement that closes the rows, whose errors are their right sides.

    To first order, and small errors to second. The factors of a place nearby serve as long as they make what is left ten times
    smaller: the links' increments tell that with the poses as they are.
    """
    m, w = row_count(rows), width(rows)
    right, last, errors = rows[m], rows[m + 1, m:], rows[m + 2]
    for r in range(m):
        errors[r] = right[r]
    clear(z)
    left = error
    for index in range(REFINEMENTS):
        before = left
        multiply_once(rows)
        gather_rows(pairs, rows, w, z)
        pull(links, work, z, MOVED, delta)
        left = error_beyond(work, pairs, errors, right)
        if index > 0 and left > 0.5 * target:
            left = extrapolate(pairs, rows, right, last, z)
        if left <= 0.5 * target or left > 0.1 * before:
            break
        if index == 0 and error < CLOSE and error * error > 0.01 * target:
            bend(links, work, pairs, rows)
        for r in range(m):
            last[r] = right[r]
    pull(links, work, z, ALL, delta)


@kernel
def extrapolate(pairs: Records, rows: Array, left: Array, last: Array, z: Array) -> float:
    """Go the share of the last pass back that leaves least, and return what is left; left and last: after it and before it, (m,).

    What a pass leaves is a linear function of what it found, and mostly along it: the share is nearly that of the next pass.
    """
    m, along, square, worst = row_count(rows), 0.0, 0.0, 0.0
    for r in range(m):
        gain = last[r] - left[r]
        along, square = fma(left[r], gain, along), fma(gain, gain, square)
    share = -along / square if square > 0.0 else 0.0
    for r in range(m):
        left[r] = fma(share, last[r] - left[r], left[r])
        rows[m + 1, r] *= -share
        worst = max(worst, abs(left[r]))
    gather_rows(pairs, rows, width(rows), z)
    return worst


@kernel
def bend(links: Records, work: Records, pairs: Records, rows: Array) -> None:
    """Add to the errors what the links' increments do to them in second order.

    It is half the acceleration of the rows where joints move at a constant rate.
    """
    m = row_count(rows)
    right, seen, errors = rows[m], rows[m + 1], rows[m + 2]
    take_increments(links, work)
    acceleration_error(work, pairs, ZERO, seen)
    for p in range(pairs.shape[0]):
        if pairs[p].motion == 0:
            for r in range(pairs[p].first, pairs[p].first + pairs[p].rows):
                right[r] += 0.5 * seen[r]
                errors[r] += 0.5 * seen[r]


@kernel
def project_velocity(links: Records, work: Records, pairs: Records, rows: Array, v: Array, spare: Array) -> None:
    """Put v (nv,) onto the constraints by the impulse that takes it there (design eq. 9); needs factors and rows of q."""
    flow_part(links, work, v, MOVED)
    velocity_error(work, pairs, rows[row_count(rows)])
    multiply(rows)
    respond(links, work, pairs, rows, spare[0], spare[1])
    for k in range(v.shape[0]):
        v[k] += spare[1, k]
