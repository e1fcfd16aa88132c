"""Analytic derivatives of the dynamics by the tangent of q and by v.

Inverse dynamics by spatial vectors: Singh, Russo and Wensing 2022 (their Psi-dot and Psi-double-dot below). A free joint
counts as a translation that carries a ball joint. Forward dynamics follow from them through the articulated-body factors.
"""

import numpy as np

from physics_prior.dynamics.algebra import (
    ZERO,
    add3,
    cross,
    dot,
    full,
    get3,
    get6,
    get9,
    minus,
    minus_outer,
    plus,
    put3,
    put6,
    put9,
    rows_crossed,
    scale,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.blocks import get_block, inner
from physics_prior.dynamics.gyroscopic import middle_correction, turning_inertia
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import freedom, freedoms
from physics_prior.dynamics.records import FREE, SPHERICAL
from physics_prior.dynamics.spatial import (
    add,
    at_point,
    cross_force,
    cross_motion,
    get_spatial,
    inertia_about,
    put_spatial,
)
from physics_prior.dynamics.types import Array, Matrix, Record, Records, Spatial, Symmetric, Vector

FREEDOM = np.dtype(
    [
        ("S", "f8", 6),  # direction of motion
        ("rate", "f8", 6),  # S_dot + psi_dot: what v does to the acceleration through it
        ("psi_dot", "f8", 6),  # V_parent x S
        ("psi_ddot", "f8", 6),  # A_parent x S + V_parent x psi_dot
        ("row", "f8", 12),  # what its force owes to psi_dot and psi_ddot, or to S and rate, of one that carries it
        ("column_q", "f8", 8),  # wrench by q that it asks of those that carry it; the last two are zero
        ("column_v", "f8", 8),  # ... and by v
        ("gain", "f8", 8),  # ... and per unit of its own force, through the articulated bodies (mass_factor.py)
        ("inverse", "f8"),  # of its entry in D
        ("parent", "i8"),  # the degree of freedom that carries this one, -1 at the world
        ("begin", "i8"),  # of the freedoms of its joint, of which a free one is two: a translation that carries a ball
        ("end", "i8"),
        ("last", "i8"),  # behind all that it carries
    ],
    align=True,
)
"""One degree of freedom as a spatial motion about the first link's origin. Pairs that stand side by side are read as one."""

COMPOSITE = np.dtype(
    [
        ("V", "f8", 6),  # velocity of the link
        ("A", "f8", 6),  # acceleration less gravity
        ("mass", "f8"),  # of the link and all it carries, kg
        ("first", "f8", 3),  # their mass times their centre, kg m
        ("inertia", "f8", 6),  # xx, xy, xz, yy, yz, zz, kg m^2
        ("momentum", "f8", 3),  # their linear momentum, kg m/s
        ("B", "f8", 9),  # moment by angular velocity of twice their body Coriolis matrix
        ("f", "f8", 6),  # their inertial force
    ],
    align=True,
)
"""One link and what it carries, about the first link's origin.

Twice the body Coriolis matrix, u -> V x* I u + u x* I V - I (V x u), takes a turn to the moment B turn and the force
2 turn x momentum, and a shift to nothing (Jacobi's identity).
"""


@inline_kernel
def _momentum(own: Record, u: Spatial) -> Spatial:
    """The momentum of all that a link carries, moving by u: (angular about the reference point, linear)."""
    first = get3(own.first)
    return (
        plus(symmetric_times(get6(own.inertia), u[0]), cross(first, u[1])),
        minus(scale(own.mass, u[1]), cross(first, u[0])),
    )


@inline_kernel
def _coriolis(own: Record, u: Spatial) -> Spatial:
    """Twice the body Coriolis matrix times u."""
    return times(get9(own.B), u[0]), scale(2.0, cross(u[0], get3(own.momentum)))


@inline_kernel
def _transposed_coriolis(own: Record, u: Spatial) -> Vector:
    """The transpose times u, of which only the moment is not zero."""
    return plus(transposed_times(get9(own.B), u[0]), scale(2.0, cross(get3(own.momentum), u[1])))


@inline_kernel
def _turning_coriolis(inertia: Symmetric, omega: Vector) -> Matrix:
    """Twice the body Coriolis matrix of a body that turns about its centre: A + A^T - [I omega]x, A = [omega]x I."""
    a = rows_crossed(omega, full(inertia))  # A^T, row by row: I is symmetric
    x, y, z = symmetric_times(inertia, omega)
    xy, xz, yz = a[1] + a[3], a[2] + a[6], a[5] + a[7]
    return 2.0 * a[0], xy + z, xz - y, xy - z, 2.0 * a[4], yz + x, xz + y, yz - x, 2.0 * a[8]


@inline_kernel
def _tell_order(links: Records, i: int, c: int, record: Record) -> None:
    """Fill where a freedom's joint begins and ends and what carries it."""
    link = links[i]
    first, count = link.v, freedoms(link.kind)
    record.parent, record.last = first + c - 1, first + c + 1
    record.begin, record.end = first, first + count
    if link.kind == FREE:
        record.begin, record.end = (first, first + 3) if c < 3 else (first + 3, first + 6)
    if c == 0:
        record.parent = -1
        if link.parent >= 0:
            record.parent = links[link.parent].v + freedoms(links[link.parent].kind) - 1


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
            _tell_order(links, i, c, record)
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
        linear = scale(mass, at_point(V, center))
        own.mass = mass
        put3(own.first, scale(mass, center))
        put3(own.momentum, linear)
        put6(own.inertia, inertia_about(inertia, mass, center))
        # and the moment of the force 2 turn x momentum at the centre
        B = minus_outer(_turning_coriolis(inertia, omega), scale(2.0, linear), center)
        along = 2.0 * dot(center, linear)
        put9(own.B, (B[0] + along, B[1], B[2], B[3], B[4] + along, B[5], B[6], B[7], B[8] + along))
        if step > 0.0 and (link.kind == SPHERICAL or link.kind == FREE) and mass > 0.0:
            turning = turning_inertia(link, here)
            for k in range(3):
                turn = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
                more = middle_correction(turning, omega, step, turn)
                for r in range(3):
                    own.B[3 * r + k] += more[r]
        lever = get3(here.center)
        force = scale(
            mass,
            plus(plus(get3(here.acceleration), cross(alpha, lever)), cross(omega, cross(omega, lever))),
        )
        moment = plus(plus(symmetric_times(inertia, alpha), get3(here.gyroscopic)), cross(center, force))
        put_spatial(own.f, (moment, force))
    for k in range(freedom_records.shape[0] - 1, 0, -1):
        record = freedom_records[k]
        if record.parent >= 0:
            freedom_records[record.parent].last = max(freedom_records[record.parent].last, record.last)
    for i in range(links.shape[0] - 1, 0, -1):
        if links[i].parent >= 0:
            own, up = composites[i], composites[links[i].parent]
            up.mass += own.mass
            add3(up.first, get3(own.first))
            add3(up.momentum, get3(own.momentum))
            for k in range(6):
                up.inertia[k] += own.inertia[k]
                up.f[k] += own.f[k]
            for k in range(9):
                up.B[k] += own.B[k]


@kernel
def inverse_dynamics_derivatives(
    links: Records, freedom_records: Records, composites: Records, tau_q: Array, tau_v: Array, L: Array
) -> None:
    """Fill the derivatives of inverse dynamics at fixed vdot, (nv, nv) each, NEGATED; no external forces.

    Needs ``sweep`` and ``factorize_mass``. Entries between branches are zero and left alone. L (nv, nv) gets the factor of
    the mass matrix below its diagonal.
    """
    _ask(links, freedom_records, composites)
    for k in range(freedom_records.shape[0]):
        own = freedom_records[k]
        row = get_block(own.row, 0, 12, 12)
        column_q, column_v = get_block(own.column_q, 0, 8, 8), get_block(own.column_v, 0, 8, 8)
        gain = get_block(own.gain, 0, 8, 8)
        for n in range(own.begin, own.end):
            by_psi, by_S = get_block(freedom_records[n].psi_dot, 0, 12, 12), get_block(freedom_records[n].S, 0, 12, 12)
            tau_q[k, n], tau_v[k, n], L[k, n] = inner(by_psi, row), inner(by_S, row), inner(gain, by_S)
        n = freedom_records[own.begin].parent
        while n >= 0:
            up = freedom_records[n]
            by_psi, by_S = get_block(up.psi_dot, 0, 12, 12), get_block(up.S, 0, 12, 12)
            tau_q[k, n], tau_v[k, n], L[k, n] = inner(by_psi, row), inner(by_S, row), inner(gain, by_S)
            tau_q[n, k], tau_v[n, k] = inner(column_q, by_S), inner(column_v, by_S)
            n = up.parent


@inline_kernel
def _ask(links: Records, freedom_records: Records, composites: Records) -> None:
    """Fill what each freedom's motion asks of those that carry it, negated: inertial wrenches of all that it carries."""
    for i in range(links.shape[0]):
        link, own = links[i], composites[i]
        f = get_spatial(own.f)
        for c in range(freedoms(link.kind)):
            record = freedom_records[link.v + c]
            S, psi_dot = get_spatial(record.S), get_spatial(record.psi_dot)
            psi_ddot, rate = get_spatial(record.psi_ddot), get_spatial(record.rate)
            put3(record.row[0:3], scale(-1.0, _transposed_coriolis(own, S)))
            put3(record.row[3:6], ZERO)
            put_spatial(record.row[6:12], _opposite(_momentum(own, S)))
            column_q = add(add(_coriolis(own, psi_dot), _momentum(own, psi_ddot)), cross_force(S, f))
            put_spatial(record.column_q[0:6], _opposite(column_q))
            put_spatial(record.column_v[0:6], _opposite(add(_coriolis(own, S), _momentum(own, rate))))
            for k in range(6, 8):
                record.column_q[k], record.column_v[k], record.gain[k] = 0.0, 0.0, 0.0


@inline_kernel
def _opposite(f: Spatial) -> Spatial:
    """The wrench -f."""
    return scale(-1.0, f[0]), scale(-1.0, f[1])
