"""Projection onto the constraints in the mass metric, of positions and velocities (design eq. 11)."""

import math

from physics_prior.dynamics.constraint import (
    complete,
    multiply,
    place,
    position_error,
    respond,
    row_count,
    velocity_error,
)
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import flow, pose
from physics_prior.dynamics.manifold import displace
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
    Newton's method); the velocity has those of the final q, and the next step finds them there. spare (2, nv).
    """
    right = rows[row_count(rows)]
    before, exact = math.inf, False
    pose(links, work, q)
    place(work, pairs)
    error = position_error(pairs, right)
    for _ in range(ITERATIONS):
        if error <= min(known[-1], tolerance):
            break
        slow = error > 0.1 * before
        if slow:
            if error <= STALL or (exact and error > 0.5 * before):
                break
            complete(links, work, pairs, rows, known, q)
        before, exact = error, slow
        multiply(rows)
        respond(links, work, rows, spare[0], spare[1])
        farthest = 0.0
        for k in range(v.shape[0]):
            farthest = max(farthest, abs(spare[1, k]))
        if farthest > FARTHEST:
            for k in range(v.shape[0]):
                spare[1, k] *= FARTHEST / farthest
        displace(links, q, spare[1], q)
        pose(links, work, q)
        place(work, pairs)
        error = position_error(pairs, right)
    complete(links, work, pairs, rows, known, q)
    project_velocity(links, work, pairs, rows, v, spare)
    return error


@kernel
def project_velocity(links: Records, work: Records, pairs: Records, rows: Array, v: Array, spare: Array) -> None:
    """Put v (nv,) onto the constraints by the impulse that takes it there (design eq. 9); needs factors and rows of q."""
    flow(links, work, v)
    velocity_error(work, pairs, rows[row_count(rows)])
    multiply(rows)
    respond(links, work, rows, spare[0], spare[1])
    for k in range(v.shape[0]):
        v[k] += spare[1, k]
