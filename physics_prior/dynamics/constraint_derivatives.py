"""Analytic derivatives of point pairs: of their Jacobian, of their accelerations and of the forces they transmit.

Of a point p on a link, moved along a freedom S by the tangent of q (derivation: docs/equations.md):
    dV = S x V + psi_dot,  dA = S x A + psi_dot x V + psi_ddot,  and by v:  dV = S,  dA = S_dot + S x V + psi_dot.
"""

import math

import numpy as np

from physics_prior.dynamics.algebra import add3, cross, dot, get3, minus, plus, scale
from physics_prior.dynamics.constraint import direction, point_acceleration, point_velocity
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import freedoms
from physics_prior.dynamics.records import FREE
from physics_prior.dynamics.spatial import add, at_point, cross_motion, get_spatial

GAP = np.dtype(
    [
        ("point", "f8", (2, 3)),  # of points a and b by the tangent of q
        ("gap", "f8", 3),  # of b - a
        ("rate_q", "f8", 3),  # of its rate by the tangent of q (by v: gap)
        ("acceleration_q", "f8", 3),  # of its second rate
        ("acceleration_v", "f8", 3),
        ("turn", "f8", 3),  # angular motion of the directions
    ],
    align=True,
)
"""What one degree of freedom does to the present pair."""


@kernel
def differentiate_gap(links, work, freedom_records, composites, pair, gaps):
    """Fill gaps (nv,): the derivatives of b - a and its rates by every degree of freedom; needs ``sweep``, ``place``."""
    for k in range(gaps.shape[0]):
        gap = gaps[k]
        for c in range(3):
            gap.point[0, c] = 0.0
            gap.point[1, c] = 0.0
            gap.gap[c] = 0.0
            gap.rate_q[c] = 0.0
            gap.acceleration_q[c] = 0.0
            gap.acceleration_v[c] = 0.0
            gap.turn[c] = 0.0
    base = get3(work[0].origin)
    for side in range(2):
        sign = 2.0 * side - 1.0
        i = pair.link_b if side == 1 else pair.link_a
        if i < 0:
            continue
        p = minus(get3(pair.b) if side == 1 else get3(pair.a), base)
        V, A = get_spatial(composites[i].V), get_spatial(composites[i].A)
        omega, velocity = V[0], at_point(V, p)
        while i >= 0:
            for c in range(freedoms(links[i].kind)):
                k = links[i].v + c
                record, gap = freedom_records[k], gaps[k]
                S, psi_dot = get_spatial(record.S), get_spatial(record.psi_dot)
                moved = at_point(S, p)
                SxV = cross_motion(S, V)
                V_q = add(SxV, psi_dot)
                A_q = add(add(cross_motion(S, A), cross_motion(psi_dot, V)), get_spatial(record.psi_ddot))
                A_v = add(add(get_spatial(record.S_dot), SxV), psi_dot)
                velocity_q = plus(at_point(V_q, p), cross(omega, moved))
                by_q = plus(
                    plus(at_point(A_q, p), cross(A[0], moved)),
                    plus(cross(V_q[0], velocity), cross(omega, velocity_q)),
                )
                by_v = plus(at_point(A_v, p), plus(cross(S[0], velocity), cross(omega, moved)))
                for e in range(3):
                    gap.point[side, e] = moved[e]
                add3(gap.gap, scale(sign, moved))
                add3(gap.rate_q, scale(sign, velocity_q))
                add3(gap.acceleration_q, scale(sign, by_q))
                add3(gap.acceleration_v, scale(sign, by_v))
                if side == 0:
                    add3(gap.turn, S[0])
            i = links[i].parent


@inline_kernel
def turned(pair, row, gap):
    """The derivative of a row's direction by a degree of freedom."""
    d = direction(pair, row)
    if pair.is_rod:
        between = minus(get3(pair.b), get3(pair.a))
        along = dot(d, get3(gap.gap))
        return scale(1.0 / math.sqrt(dot(between, between)), minus(get3(gap.gap), scale(along, d)))
    return cross(get3(gap.turn), d)


@kernel
def differentiate_rows(links, work, pairs, freedom_records, composites, gravity, gaps, A, A_q, rows_q, rows_v, tau_q):
    """Fill the derivatives of all rows, and take those of A^T lambda from tau_q (nv, nv).

    A (m, nv): the constraint Jacobian. A_q (m, nv): derivative of A v by q. rows_q, rows_v (m, nv): of the rows'
    accelerations at fixed vdot. Needs ``sweep`` and constrained accelerations; gaps (nv,) is scratch.
    """
    nv = gaps.shape[0]
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        differentiate_gap(links, work, freedom_records, composites, pair, gaps)
        a, b = get3(pair.a), get3(pair.b)
        rate = minus(point_velocity(work, pair.link_b, b), point_velocity(work, pair.link_a, a))
        acceleration = minus(
            point_acceleration(work, pair.link_b, b, gravity),
            point_acceleration(work, pair.link_a, a, gravity),
        )
        between = minus(b, a)
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
def _differentiate_transmission(links, pair, freedom_records, gaps, force, tau_q, base):
    """Subtract from tau_q the derivative of A^T lambda at fixed multipliers."""
    nv = gaps.shape[0]
    for side in range(2):
        sign = 2.0 * side - 1.0
        i = pair.link_b if side == 1 else pair.link_a
        p = minus(get3(pair.b) if side == 1 else get3(pair.a), base)
        pushed = scale(sign, force)
        while i >= 0:
            for c in range(freedoms(links[i].kind)):
                k = links[i].v + c
                S = get_spatial(freedom_records[k].S)
                here = gaps[k].point[side]
                for n in range(nv):
                    gap = gaps[n]
                    if pair.is_rod:
                        along = dot(force, direction(pair, 0))
                        force_q = scale(sign * along, turned(pair, 0, gap))
                    else:
                        force_q = cross(get3(gap.turn), pushed)
                    moved = get3(gap.point[side])
                    tau_q[k, n] -= dot(get3(here), force_q) + dot(S[0], cross(moved, pushed))
                j = i
                while j >= 0:
                    for e in range(freedoms(links[j].kind)):
                        n = links[j].v + e
                        if j == i and links[i].kind == FREE and c < 3:
                            continue  # the translation of a free joint carries its turn, not the reverse
                        S_up = get_spatial(freedom_records[n].S)
                        tau_q[k, n] -= dot(at_point(cross_motion(S_up, S), p), pushed)
                    j = links[j].parent
            i = links[i].parent
