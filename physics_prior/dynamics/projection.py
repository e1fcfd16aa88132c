"""Projection onto the constraints in the mass metric, of positions and velocities (design eq. 11)."""

import math

from physics_prior.dynamics.algebra import ZERO
from physics_prior.dynamics.arrays import accumulate, clear, copy, within
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
from physics_prior.dynamics.kinematics import flow_part, pose_part, take_increments
from physics_prior.dynamics.manifold import displace_part
from physics_prior.dynamics.records import ALL
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
    those of the final q, and the next step finds them there. Each pass moves the links that rows move; the others follow in the
    end. spare: three vectors (nv,).
    """
    right, w = rows[row_count(rows)], width(rows)
    z, delta, rest = spare[0], spare[1], spare[4]
    before, exact, passes = math.inf, False, 0
    clear(rest)
    pose_part(links, work, q, 0, w)
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
            follow(links, work, w, passes, rest, delta, q)
            complete(links, work, pairs, rows, known, q)
            passes = 0
        before, exact, passes = error, slow, passes + 1
        meet(links, work, pairs, rows, error, target, z, delta)
        share = 1.0
        if not within(delta, FARTHEST):
            farthest = 0.0
            for k in range(v.shape[0]):
                farthest = max(farthest, abs(delta[k]))
            share, passes = FARTHEST / farthest, 2
            for k in range(v.shape[0]):
                delta[k] *= share
        accumulate(share, z, rest)
        displace_part(links, q, delta, 0, w, q)
        pose_part(links, work, q, 0, w)
        place(work, pairs)
        error = position_error(pairs, right)
    follow(links, work, w, passes, rest, delta, q)
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
    right, errors, w = rows[row_count(rows)], rows[row_count(rows) + 2], width(rows)
    copy(right, errors)
    clear(z)
    clear(delta)
    left = error
    for index in range(REFINEMENTS):
        before = left
        multiply_once(rows)
        gather_rows(pairs, rows, w, z)
        pull(links, work, z, 0, w, delta)
        left = error_beyond(work, pairs, errors, right)
        if left <= 0.5 * target or left > 0.1 * before:
            break
        if index == 0 and error < CLOSE and error * error > 0.01 * target:
            bend(links, work, pairs, rows)


@kernel
def bend(links: Records, work: Records, pairs: Records, rows: Array) -> None:
    """Add to the errors what the links' increments do to them in second order.

    It is half the acceleration of the rows where joints move at a constant rate.
    """
    m = row_count(rows)
    right, seen, errors = rows[m], rows[m + 1], rows[m + 2]
    take_increments(links, work, width(rows))
    acceleration_error(work, pairs, ZERO, seen)
    for p in range(pairs.shape[0]):
        if pairs[p].motion == 0:
            for r in range(pairs[p].first, pairs[p].first + pairs[p].rows):
                right[r] += 0.5 * seen[r]
                errors[r] += 0.5 * seen[r]


@kernel
def follow(links: Records, work: Records, w: int, passes: int, z: Array, delta: Array, q: Array) -> None:
    """Move the links that rows do not move as z (nv,), which is then cleared, moves them through the factors, and pose them.

    z is the sum of so many passes: of one, taken whole, the increments of what the links hang on are there.
    """
    if w < delta.shape[0]:
        if passes > 0:
            pull(links, work, z, w if passes == 1 else 0, ALL, delta)
            displace_part(links, q, delta, w, ALL, q)
        pose_part(links, work, q, w, ALL)
        clear(z)


@kernel
def project_velocity(links: Records, work: Records, pairs: Records, rows: Array, v: Array, spare: Array) -> None:
    """Put v (nv,) onto the constraints by the impulse that takes it there (design eq. 9); needs factors and rows of q."""
    flow_part(links, work, v, width(rows))
    velocity_error(work, pairs, rows[row_count(rows)])
    multiply(rows)
    respond(links, work, pairs, rows, spare[0], spare[1])
    for k in range(v.shape[0]):
        v[k] += spare[1, k]
