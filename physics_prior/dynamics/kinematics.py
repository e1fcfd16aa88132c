"""Kinematics: where every link is, how it moves and what its velocity alone adds to its acceleration."""

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
    put6,
    put9,
    rotated_diagonal,
    rotated_inertia,
    rotation_of,
    scale,
    symmetric_times,
    times,
)
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.kernel import inline_kernel, kernel
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


@inline_kernel
def pose(links: Records, work: Records, q: Array) -> None:
    """Fill where the links are."""
    pose_part(links, work, q, 0, ALL)


@kernel
def pose_part(links: Records, work: Records, q: Array, begin: int, end: int) -> None:
    """Fill where the links are whose column is in [begin, end): those that constraints move come first, then the others."""
    work[0].factored = 0
    for step in range(links.shape[0]):
        i = links[step].visit
        link, here = links[i], work[i]
        if link.column < begin or link.column >= end:
            continue
        kind, k = link.kind, link.q
        if kind == FREE:
            arm = (q[k], q[k + 1], q[k + 2])
            origin = arm
            R = rotation_of(q[k + 3], q[k + 4], q[k + 5], q[k + 6])
        else:
            R, origin = IDENTITY, ZERO
            if link.parent >= 0:
                up = work[link.parent]
                R, origin = get9(up.rotation), get3(up.origin)
            arm = times(R, get3(link.position))
            if link.turned:
                R = product(R, get9(link.placement))
            if kind == SPHERICAL:
                R = product(R, rotation_of(q[k], q[k + 1], q[k + 2], q[k + 3]))
            else:
                axis = times(R, get3(link.axis))
                put3(here.axis, axis)
                if kind == REVOLUTE:
                    R = turned_about(R, get3(link.axis), axis, q[k])
                elif kind == PRISMATIC:
                    arm = plus(arm, scale(q[k], axis))
            origin = plus(origin, arm)
        put9(here.rotation, R)
        put3(here.arm, arm)
        put3(here.origin, origin)


@kernel
def weigh(links: Records, work: Records) -> None:
    """Fill centres of mass and inertias of the links in world axes, those about their joints too; needs ``pose``."""
    work[0].factored = 0
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        R = get9(here.rotation)
        mass, center, inertia = link.mass, times(R, get3(link.center)), get6(link.inertia)
        inertia = rotated_diagonal(R, inertia) if link.principal else rotated_inertia(R, inertia)
        put3(here.center, center)
        put6(here.inertia, inertia)
        x, y, z = scale(mass, center)
        put6(here.J, inertia_about(inertia, mass, center))
        put9(here.H, (0.0, -z, y, z, 0.0, -x, -y, x, 0.0))
        put6(here.M, (mass, 0.0, 0.0, mass, 0.0, mass))


@inline_kernel
def flow(links: Records, work: Records, v: Array) -> None:
    """Fill velocities, what they add to accelerations, and gyroscopic torques; needs ``pose`` and ``weigh``."""
    flow_part(links, work, v, ALL)


@kernel
def flow_part(links: Records, work: Records, v: Array, end: int) -> None:
    """Do so for the links whose column is before end."""
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        if link.column >= end:
            continue
        kind, n = link.kind, link.v
        omega, velocity = ZERO, ZERO
        arm = get3(here.arm)
        angular, linear = ZERO, ZERO
        if link.parent >= 0:
            up = work[link.parent]
            omega, velocity = get3(up.omega), get3(up.velocity)
            carried = cross(omega, arm)
            velocity = plus(velocity, carried)
            linear = cross(omega, carried)
        if kind == REVOLUTE:
            spin = scale(v[n], get3(here.axis))
            angular = cross(omega, spin)
            omega = plus(omega, spin)
        elif kind == PRISMATIC:
            slide = scale(v[n], get3(here.axis))
            linear = plus(linear, scale(2.0, cross(omega, slide)))
            velocity = plus(velocity, slide)
        elif kind == SPHERICAL:
            spin = times(get9(here.rotation), (v[n], v[n + 1], v[n + 2]))
            angular = cross(omega, spin)
            omega = plus(omega, spin)
        elif kind == FREE:
            velocity = (v[n], v[n + 1], v[n + 2])
            omega = times(get9(here.rotation), (v[n + 3], v[n + 4], v[n + 5]))
        put3(here.omega, omega)
        put3(here.velocity, velocity)
        put3(here.coriolis_angular, angular)
        put3(here.coriolis_linear, linear)
        put3(here.gyroscopic, cross(omega, symmetric_times(get6(here.inertia), omega)))
        put3(here.moment, ZERO)
        put3(here.force, ZERO)
        put3(here.bias_moment, ZERO)
        put3(here.bias_force, ZERO)


@kernel
def take_increments(links: Records, work: Records, end: int) -> None:
    """Fill velocities of the links whose column is before end with their increments, and accelerations at that constant rate."""
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        if link.column >= end:
            continue
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
