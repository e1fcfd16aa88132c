"""Who touches, and who may before the step is over: only these get rows."""

import math

from physics_prior.dynamics.algebra import (
    ZERO,
    cross,
    dot,
    get3,
    get9,
    minus,
    plus,
    product,
    put3,
    put9,
    scale,
    times,
)
from physics_prior.dynamics.constraint_errors import point_velocity
from physics_prior.dynamics.contact.geometry.pairs import touch
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Matrix, Record, Records, Vector

TOUCHING = 1e-9  # m or rad: less is contact


@inline_kernel
def surface_pose(work: Records, link: int, position: Vector, R: Matrix) -> tuple[Vector, Matrix]:
    """Where a surface stands in the world: its centre and its axes."""
    if link < 0:
        return position, R
    on = work[link]
    turn = get9(on.rotation)
    return plus(get3(on.origin), times(turn, position)), product(turn, R)


@kernel
def find_points(work: Records, candidate: Record, reach: float, points: Array) -> int:
    """Fill points with where two surfaces are within reach, m, of each other, as ``touch`` says; return how many."""
    a, R_a = surface_pose(work, candidate.link_a, get3(candidate.position_a), get9(candidate.rotation_a))
    b, R_b = surface_pose(work, candidate.link_b, get3(candidate.position_b), get9(candidate.rotation_b))
    size_a, size_b = get3(candidate.size_a), get3(candidate.size_b)
    return touch(candidate.finder, candidate.exchanged != 0, size_a, a, R_a, size_b, b, R_b, reach, points)


@inline_kernel
def limit_gap(candidate: Record, q: Array) -> float:
    """How far a joint is inside this end of its range."""
    return float(candidate.sign * (q[candidate.coordinate] - candidate.bound))


@kernel
def look(work: Records, candidates: Records, points: Array, q: Array) -> float:
    """Fill the candidates' least gaps at q (nq,), m or rad; return the least of all. Needs ``pose``."""
    least = math.inf
    for i in range(candidates.shape[0]):
        candidate = candidates[i]
        if candidate.asleep:
            gap = math.inf
        elif candidate.is_limit:
            gap = limit_gap(candidate, q)
        else:
            count, gap = find_points(work, candidate, 0.0, points), math.inf
            for k in range(count):
                gap = min(gap, points[k, 9])
        candidate.gap = gap
        least = min(least, gap)
    return least


@kernel
def sweep_reach(work: Records, candidate: Record, h: float) -> float:
    """How much nearer any points of two surfaces can come in h seconds at the links' present velocities, m."""
    b, _ = surface_pose(work, candidate.link_b, get3(candidate.position_b), get9(candidate.rotation_b))
    shift, turn = ZERO, ZERO
    if candidate.link_b >= 0:
        shift, turn = point_velocity(work[candidate.link_b], b), get3(work[candidate.link_b].omega)
    if candidate.link_a >= 0:
        shift = minus(shift, point_velocity(work[candidate.link_a], b))
        turn = minus(turn, get3(work[candidate.link_a].omega))
    return float(h * (math.sqrt(dot(shift, shift)) + candidate.radius * math.sqrt(dot(turn, turn))))


@inline_kernel
def tangents(n: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors across a unit vector, and across each other."""
    if abs(n[0]) < 0.6:
        t = (0.0, n[2], -n[1])
    elif abs(n[1]) < 0.6:
        t = (-n[2], 0.0, n[0])
    else:
        t = (n[1], -n[0], 0.0)
    t = scale(1.0 / math.sqrt(dot(t, t)), t)
    return t, cross(n, t)


@kernel
def collect(
    work: Records, candidates: Records, contacts: Records, points: Array, q: Array, v: Array, links: Records, h: float
) -> int:
    """Fill contacts with all points that touch or may do so in h seconds at velocity v (nv,); return how many.

    With h = 0 those that touch now. Needs ``pose``, and ``flow`` of v.
    """
    count = 0
    for i in range(candidates.shape[0]):
        candidate = candidates[i]
        if candidate.asleep:
            continue
        if candidate.is_limit:
            gap = limit_gap(candidate, q)
            if gap <= TOUCHING + h * abs(v[links[candidate.link_b].v]):
                contact = contacts[count]
                contact.candidate, contact.gap = i, gap
                put3(contact.point, get3(work[candidate.link_b].origin))
                count += 1
            continue
        reach = TOUCHING + sweep_reach(work, candidate, h)
        found = find_points(work, candidate, reach, points)
        for k in range(found):
            if points[k, 9] <= reach:
                contact = contacts[count]
                contact.candidate, contact.gap = i, points[k, 9]
                a, b = get3(points[k, 0:3]), get3(points[k, 3:6])
                n = get3(points[k, 6:9])
                put3(contact.point, scale(0.5, plus(a, b)))
                s, t = tangents(n)
                put9(contact.frame, (n[0], n[1], n[2], s[0], s[1], s[2], t[0], t[1], t[2]))
                count += 1
    return count
