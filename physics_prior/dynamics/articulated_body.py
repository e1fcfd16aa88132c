"""Forward dynamics by articulated bodies: what a force does to the whole tree, in time linear in its links.

Source: Featherstone 2008, ch. 7. World axes, each link about its own joint: articulated inertias shift but never
rotate. A ball joint passes only a force and a 3x3 articulated mass to its parent; a free root is solved as a block.
The inertias (``factorize``) and what runs through them (``accelerate``) are separate, because unit forces of
constraints, projections and derivatives run through the same factors.
"""

from physics_prior.dynamics.algebra import (
    ZERO,
    add3,
    cross,
    determinant,
    dot,
    dots,
    fma,
    get3,
    get6,
    get9,
    minus,
    minus_outer,
    plus,
    put3,
    put6,
    put9,
    scale,
    scale6,
    scale9,
    symmetric_adjugate,
    symmetric_inverse,
    symmetric_product,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import ALL, FREE, PRISMATIC, REVOLUTE
from physics_prior.dynamics.types import Array, Matrix, Record, Records, Symmetric, Vector


@inline_kernel
def crossed_mass(arm: Vector, M: Symmetric) -> Matrix:
    """The matrix [arm]x M."""
    x, y, z = arm
    return (
        determinant(y, M[2], z, M[1]),
        determinant(y, M[4], z, M[3]),
        determinant(y, M[5], z, M[4]),
        determinant(z, M[0], x, M[2]),
        determinant(z, M[1], x, M[4]),
        determinant(z, M[2], x, M[5]),
        determinant(x, M[1], y, M[0]),
        determinant(x, M[3], y, M[1]),
        determinant(x, M[4], y, M[2]),
    )


@inline_kernel
def shift_to_parent(up: Record, arm: Vector, J: Symmetric, H: Matrix, M: Symmetric) -> None:
    """Add an articulated inertia about a joint to the parent link's, whose origin is ``arm`` before it."""
    x, y, z = arm
    # B = [arm]x H^T, so that the shifted J is J + B + B^T - [arm]x M [arm]x; the last falls to the mass
    up.J[0] += fma(2.0, determinant(y, H[2], z, H[1]), J[0])
    up.J[1] += J[1] + fma(y, H[5], fma(-z, H[4], determinant(z, H[0], x, H[2])))
    up.J[2] += J[2] + fma(y, H[8], fma(-z, H[7], determinant(x, H[1], y, H[0])))
    up.J[3] += fma(2.0, determinant(z, H[3], x, H[5]), J[3])
    up.J[4] += J[4] + fma(z, H[6], fma(-x, H[8], determinant(x, H[4], y, H[3])))
    up.J[5] += fma(2.0, determinant(x, H[7], y, H[6]), J[5])
    for k in range(9):
        up.H[k] += H[k]
    shift_mass_to_parent(up, arm, M)


@inline_kernel
def shift_mass_to_parent(up: Record, arm: Vector, M: Symmetric) -> None:
    """Add an articulated mass at a joint, all that a ball joint passes on, to the parent link's inertia."""
    x, y, z = arm
    s = crossed_mass(arm, M)
    up.J[0] += fma(s[2], y, -(s[1] * z))
    up.J[1] += fma(s[0], z, -(s[2] * x))
    up.J[2] += fma(s[1], x, -(s[0] * y))
    up.J[3] += fma(s[3], z, -(s[5] * x))
    up.J[4] += fma(s[4], x, -(s[3] * y))
    up.J[5] += fma(s[7], x, -(s[6] * y))
    for k in range(9):
        up.H[k] += s[k]
    for k in range(6):
        up.M[k] += M[k]


@inline_kernel
def _schur(M: Symmetric, H: Matrix, C: Matrix, s: float) -> Symmetric:
    """The symmetric matrix M - s H^T C: the mass felt through a ball joint, s C = J^-1 H; s, a division, comes last."""
    return (
        fma(-s, dots(H[0], H[3], H[6], C[0], C[3], C[6]), M[0]),
        fma(-s, dots(H[0], H[3], H[6], C[1], C[4], C[7]), M[1]),
        fma(-s, dots(H[0], H[3], H[6], C[2], C[5], C[8]), M[2]),
        fma(-s, dots(H[1], H[4], H[7], C[1], C[4], C[7]), M[3]),
        fma(-s, dots(H[1], H[4], H[7], C[2], C[5], C[8]), M[4]),
        fma(-s, dots(H[2], H[5], H[8], C[2], C[5], C[8]), M[5]),
    )


@inline_kernel
def _minus_symmetric(m: Symmetric, u: Vector, w: Vector) -> Symmetric:
    """The symmetric matrix m - u w^T, u along w."""
    return (
        fma(-u[0], w[0], m[0]),
        fma(-u[0], w[1], m[1]),
        fma(-u[0], w[2], m[2]),
        fma(-u[1], w[1], m[3]),
        fma(-u[1], w[2], m[4]),
        fma(-u[2], w[2], m[5]),
    )


@kernel
def factorize(links: Records, work: Records) -> None:
    """Turn the rigid inertias that ``weigh`` left into the articulated ones of all links, inward."""
    for step in range(links.shape[0] - 1, -1, -1):
        i = links[step].visit
        link, here = links[i], work[i]
        J, H, M = get6(here.J), get9(here.H), get6(here.M)
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            s = get3(here.axis)
            if link.kind == REVOLUTE:
                n, f = symmetric_times(J, s), transposed_times(H, s)
                D = 1.0 / dot(s, n)
            else:
                n, f = times(H, s), symmetric_times(M, s)
                D = 1.0 / dot(s, f)
            put3(here.U_moment, n)
            put3(here.U_force, f)
            here.D = D
            if link.parent >= 0:
                a, b = scale(D, n), scale(D, f)
                J = _minus_symmetric(J, a, n)
                M = _minus_symmetric(M, b, f)
                H = minus_outer(H, a, f)
                shift_to_parent(work[link.parent], get3(here.arm), J, H, M)
        else:
            adjugate, inverse = symmetric_adjugate(J)
            C = symmetric_product(adjugate, H)
            put6(here.J_inverse, scale6(inverse, adjugate))
            put9(here.K, scale9(inverse, C))
            M = _schur(M, H, C, inverse)
            put6(here.M, M)
            if link.kind == FREE:
                put6(here.M_inverse, symmetric_inverse(M))
            elif link.parent >= 0:
                shift_mass_to_parent(work[link.parent], get3(here.arm), M)


@inline_kernel
def accelerate(links: Records, work: Records, tau: Array, gravity: Array, vdot: Array) -> None:
    """Fill vdot (nv,) from generalized forces tau (nv,), external wrenches, velocities and gravity (3,).

    Needs ``move`` and ``factorize``. Spherical entries of tau and vdot are in the link's axes, the linear ones of a free
    joint in the world's. Leaves alpha and acceleration (less gravity) of every link in the workspace.
    """
    gather(links, work, tau)
    release(links, work, gravity, ALL, vdot)


@kernel
def gather(links: Records, work: Records, tau: Array) -> None:
    """Run all forces inward through the factors: what is left at each joint to accelerate it."""
    for step in range(links.shape[0] - 1, -1, -1):
        i = links[step].visit
        link, here = links[i], work[i]
        omega, center = get3(here.omega), get3(here.center)
        own = scale(link.mass, cross(omega, cross(omega, center)))
        moment = plus(get3(here.bias_moment), plus(get3(here.gyroscopic), cross(center, own)))
        moment = minus(moment, get3(here.moment))
        force = plus(get3(here.bias_force), minus(own, get3(here.force)))
        n = link.v
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            u = tau[n] - dot(get3(here.axis), moment if link.kind == REVOLUTE else force)
            here.u[0] = u
            if link.parent >= 0:
                angular, linear = get3(here.coriolis_angular), get3(here.coriolis_linear)
                H, across, along = get9(here.H), get3(here.U_moment), get3(here.U_force)
                # what the joint gives way by its own force and to what is carried
                share = here.D * (u - dot(across, angular) - dot(along, linear))
                carried = plus(symmetric_times(get6(here.J), angular), times(H, linear))
                moment = plus(moment, plus(carried, scale(share, across)))
                carried = plus(transposed_times(H, angular), symmetric_times(get6(here.M), linear))
                force = plus(force, plus(carried, scale(share, along)))
        else:
            first = n + 3 if link.kind == FREE else n
            torque = times(get9(here.rotation), (tau[first], tau[first + 1], tau[first + 2]))
            u = minus(torque, moment)
            put3(here.u, u)
            moment = torque
            force = plus(force, transposed_times(get9(here.K), u))
            if link.kind == FREE:
                put3(here.bias_force, minus((tau[n], tau[n + 1], tau[n + 2]), force))
            elif link.parent >= 0:
                force = plus(force, symmetric_times(get6(here.M), get3(here.coriolis_linear)))
        if link.parent >= 0:
            up = work[link.parent]
            moment = plus(moment, cross(get3(here.arm), force))
            put3(up.bias_moment, plus(get3(up.bias_moment), moment))
            put3(up.bias_force, plus(get3(up.bias_force), force))


@kernel
def release(links: Records, work: Records, gravity: Array, end: int, vdot: Array) -> None:
    """Run what ``gather`` left at the joints outward: accelerations of the links whose column is before end."""
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        if link.column >= end:
            continue
        alpha, acceleration = ZERO, (-gravity[0], -gravity[1], -gravity[2])
        if link.parent >= 0:
            up = work[link.parent]
            alpha = get3(up.alpha)
            acceleration = plus(get3(up.acceleration), cross(alpha, get3(here.arm)))
        acceleration = plus(acceleration, get3(here.coriolis_linear))
        alpha = plus(alpha, get3(here.coriolis_angular))
        n = link.v
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            rate = here.D * (here.u[0] - dot(get3(here.U_moment), alpha) - dot(get3(here.U_force), acceleration))
            vdot[n] = rate
            if link.kind == REVOLUTE:
                alpha = plus(alpha, scale(rate, get3(here.axis)))
            else:
                acceleration = plus(acceleration, scale(rate, get3(here.axis)))
        else:
            if link.kind == FREE:
                acceleration = symmetric_times(get6(here.M_inverse), get3(here.bias_force))
                vdot[n] = acceleration[0] + gravity[0]
                vdot[n + 1] = acceleration[1] + gravity[1]
                vdot[n + 2] = acceleration[2] + gravity[2]
                n += 3
            total = minus(symmetric_times(get6(here.J_inverse), get3(here.u)), times(get9(here.K), acceleration))
            local = transposed_times(get9(here.rotation), minus(total, alpha))
            vdot[n], vdot[n + 1], vdot[n + 2] = local
            alpha = total
        put3(here.alpha, alpha)
        put3(here.acceleration, acceleration)


@kernel
def load_joints(links: Records, work: Records, end: int, forces: Array) -> None:
    """Add generalized forces (w,), run through the factors as ``push`` does, to what ``gather`` left at the joints."""
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        k = link.column
        if k >= end:
            continue
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            here.u[0] += forces[k]
        else:
            if link.kind == FREE:
                add3(here.bias_force, get3(forces[k : k + 3]))
                k += 3
            add3(here.u, get3(forces[k : k + 3]))


@kernel
def pull(links: Records, work: Records, z: Array, begin: int, end: int, vdot: Array) -> None:
    """Run z (nv,) outward through the factors: fill vdot (nv,) = M^-1 tau, and the links' increments of acceleration.

    Those of the links whose column is in [begin, end); the increments of what they hang on must be there.
    """
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        if link.column < begin or link.column >= end:
            continue
        alpha, acceleration = ZERO, ZERO
        if link.parent >= 0:
            up = work[link.parent]
            alpha = get3(up.delta_alpha)
            acceleration = plus(get3(up.delta_acceleration), cross(alpha, get3(here.arm)))
        n, k = link.v, link.column
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            rate = z[k] - here.D * (dot(get3(here.U_moment), alpha) + dot(get3(here.U_force), acceleration))
            vdot[n] = rate
            if link.kind == REVOLUTE:
                alpha = plus(alpha, scale(rate, get3(here.axis)))
            else:
                acceleration = plus(acceleration, scale(rate, get3(here.axis)))
        else:
            if link.kind == FREE:
                acceleration = (z[k], z[k + 1], z[k + 2])
                vdot[n], vdot[n + 1], vdot[n + 2] = acceleration
                n, k = n + 3, k + 3
            total = minus((z[k], z[k + 1], z[k + 2]), times(get9(here.K), acceleration))
            vdot[n], vdot[n + 1], vdot[n + 2] = transposed_times(get9(here.rotation), minus(total, alpha))
            alpha = total
        put3(here.delta_alpha, alpha)
        put3(here.delta_acceleration, acceleration)
