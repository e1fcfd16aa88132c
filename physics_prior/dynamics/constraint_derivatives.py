"""Analytic derivatives of point pairs: of their Jacobian, of their accelerations and of the forces they transmit.

Of a link moved along a freedom S by the tangent of q (derivation: docs/kernels.md):
    dV = S x V + psi_dot,  dA = S x A + psi_dot x V + psi_ddot,  and by v:  dV = S,  dA = S_dot + S x V + psi_dot.
"""

import math

import numpy as np

from physics_prior.dynamics.algebra import add3, cross, dot, get3, minus, plus, put3, scale
from physics_prior.dynamics.constraint_errors import approach, direction, relative_acceleration
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import freedoms
from physics_prior.dynamics.records import FREE
from physics_prior.dynamics.spatial import add, at_point, cross_motion, get_spatial
from physics_prior.dynamics.types import Array, Record, Records, Vector

GAP = np.dtype(
    [
        ("moved", "f8", 3),  # of point b by the tangent of q
        ("held", "f8", 3),  # of where the force holds link a
        ("gap", "f8", 3),  # velocity of b against link a by v
        ("rate_q", "f8", 3),  # ... by the tangent of q
        ("acceleration_q", "f8", 3),  # of the relative acceleration
        ("acceleration_v", "f8", 3),
        ("turn", "f8", 3),  # angular velocity of link a by v: the directions turn with it
        ("turn_q", "f8", 3),  # ... by the tangent of q
    ],
    align=True,
)
"""What one degree of freedom does to the present pair."""


@kernel
def differentiate_gap(
    links: Records, work: Records, freedom_records: Records, composites: Records, pair: Record, gaps: Records
) -> None:
    """Fill gaps (nv,): the derivatives of where a pair's points are and how they move; needs ``sweep``, ``place``."""
    for k in range(gaps.shape[0]):
        gap = gaps[k]
        for c in range(3):
            gap.moved[c] = 0.0
            gap.held[c] = 0.0
            gap.gap[c] = 0.0
            gap.rate_q[c] = 0.0
            gap.acceleration_q[c] = 0.0
            gap.acceleration_v[c] = 0.0
            gap.turn[c] = 0.0
            gap.turn_q[c] = 0.0
    base = get3(work[0].origin)
    _differentiate_side(links, freedom_records, composites, pair, gaps, 1.0, pair.link_b, minus(get3(pair.b), base))
    if not pair.is_rod:
        # the force holds link a where b is
        for k in range(gaps.shape[0]):
            put3(gaps[k].held, get3(gaps[k].moved))
    i = pair.link_a
    if i < 0:
        return
    _differentiate_side(links, freedom_records, composites, pair, gaps, -1.0, i, minus(get3(pair.hold), base))
    if not pair.is_rod:
        rate, omega = approach(work, pair), get3(work[i].omega)
        for k in range(gaps.shape[0]):
            gap = gaps[k]
            by_q = plus(cross(get3(gap.turn_q), rate), cross(omega, get3(gap.rate_q)))
            by_v = plus(cross(get3(gap.turn), rate), cross(omega, get3(gap.gap)))
            add3(gap.acceleration_q, scale(-2.0, by_q))
            add3(gap.acceleration_v, scale(-2.0, by_v))


@inline_kernel
def _differentiate_side(
    links: Records,
    freedom_records: Records,
    composites: Records,
    pair: Record,
    gaps: Records,
    sign: float,
    link: int,
    p: Vector,
) -> None:
    """Add what the motion of one side's link does at its point p, and how the point moves."""
    if link >= 0:
        V, A = get_spatial(composites[link].V), get_spatial(composites[link].A)
        omega, velocity = V[0], at_point(V, p)
        i = link
        while i >= 0:
            for c in range(freedoms(links[i].kind)):
                k = links[i].v + c
                record, gap = freedom_records[k], gaps[k]
                S, psi_dot = get_spatial(record.S), get_spatial(record.psi_dot)
                SxV = cross_motion(S, V)
                V_q = add(SxV, psi_dot)
                A_q = add(add(cross_motion(S, A), cross_motion(psi_dot, V)), get_spatial(record.psi_ddot))
                A_v = add(get_spatial(record.rate), SxV)
                moved, velocity_q = at_point(S, p), at_point(V_q, p)
                by_q = plus(at_point(A_q, p), plus(cross(V_q[0], velocity), cross(omega, velocity_q)))
                by_v = plus(at_point(A_v, p), plus(cross(S[0], velocity), cross(omega, moved)))
                add3(gap.gap, scale(sign, moved))
                add3(gap.rate_q, scale(sign, velocity_q))
                add3(gap.acceleration_q, scale(sign, by_q))
                add3(gap.acceleration_v, scale(sign, by_v))
                if sign > 0.0:
                    put3(gap.moved, moved)
                else:
                    put3(gap.turn, S[0])
                    put3(gap.turn_q, V_q[0])
                    if pair.is_rod:
                        put3(gap.held, moved)
            i = links[i].parent
        for k in range(gaps.shape[0]):
            gap = gaps[k]
            moved = get3(gap.moved) if sign > 0.0 else get3(gap.held)
            turned_point = cross(omega, moved)
            add3(gap.rate_q, scale(sign, turned_point))
            add3(gap.acceleration_q, scale(sign, plus(cross(A[0], moved), cross(omega, turned_point))))


@inline_kernel
def turned(pair: Record, row: int, gap: Record) -> Vector:
    """The derivative of a row's direction by a degree of freedom."""
    d = direction(pair, row)
    if pair.is_rod:
        between = minus(get3(pair.b), get3(pair.a))
        change = minus(get3(gap.moved), get3(gap.held))
        return scale(1.0 / math.sqrt(dot(between, between)), minus(change, scale(dot(d, change), d)))
    return cross(get3(gap.turn), d)


@kernel
def differentiate_rows(
    links: Records,
    work: Records,
    pairs: Records,
    freedom_records: Records,
    composites: Records,
    gravity: Array,
    gaps: Records,
    A: Array,
    A_q: Array,
    rows_q: Array,
    rows_v: Array,
    tau_q: Array,
) -> None:
    """Fill the derivatives of all rows, and add those of A^T lambda to tau_q (nv, nv).

    A (m, nv): the constraint Jacobian. A_q (m, nv): derivative of A v by q. rows_q, rows_v (m, nv): of the rows'
    accelerations at fixed vdot. Needs ``sweep`` and constrained accelerations; gaps (nv,) is scratch.
    """
    nv = gaps.shape[0]
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        if not pair.active:
            for r in range(pair.first, pair.first + pair.rows):
                for k in range(nv):
                    A[r, k], A_q[r, k], rows_q[r, k], rows_v[r, k] = 0.0, 0.0, 0.0, 0.0
            continue
        differentiate_gap(links, work, freedom_records, composites, pair, gaps)
        rate, acceleration = approach(work, pair), relative_acceleration(work, pair, get3(gravity))
        between = minus(get3(pair.b), get3(pair.a))
        distance = math.sqrt(dot(between, between))
        for row in range(pair.rows):
            r, d = pair.first + row, direction(pair, row)
            for k in range(nv):
                gap = gaps[k]
                d_q = turned(pair, row, gap)
                A[r, k] = dot(d, get3(gap.gap))
                A_q[r, k] = dot(d, get3(gap.rate_q)) + dot(d_q, rate)
                by_q = dot(d, get3(gap.acceleration_q)) + dot(d_q, acceleration)
                by_v = dot(d, get3(gap.acceleration_v))
                if pair.is_rod:
                    along = dot(d, rate)
                    across = (dot(rate, rate) - along * along) / distance
                    by_q += 2.0 * (dot(rate, get3(gap.rate_q)) - along * A_q[r, k]) / distance
                    by_q -= across * A[r, k] / distance
                    by_v += 2.0 * (dot(rate, get3(gap.gap)) - along * A[r, k]) / distance
                rows_q[r, k], rows_v[r, k] = by_q, by_v
        force = get3(pair.force)
        _differentiate_transmission(links, pair, freedom_records, gaps, force, tau_q, get3(work[0].origin))


@inline_kernel
def _differentiate_transmission(
    links: Records, pair: Record, freedom_records: Records, gaps: Records, force: Vector, tau_q: Array, base: Vector
) -> None:
    """Add to tau_q the derivative of A^T lambda at fixed multipliers."""
    nv = gaps.shape[0]
    for side in range(2):
        sign = 2.0 * side - 1.0
        i = pair.link_b if side == 1 else pair.link_a
        p = minus(get3(pair.b) if side == 1 else get3(pair.hold), base)
        pushed = scale(sign, force)
        while i >= 0:
            for c in range(freedoms(links[i].kind)):
                k = links[i].v + c
                S = get_spatial(freedom_records[k].S)
                here = at_point(S, p)
                for n in range(nv):
                    gap = gaps[n]
                    if pair.is_rod:
                        along = dot(force, direction(pair, 0))
                        force_q = scale(sign * along, turned(pair, 0, gap))
                    else:
                        force_q = cross(get3(gap.turn), pushed)
                    moved = get3(gap.moved) if side == 1 else get3(gap.held)
                    tau_q[k, n] += dot(here, force_q) + dot(S[0], cross(moved, pushed))
                j = i
                while j >= 0:
                    for e in range(freedoms(links[j].kind)):
                        n = links[j].v + e
                        if j == i and links[i].kind == FREE and c < 3:
                            continue  # the translation of a free joint carries its turn, not the reverse
                        S_up = get_spatial(freedom_records[n].S)
                        tau_q[k, n] += dot(at_point(cross_motion(S_up, S), p), pushed)
                    j = links[j].parent
            i = links[i].parent
