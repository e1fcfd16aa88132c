"""Kinematics: where every link is, how it moves and what its velocity alone adds to its acceleration."""

from typing import Any

from physics_prior.dynamics.algebra import (
    IDENTITY,
    ZERO,
    cross,
    dot,
    dots,
    get3,
    get6,
    get9,
    minus,
    plus,
    product,
    put3,
    rotated_diagonal,
    rotated_inertia,
    rotation_of,
    scale,
    symmetric_times,
    times,
)
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.blocks import nothing
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.lanes import elements, integers, numbers, put_numbers, those, visited
from physics_prior.dynamics.records import ALL, FREE, PRISMATIC, REVOLUTE, SPHERICAL
from physics_prior.dynamics.spatial import inertia_about
from physics_prior.dynamics.trigonometry import sine_and_cosine
from physics_prior.dynamics.types import Array, Matrix, Record, Records, Spatial, Vector


@kernel
def move(links: Records, work: Records, q: Array, v: Array) -> None:
    """Fill poses, velocities and velocity-product accelerations of all links from q (nq,) and v (nv,), outward.

    World axes throughout, each link about its own joint, so that inertias shift but never rotate. External forces are
    set to zero. Source: Featherstone 2008, ch. 4, with accelerations of points instead of spatial ones.
    """
    pose(links, work, q)
    weigh(links, work)
    flow(links, work, v)


@kernel
def pose(links: Records, work: Records, q: Array) -> None:
    """Fill where the links are."""
    work[0].factored = 0
    step = 0
    while step < links.shape[0]:
        i, some = links[step].visit, links[step].together
        link = links[i]
        if link.kind == FREE:
            k, origin = link.q, elements(q, 3, link.q)
            R = rotation_of(q[k + 3], q[k + 4], q[k + 5], q[k + 6])
            put_numbers(work, "rotation", i, R + origin + origin)
        elif some > 1:
            where, up = those(links, step, some)
            over = numbers(work, "rotation", 12, up)
            _pose(links, work, q, where, link.kind, link.turned, over[0:9], over[9:12])
        elif link.parent >= 0:
            base = numbers(work, "rotation", 12, link.parent)
            _pose(links, work, q, i, link.kind, link.turned, base[0:9], base[9:12])
        else:
            _pose(links, work, q, i, link.kind, link.turned, IDENTITY, ZERO)
        step += some


@inline_kernel
def _pose(links: Records, work: Records, q: Array, where: Any, kind: int, turned: int, R: Any, origin: Any) -> None:
    """Pose links on joints of one kind, R and the origin those of what they hang on."""
    arm, k = times(R, numbers(links, "position", 3, where)), integers(links, "q", where)
    if turned:
        R = product(R, numbers(links, "placement", 9, where))
    if kind == SPHERICAL:
        w, x, y, z = elements(q, 4, k)
        R = product(R, rotation_of(w, x, y, z))
    else:
        local, along = numbers(links, "axis", 3, where), elements(q, 1, k)
        axis = times(R, local)
        put_numbers(work, "axis", where, axis)
        if kind == REVOLUTE:
            R = turned_about(R, local, axis, along)
        else:
            arm = plus(arm, scale(along, axis))
    put_numbers(work, "rotation", where, R + plus(origin, arm) + arm)


@kernel
def weigh(links: Records, work: Records) -> None:
    """Fill centres of mass and inertias of the links in world axes, those about their joints too; needs ``pose``."""
    work[0].factored = 0
    step = 0
    while step < links.shape[0]:
        i, some = links[step].visit, links[step].together
        if some > 1:
            _weigh(links, work, those(links, step, some)[0], links[i].principal)
        else:
            _weigh(links, work, i, links[i].principal)
        step += some


@inline_kernel
def _weigh(links: Records, work: Records, where: Any, principal: int) -> None:
    """Weigh links that have their inertias in principal axes, or do not."""
    R, inertia = numbers(work, "rotation", 9, where), numbers(links, "inertia", 6, where)
    mass, center = numbers(links, "mass", 1, where), times(R, numbers(links, "center", 3, where))
    inertia = rotated_diagonal(R, inertia) if principal else rotated_inertia(R, inertia)
    x, y, z = scale(mass, center)
    none = nothing(mass)
    H = (none, -z, y, z, none, -x, -y, x, none)
    M = (mass, none, none, mass, none, mass)
    put_numbers(work, "inertia", where, inertia + inertia_about(inertia, mass, center) + H + M + center)


@inline_kernel
def flow(links: Records, work: Records, v: Array) -> None:
    """Fill velocities, what they add to accelerations, and gyroscopic torques; needs ``pose`` and ``weigh``."""
    flow_part(links, work, v, ALL)


@kernel
def flow_part(links: Records, work: Records, v: Array, which: int) -> None:
    """Do so for the links that are asked for, ALL or MOVED."""
    step = 0
    while step < links.shape[0]:
        i, some = visited(links, step, which)
        if i < 0:
            break
        link, step = links[i], step + some
        if link.kind == FREE:
            n, here = link.v, work[i]
            omega = times(get9(here.rotation), elements(v, 3, n + 3))
            _put_flow(work, i, omega, elements(v, 3, n), ZERO, ZERO)
        elif some > 1:
            where, up = those(links, step - some, some)
            over = numbers(work, "omega", 6, up)
            _flow(links, work, v, where, link.kind, over[0:3], over[3:6])
        elif link.parent >= 0:
            base = numbers(work, "omega", 6, link.parent)
            _flow(links, work, v, i, link.kind, base[0:3], base[3:6])
        else:
            _flow(links, work, v, i, link.kind, ZERO, ZERO)


@inline_kernel
def _flow(links: Records, work: Records, v: Array, where: Any, kind: int, omega: Any, velocity: Any) -> None:
    """Move links on joints of one kind, omega and velocity those of what they hang on."""
    n = integers(links, "v", where)
    carried = cross(omega, numbers(work, "arm", 3, where))
    velocity = plus(velocity, carried)
    linear = cross(omega, carried)
    if kind == PRISMATIC:
        slide = scale(elements(v, 1, n), numbers(work, "axis", 3, where))
        linear = plus(linear, scale(2.0, cross(omega, slide)))
        _put_flow(work, where, omega, plus(velocity, slide), _nothing3(slide), linear)
    else:
        if kind == REVOLUTE:
            spin = scale(elements(v, 1, n), numbers(work, "axis", 3, where))
        else:
            spin = times(numbers(work, "rotation", 9, where), elements(v, 3, n))
        _put_flow(work, where, plus(omega, spin), velocity, cross(omega, spin), linear)


@inline_kernel
def _put_flow(work: Records, where: Any, omega: Any, velocity: Any, angular: Any, linear: Any) -> None:
    """Store velocities and what they add to accelerations, and begin the wrenches: gyroscopic torques, and nothing else."""
    torque = cross(omega, symmetric_times(numbers(work, "inertia", 6, where), omega))
    none = _nothing3(torque)
    put_numbers(work, "omega", where, omega + velocity + angular + linear + none + none + torque + none + none)


@inline_kernel
def _nothing3(like: Any) -> Any:
    """The vector of nothing, of numbers or of blocks."""
    return nothing(like[0]), nothing(like[0]), nothing(like[0])


@kernel
def take_increments(links: Records, work: Records) -> None:
    """Fill velocities of the links that constraint rows move with their increments, and accelerations at that constant rate."""
    for step in range(links.shape[0]):
        i = links[step].moved
        if i < 0:
            break
        link, here = links[i], work[i]
        omega, velocity = get3(here.delta_alpha), get3(here.delta_acceleration)
        alpha, acceleration = ZERO, ZERO
        if link.parent >= 0:
            up, arm = work[link.parent], get3(here.arm)
            around, alpha = get3(up.omega), get3(up.alpha)
            carried = cross(around, arm)
            acceleration = plus(get3(up.acceleration), plus(cross(alpha, arm), cross(around, carried)))
            if link.kind == PRISMATIC:
                slide = minus(minus(velocity, get3(up.velocity)), carried)
                acceleration = plus(acceleration, scale(2.0, cross(around, slide)))
            alpha = plus(alpha, cross(around, omega))
        put3(here.omega, omega)
        put3(here.velocity, velocity)
        put3(here.alpha, alpha)
        put3(here.acceleration, acceleration)


@inline_kernel
def turned_about(R: Matrix, local: Vector, axis: Vector, angle: float) -> Matrix:
    """The rotation matrix R turned by an angle about a unit axis, ``local`` in R's axes and ``axis`` = R local (Rodrigues)."""
    s, c = sine_and_cosine(angle)
    k = scale(1.0 - c, axis)
    x, y, z = local
    a = cross((R[0], R[1], R[2]), local)
    b = cross((R[3], R[4], R[5]), local)
    d = cross((R[6], R[7], R[8]), local)
    return (
        dots(c, k[0], s, R[0], x, a[0]),
        dots(c, k[0], s, R[1], y, a[1]),
        dots(c, k[0], s, R[2], z, a[2]),
        dots(c, k[1], s, R[3], x, b[0]),
        dots(c, k[1], s, R[4], y, b[1]),
        dots(c, k[1], s, R[5], z, b[2]),
        dots(c, k[2], s, R[6], x, d[0]),
        dots(c, k[2], s, R[7], y, d[1]),
        dots(c, k[2], s, R[8], z, d[2]),
    )


@inline_kernel
def freedoms(kind: int) -> int:
    """Number of degrees of freedom of a joint."""
    return 1 if kind in (REVOLUTE, PRISMATIC) else (6 if kind == FREE else 3)


@inline_kernel
def freedom(kind: int, here: Record, c: int) -> Spatial:
    """The c-th direction of motion of a joint: angular velocity and velocity of its origin, world axes, per unit of v."""
    turn, shift = ZERO, ZERO
    if kind == REVOLUTE:
        turn = get3(here.axis)
    elif kind == PRISMATIC:
        shift = get3(here.axis)
    elif kind == FREE and c < 3:
        shift = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)
    else:
        k = c - 3 if kind == FREE else c
        turn = (here.rotation[k], here.rotation[3 + k], here.rotation[6 + k])
    return turn, shift


@kernel
def point_jacobian(links: Records, work: Records, link_index: int, point: Array, jacobian: Array) -> None:
    """Fill jacobian (6, nv): angular velocity (rows 0-2) and velocity of a point (rows 3-5), world axes, per v.

    point (3,) stands in the link's frame, m. Columns of joints that do not carry the link are zero.
    """
    clear(jacobian)
    i = link_index
    if i < 0:
        return
    target = plus(get3(work[i].origin), times(get9(work[i].rotation), get3(point)))
    while i >= 0:
        link, here = links[i], work[i]
        lever = minus(target, get3(here.origin))
        for c in range(freedoms(link.kind)):
            turn, shift = freedom(link.kind, here, c)
            put3(jacobian[0:3, link.v + c], turn)
            put3(jacobian[3:6, link.v + c], plus(shift, cross(turn, lever)))
        i = link.parent


@kernel
def energy(links: Records, work: Records, gravity: Array) -> float:
    """Kinetic energy plus potential energy in the uniform field gravity (3,), J, zero at the world's origin."""
    total = 0.0
    for i in range(links.shape[0]):
        here, mass = work[i], links[i].mass
        omega, center = get3(here.omega), get3(here.center)
        velocity = plus(get3(here.velocity), cross(omega, center))
        total += 0.5 * mass * dot(velocity, velocity)
        total += 0.5 * dot(omega, symmetric_times(get6(here.inertia), omega))
        total -= mass * dot((gravity[0], gravity[1], gravity[2]), plus(get3(here.origin), center))
    return total
