"""Forward dynamics by articulated bodies: what a force does to the whole tree, in time linear in its links.

Source: Featherstone 2008, ch. 7. World axes, each link about its own joint: articulated inertias shift but never
rotate. A ball joint passes only a force and a 3x3 articulated mass to its parent; a free root is solved as a block.
The inertias (``factorize``) and what runs through them (``accelerate``) are separate, because unit forces of
constraints, projections and derivatives run through the same factors.
"""

from typing import Any

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
    scale,
    scale6,
    scale9,
    sum9,
    symmetric_adjugate,
    symmetric_inverse,
    symmetric_product,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.lanes import (
    add_numbers,
    elements,
    integers,
    numbers,
    put_elements,
    put_numbers,
    those,
    visited,
)
from physics_prior.dynamics.records import ALL, FREE, PRISMATIC, REVOLUTE, SPHERICAL
from physics_prior.dynamics.types import Array, Matrix, Records, Symmetric, Vector


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
    step = links.shape[0]
    while step > 0:
        some = links[step - 1].together
        step -= some
        i = links[step].visit
        link = links[i]
        if link.kind == FREE:
            put6(work[i].M_inverse, symmetric_inverse(_factorize_ball(work, i)))
        elif some > 1:
            where, up = those(links, step, some)
            if link.kind == SPHERICAL:
                _pass_mass_on(work, where, up, some, _factorize_ball(work, where))
            else:
                J, H, M = _factorize_axis(work, where, link.kind)
                pass_inertia_on(work, where, up, some, J, H, M)
        elif link.kind == SPHERICAL:
            mass = _factorize_ball(work, i)
            if link.parent >= 0:
                _pass_mass_on(work, i, link.parent, 1, mass)
        else:
            moment, mixed, mass = _factorize_axis(work, i, link.kind)
            if link.parent >= 0:
                pass_inertia_on(work, i, link.parent, 1, moment, mixed, mass)


@inline_kernel
def _factorize_ball(work: Records, where: Any) -> Any:
    """Factorize links on ball joints; return the masses that these pass on."""
    inertia = numbers(work, "J", 21, where)
    J, H, M = inertia[0:6], inertia[6:15], inertia[15:21]
    adjugate, inverse = symmetric_adjugate(J)
    C = symmetric_product(adjugate, H)
    put_numbers(work, "J_inverse", where, scale6(inverse, adjugate) + scale9(inverse, C))
    M = _schur(M, H, C, inverse)
    put_numbers(work, "M", where, M)
    return M


@inline_kernel
def _factorize_axis(work: Records, where: Any, kind: int) -> Any:
    """Factorize links on joints with an axis; return the inertias J, H, M that these pass on."""
    inertia = numbers(work, "J", 21, where)
    J, H, M = inertia[0:6], inertia[6:15], inertia[15:21]
    s = numbers(work, "axis", 3, where)
    if kind == REVOLUTE:
        n, f = symmetric_times(J, s), transposed_times(H, s)
        D = 1.0 / dot(s, n)
    else:
        n, f = times(H, s), symmetric_times(M, s)
        D = 1.0 / dot(s, f)
    put_numbers(work, "U_moment", where, (n[0], n[1], n[2], f[0], f[1], f[2], D))
    a, b = scale(D, n), scale(D, f)
    return _minus_symmetric(J, a, n), minus_outer(H, a, f), _minus_symmetric(M, b, f)


@inline_kernel
def pass_inertia_on(work: Records, where: Any, up: Any, some: int, J: Any, H: Any, M: Any) -> None:
    """Add articulated inertias about joints to those of the links that they hang on."""
    arm = numbers(work, "arm", 3, where)
    x, y, z = arm
    s, (a, b, c, d, e, f) = crossed_mass(arm, M), _mass_about(arm, M)
    # B = [arm]x H^T, so that the shifted J is J + B + B^T - [arm]x M [arm]x; the last is the mass's
    moment = (
        a + fma(2.0, determinant(y, H[2], z, H[1]), J[0]),
        b + (J[1] + fma(y, H[5], fma(-z, H[4], determinant(z, H[0], x, H[2])))),
        c + (J[2] + fma(y, H[8], fma(-z, H[7], determinant(x, H[1], y, H[0])))),
        d + fma(2.0, determinant(z, H[3], x, H[5]), J[3]),
        e + (J[4] + fma(z, H[6], fma(-x, H[8], determinant(x, H[4], y, H[3])))),
        f + fma(2.0, determinant(x, H[7], y, H[6]), J[5]),
    )
    add_numbers(work, "J", up, some, moment + sum9(H, s) + M)


@inline_kernel
def _pass_mass_on(work: Records, where: Any, up: Any, some: int, M: Any) -> None:
    """Add articulated masses at joints, all that ball joints pass on, to the inertias of the links that they hang on."""
    arm = numbers(work, "arm", 3, where)
    add_numbers(work, "J", up, some, _mass_about(arm, M) + crossed_mass(arm, M) + M)


@inline_kernel
def _mass_about(arm: Any, M: Any) -> Any:
    """The matrix -[arm]x M [arm]x, symmetric."""
    x, y, z = arm
    s = crossed_mass(arm, M)
    return (
        fma(s[2], y, -(s[1] * z)),
        fma(s[0], z, -(s[2] * x)),
        fma(s[1], x, -(s[0] * y)),
        fma(s[3], z, -(s[5] * x)),
        fma(s[4], x, -(s[3] * y)),
        fma(s[7], x, -(s[6] * y)),
    )


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
    step = links.shape[0]
    while step > 0:
        some = links[step - 1].together
        step -= some
        i = links[step].visit
        link = links[i]
        if link.kind == FREE:
            n, here = link.v, work[i]
            moment, force = _bias(links, work, i)
            u = minus(times(get9(here.rotation), elements(tau, 3, n + 3)), moment)
            put3(here.u, u)
            force = plus(force, transposed_times(get9(here.K), u))
            put3(here.bias_force, minus(elements(tau, 3, n), force))
        elif some > 1:
            where, up = those(links, step, some)
            add_numbers(work, "bias_moment", up, some, _gather(links, work, tau, where, link.kind))
        else:
            wrench = _gather(links, work, tau, i, link.kind)
            if link.parent >= 0:
                add_numbers(work, "bias_moment", link.parent, 1, wrench)


@inline_kernel
def _bias(links: Records, work: Records, where: Any) -> tuple[Any, Any]:
    """The wrenches against links' motion, about their joints: what hangs on them passed on, and their own."""
    omega, center = numbers(work, "omega", 3, where), numbers(work, "center", 3, where)
    own = scale(numbers(links, "mass", 1, where), cross(omega, cross(omega, center)))
    wrenches = numbers(work, "bias_moment", 15, where)
    moment = minus(plus(wrenches[0:3], plus(wrenches[6:9], cross(center, own))), wrenches[9:12])
    return moment, plus(wrenches[3:6], minus(own, wrenches[12:15]))


@inline_kernel
def _gather(links: Records, work: Records, tau: Array, where: Any, kind: int) -> Any:
    """Do so at joints of one kind; return the wrenches that they pass on: moments about what they hang on, and forces."""
    moment, force = _bias(links, work, where)
    n, linear = integers(links, "v", where), numbers(work, "coriolis_linear", 3, where)
    if kind == SPHERICAL:
        torque = times(numbers(work, "rotation", 9, where), elements(tau, 3, n))
        u = minus(torque, moment)
        put_numbers(work, "u", where, u)
        moment = torque
        force = plus(force, transposed_times(numbers(work, "K", 9, where), u))
        force = plus(force, symmetric_times(numbers(work, "M", 6, where), linear))
    else:
        axis, angular = numbers(work, "axis", 3, where), numbers(work, "coriolis_angular", 3, where)
        u = elements(tau, 1, n) - dot(axis, moment if kind == REVOLUTE else force)
        put_numbers(work, "u", where, u)
        inertia, column = numbers(work, "J", 21, where), numbers(work, "U_moment", 7, where)
        J, H, M = inertia[0:6], inertia[6:15], inertia[15:21]
        across, along, D = column[0:3], column[3:6], column[6]
        # what the joint gives way by its own force and to what is carried
        share = D * (u - dot(across, angular) - dot(along, linear))
        moment = plus(moment, plus(plus(symmetric_times(J, angular), times(H, linear)), scale(share, across)))
        carried = plus(transposed_times(H, angular), symmetric_times(M, linear))
        force = plus(force, plus(carried, scale(share, along)))
    return plus(moment, cross(numbers(work, "arm", 3, where), force)) + force


@kernel
def release(links: Records, work: Records, gravity: Array, which: int, vdot: Array) -> None:
    """Run what ``gather`` left at the joints outward: accelerations of the links, ALL or MOVED."""
    step, still = 0, scale(-1.0, get3(gravity))
    while step < links.shape[0]:
        i, some = visited(links, step, which)
        if i < 0:
            break
        link, step = links[i], step + some
        if link.kind == FREE:
            n, here = link.v, work[i]
            acceleration = symmetric_times(get6(here.M_inverse), get3(here.bias_force))
            put_elements(vdot, n, minus(acceleration, still))
            alpha = minus(symmetric_times(get6(here.J_inverse), get3(here.u)), times(get9(here.K), acceleration))
            put_elements(vdot, n + 3, transposed_times(get9(here.rotation), alpha))
            put_numbers(work, "alpha", i, alpha + acceleration)
        elif some > 1:
            where, up = those(links, step - some, some)
            base = numbers(work, "alpha", 6, up)
            _release(links, work, where, link.kind, base[0:3], base[3:6], vdot)
        elif link.parent >= 0:
            over = numbers(work, "alpha", 6, link.parent)
            _release(links, work, i, link.kind, over[0:3], over[3:6], vdot)
        else:
            _release(links, work, i, link.kind, ZERO, still, vdot)


@inline_kernel
def _release(links: Records, work: Records, where: Any, kind: int, alpha: Any, acceleration: Any, vdot: Array) -> None:
    """Do so at joints of one kind, the accelerations being those of what they hang on."""
    n, coriolis = integers(links, "v", where), numbers(work, "coriolis_angular", 6, where)
    acceleration = plus(acceleration, cross(alpha, numbers(work, "arm", 3, where)))
    acceleration, alpha = plus(acceleration, coriolis[3:6]), plus(alpha, coriolis[0:3])
    if kind == SPHERICAL:
        turned = symmetric_times(numbers(work, "J_inverse", 6, where), numbers(work, "u", 3, where))
        total = minus(turned, times(numbers(work, "K", 9, where), acceleration))
        put_elements(vdot, n, transposed_times(numbers(work, "rotation", 9, where), minus(total, alpha)))
        put_numbers(work, "alpha", where, total + acceleration)
    else:
        column, axis = numbers(work, "U_moment", 7, where), numbers(work, "axis", 3, where)
        u = numbers(work, "u", 1, where)
        rate = column[6] * (u - dot(column[0:3], alpha) - dot(column[3:6], acceleration))
        put_elements(vdot, n, rate)
        put_numbers(work, "alpha", where, _moved_along(kind, axis, rate, alpha, acceleration))


@inline_kernel
def _moved_along(kind: int, axis: Any, rate: Any, alpha: Any, acceleration: Any) -> Any:
    """Accelerations, the angular and that of the origin, with that of a joint along or about its axis."""
    own = scale(rate, axis)
    if kind == REVOLUTE:
        return plus(alpha, own) + acceleration
    return alpha + plus(acceleration, own)


@kernel
def load_joints(links: Records, work: Records, forces: Array) -> None:
    """Add generalized forces (w,), run through the factors as ``push`` does, to what ``gather`` left at the joints."""
    for step in range(links.shape[0]):
        i = links[step].moved
        if i < 0:
            break
        link, here = links[i], work[i]
        k = link.column
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            here.u[0] += forces[k]
        else:
            if link.kind == FREE:
                add3(here.bias_force, elements(forces, 3, k))
                k += 3
            add3(here.u, elements(forces, 3, k))


@kernel
def pull(links: Records, work: Records, z: Array, which: int, vdot: Array) -> None:
    """Run z (nv,) outward through the factors: fill vdot (nv,) = M^-1 tau, and the links' increments of acceleration.

    Those of the links that are asked for, ALL or MOVED.
    """
    step = 0
    while step < links.shape[0]:
        i, some = visited(links, step, which)
        if i < 0:
            break
        link, step = links[i], step + some
        if link.kind == FREE:
            n, k, here = link.v, link.column, work[i]
            acceleration = elements(z, 3, k)
            alpha = minus(elements(z, 3, k + 3), times(get9(here.K), acceleration))
            put_elements(vdot, n, acceleration)
            put_elements(vdot, n + 3, transposed_times(get9(here.rotation), alpha))
            put_numbers(work, "delta_alpha", i, alpha + acceleration)
        elif some > 1:
            where, up = those(links, step - some, some)
            base = numbers(work, "delta_alpha", 6, up)
            _pull(links, work, z, where, link.kind, base[0:3], base[3:6], vdot)
        elif link.parent >= 0:
            over = numbers(work, "delta_alpha", 6, link.parent)
            _pull(links, work, z, i, link.kind, over[0:3], over[3:6], vdot)
        else:
            _pull(links, work, z, i, link.kind, ZERO, ZERO, vdot)


@inline_kernel
def _pull(
    links: Records, work: Records, z: Array, where: Any, kind: int, alpha: Any, acceleration: Any, vdot: Array
) -> None:
    """Do so at joints of one kind, the increments being those of what they hang on."""
    n, k = integers(links, "v", where), integers(links, "column", where)
    acceleration = plus(acceleration, cross(alpha, numbers(work, "arm", 3, where)))
    if kind == SPHERICAL:
        total = minus(elements(z, 3, k), times(numbers(work, "K", 9, where), acceleration))
        put_elements(vdot, n, transposed_times(numbers(work, "rotation", 9, where), minus(total, alpha)))
        put_numbers(work, "delta_alpha", where, total + acceleration)
    else:
        column, axis = numbers(work, "U_moment", 7, where), numbers(work, "axis", 3, where)
        rate = elements(z, 1, k) - column[6] * (dot(column[0:3], alpha) + dot(column[3:6], acceleration))
        put_elements(vdot, n, rate)
        put_numbers(work, "delta_alpha", where, _moved_along(kind, axis, rate, alpha, acceleration))
