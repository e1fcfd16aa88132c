"""Analytic derivatives of the dynamics by the tangent of q and by v.

Inverse dynamics by spatial vectors: Singh, Russo and Wensing 2022 (their Psi-dot and Psi-double-dot below). A free joint
counts as a translation that carries a ball joint. Forward dynamics follow from them through the articulated-body factors.
"""

import numpy as np

from physics_prior.dynamics.algebra import cross, get3, get6, minus, plus, scale, symmetric_times
from physics_prior.dynamics.gyroscopic import middle_correction, turning_inertia
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import freedom, freedoms
from physics_prior.dynamics.records import FREE, SPHERICAL
from physics_prior.dynamics.spatial import (
    add,
    at_point,
    columns_times,
    cross_force,
    cross_motion,
    get_spatial,
    power,
    put_spatial,
    rows_times,
)
from physics_prior.dynamics.types import Array, Records, Spatial, Symmetric, Vector

FREEDOM = np.dtype(
    [
        ("S", "f8", 6),  # direction of motion
        ("rate", "f8", 6),  # S_dot + psi_dot: what v does to the acceleration through it
        ("psi_dot", "f8", 6),  # V_parent x S
        ("psi_ddot", "f8", 6),  # A_parent x S + V_parent x psi_dot
        ("parent", "i8"),  # the degree of freedom that carries this one, -1 at the world
    ],
    align=True,
)
"""One degree of freedom as a spatial motion about the first link's origin."""

COMPOSITE = np.dtype(
    [
        ("V", "f8", 6),  # velocity of the link
        ("A", "f8", 6),  # acceleration less gravity
        ("I", "f8", 36),  # inertia of the link and all it carries, by columns
        ("B", "f8", 36),  # twice their body Coriolis matrix, by columns
        ("f", "f8", 6),  # their inertial force
    ],
    align=True,
)
"""One link and what it carries, about the first link's origin."""


@inline_kernel
def _rigid(inertia: Symmetric, mass: float, center: Vector, u: Spatial) -> Spatial:
    """The momentum of motion u: (angular about the reference point, linear)."""
    linear = scale(mass, at_point(u, center))
    return plus(symmetric_times(inertia, u[0]), cross(center, linear)), linear


@kernel
def sweep(
    links: Records, work: Records, gravity: Array, step: float, freedom_records: Records, composites: Records
) -> None:
    """Fill freedoms (nv,) and composites (N,) from velocities and accelerations in the workspace.

    step > 0 differentiates the gyroscopic torque in its midpoint form for that step, 0 the explicit one.
    """
    base = get3(work[0].origin)
    for i in range(links.shape[0]):
        link, here, own = links[i], work[i], composites[i]
        d = minus(get3(here.origin), base)
        omega, alpha = get3(here.omega), get3(here.alpha)
        velocity = minus(get3(here.velocity), cross(omega, d))
        V = (omega, velocity)
        A = (
            alpha,
            minus(minus(get3(here.acceleration), cross(alpha, d)), cross(omega, get3(here.velocity))),
        )
        put_spatial(own.V, V)
        put_spatial(own.A, A)
        still = (0.0, 0.0, 0.0)
        V_up, A_up = (still, still), (still, (-gravity[0], -gravity[1], -gravity[2]))
        if link.parent >= 0:
            V_up, A_up = get_spatial(composites[link.parent].V), get_spatial(composites[link.parent].A)
        for c in range(freedoms(link.kind)):
            record = freedom_records[link.v + c]
            record.parent = link.v + c - 1
            if c == 0:
                record.parent = -1
                if link.parent >= 0:
                    record.parent = links[link.parent].v + freedoms(links[link.parent].kind) - 1
            turn, shift = freedom(link.kind, here, c)
            S = (turn, plus(shift, cross(d, turn)))
            S_dot = cross_motion(V, S)
            if link.kind == FREE:
                if c < 3:
                    S_dot = (still, still)
                else:
                    V_up, A_up = (still, get3(here.velocity)), (still, get3(here.acceleration))
            psi_dot = cross_motion(V_up, S)
            put_spatial(record.S, S)
            put_spatial(record.rate, add(S_dot, psi_dot))
            put_spatial(record.psi_dot, psi_dot)
            put_spatial(record.psi_ddot, add(cross_motion(A_up, S), cross_motion(V_up, psi_dot)))
        inertia, mass, center = get6(here.inertia), link.mass, plus(d, get3(here.center))
        momentum = _rigid(inertia, mass, center, V)
        turning = turning_inertia(link, here)
        middle = step > 0.0 and (link.kind == SPHERICAL or link.kind == FREE) and mass > 0.0
        for k in range(6):
            turn = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
            shift = (1.0 if k == 3 else 0.0, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0)
            u = (turn, shift)
            Iu = _rigid(inertia, mass, center, u)
            Ivu = _rigid(inertia, mass, center, cross_motion(V, u))
            put_spatial(own.I[6 * k : 6 * k + 6], Iu)
            Bu = add(cross_force(V, Iu), cross_force(u, momentum))
            Bu = (minus(Bu[0], Ivu[0]), minus(Bu[1], Ivu[1]))
            if middle and k < 3:
                Bu = (plus(Bu[0], middle_correction(turning, omega, step, turn)), Bu[1])
            put_spatial(own.B[6 * k : 6 * k + 6], Bu)
        lever = get3(here.center)
        force = scale(
            mass,
            plus(plus(get3(here.acceleration), cross(alpha, lever)), cross(omega, cross(omega, lever))),
        )
        moment = plus(plus(symmetric_times(inertia, alpha), get3(here.gyroscopic)), cross(center, force))
        put_spatial(own.f, (moment, force))
    for i in range(links.shape[0] - 1, 0, -1):
        if links[i].parent >= 0:
            own, up = composites[i], composites[links[i].parent]
            for k in range(36):
                up.I[k] += own.I[k]
                up.B[k] += own.B[k]
            for k in range(6):
                up.f[k] += own.f[k]


@kernel
def inverse_dynamics_derivatives(
    links: Records, freedom_records: Records, composites: Records, tau_q: Array, tau_v: Array, M: Array
) -> None:
    """Fill the derivatives of inverse dynamics at fixed vdot, (nv, nv) each, after ``sweep``; no external forces.

    Entries between branches are zero and left alone. M (nv, nv) gets the mass matrix below its diagonal.
    """
    for i in range(links.shape[0]):
        link, own = links[i], composites[i]
        f = get_spatial(own.f)
        for c in range(freedoms(link.kind)):
            k = link.v + c
            record = freedom_records[k]
            S, psi_dot = get_spatial(record.S), get_spatial(record.psi_dot)
            psi_ddot, rate = get_spatial(record.psi_ddot), get_spatial(record.rate)
            row_B, momentum = rows_times(own.B, S), columns_times(own.I, S)
            column_q = add(add(columns_times(own.B, psi_dot), columns_times(own.I, psi_ddot)), cross_force(S, f))
            column_v = add(columns_times(own.B, S), columns_times(own.I, rate))
            j = i
            while j >= 0:
                other = links[j]
                for e in range(freedoms(other.kind)):
                    translation_carries_ball = j == i and link.kind == FREE
                    if translation_carries_ball and c < 3 and e >= 3:
                        continue  # filled with the roles exchanged
                    n = other.v + e
                    up = freedom_records[n]
                    S_up, psi_up = get_spatial(up.S), get_spatial(up.psi_dot)
                    tau_q[k, n] = power(psi_up, row_B) + power(get_spatial(up.psi_ddot), momentum)
                    M[k, n] = power(S_up, momentum)
                    tau_v[k, n] = power(S_up, row_B) + power(get_spatial(up.rate), momentum)
                    if j != i or (translation_carries_ball and c >= 3 and e < 3):
                        tau_q[n, k] = power(S_up, column_q)
                        tau_v[n, k] = power(S_up, column_v)
                j = other.parent
