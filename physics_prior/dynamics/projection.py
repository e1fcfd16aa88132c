"""Projection onto the constraints in the mass metric, of positions and velocities (design eq. 11)."""

import math

from physics_prior.dynamics.arrays import accumulate, clear
from physics_prior.dynamics.articulated_body import pull
from physics_prior.dynamics.constraint import complete, gather_rows, multiply, multiply_once, respond, row_count, width
from physics_prior.dynamics.constraint_errors import place, position_error, velocity_error
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import flow_part, pose_part
from physics_prior.dynamics.manifold import displace_part
from physics_prior.dynamics.records import ALL
from physics_prior.dynamics.types import Array, Records

ITERATIONS = 40  # at a fold each makes the error but four times smaller
FARTHEST = 0.5  # rad or m, of a freedom in one pass: where rows hardly hold a motion, they ask for any distance
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
    configuration nearby, which the workspace must hold, serve q as long as they make e ten times smaller (simplified
    Newton's method); the velocity has those of the final q, and the next step finds them there. Each pass moves the links that
    rows move; the others follow in the end. spare: three vectors (nv,).
    """
    right, w = rows[row_count(rows)], width(rows)
    z, delta, rest = spare[0], spare[1], spare[4]
    before, exact = math.inf, False
    clear(rest)
    pose_part(links, work, q, 0, w)
    place(work, pairs)
    error = position_error(pairs, right)
    for _ in range(ITERATIONS):
        if error <= min(known[-1], tolerance):
            break
        slow = error > 0.1 * before
        if slow:
            if error <= STALL or (exact and error > 0.5 * before):
                break
            follow(links, work, w, rest, delta, q)
            complete(links, work, pairs, rows, known, q)
        before, exact = error, slow
        if exact:
            multiply(rows)
        else:
            multiply_once(rows)
        clear(z)
        clear(delta)
        gather_rows(pairs, rows, w, z)
        pull(links, work, z, w, delta)
        farthest = 0.0
        for k in range(v.shape[0]):
            farthest = max(farthest, abs(delta[k]))
        share = 1.0
        if farthest > FARTHEST:
            share = FARTHEST / farthest
            for k in range(v.shape[0]):
                delta[k] *= share
        accumulate(share, z, rest)
        displace_part(links, q, delta, 0, w, q)
        pose_part(links, work, q, 0, w)
        place(work, pairs)
        error = position_error(pairs, right)
    follow(links, work, w, rest, delta, q)
    complete(links, work, pairs, rows, known, q)
    project_velocity(links, work, pairs, rows, v, spare)
    return error


@kernel
def follow(links: Records, work: Records, w: int, z: Array, delta: Array, q: Array) -> None:
    """Move the links that rows do not move as z (nv,), which is then cleared, moves them through the factors, and pose them."""
    if w < delta.shape[0]:
        pull(links, work, z, ALL, delta)
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
