"""Inverse dynamics and mass matrix: the forces that a motion needs.

Sources: recursive Newton-Euler and composite rigid bodies, Featherstone 2008, ch. 5 and 6, in world axes.
"""

from physics_prior.dynamics.algebra import (
    ZERO,
    add3,
    cross,
    dot,
    get3,
    get6,
    get9,
    minus,
    plus,
    put3,
    scale,
    symmetric_times,
    times,
    transposed_times,
)
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.articulated_body import pass_inertia_on
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import freedom, freedoms, weigh
from physics_prior.dynamics.records import FREE, PRISMATIC, REVOLUTE
from physics_prior.dynamics.types import Array, Records


@kernel
def spread(links: Records, work: Records, vdot: Array, gravity: Array) -> None:
    """Fill alpha and acceleration (less gravity) of all links from vdot (nv,), outward; needs the kinematics."""
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        alpha, acceleration = ZERO, (-gravity[0], -gravity[1], -gravity[2])
        if link.parent >= 0:
            up = work[link.parent]
            alpha = get3(up.alpha)
            acceleration = plus(get3(up.acceleration), cross(alpha, get3(here.arm)))
        alpha = plus(alpha, get3(here.coriolis_angular))
        acceleration = plus(acceleration, get3(here.coriolis_linear))
        n = link.v
        if link.kind == REVOLUTE:
            alpha = plus(alpha, scale(vdot[n], get3(here.axis)))
        elif link.kind == PRISMATIC:
            acceleration = plus(acceleration, scale(vdot[n], get3(here.axis)))
        else:
            if link.kind == FREE:
                acceleration = plus(acceleration, (vdot[n], vdot[n + 1], vdot[n + 2]))
                n += 3
            alpha = plus(alpha, times(get9(here.rotation), (vdot[n], vdot[n + 1], vdot[n + 2])))
        put3(here.alpha, alpha)
        put3(here.acceleration, acceleration)


@kernel
def transmit(links: Records, work: Records) -> None:
    """Fill bias_moment and bias_force with the wrench ON each link BY its joint, at the joint, world axes; inward.

    Needs accelerations and external wrenches. It is what moves the link and all it carries, less what else pushes them.
    """
    for i in range(links.shape[0]):
        here = work[i]
        omega, center, alpha = get3(here.omega), get3(here.center), get3(here.alpha)
        acceleration = plus(plus(get3(here.acceleration), cross(alpha, center)), cross(omega, cross(omega, center)))
        force = scale(links[i].mass, acceleration)
        moment = plus(plus(symmetric_times(get6(here.inertia), alpha), get3(here.gyroscopic)), cross(center, force))
        put3(here.bias_moment, minus(moment, get3(here.moment)))
        put3(here.bias_force, minus(force, get3(here.force)))
    for i in range(links.shape[0] - 1, -1, -1):
        here = work[i]
        if links[i].parent >= 0:
            up = work[links[i].parent]
            force = get3(here.bias_force)
            add3(up.bias_moment, plus(get3(here.bias_moment), cross(get3(here.arm), force)))
            add3(up.bias_force, force)


@kernel
def inverse_dynamics(links: Records, work: Records, vdot: Array, gravity: Array, tau: Array) -> None:
    """Fill tau (nv,), the generalized forces that produce vdot (nv,) beside external wrenches and gravity (3,)."""
    spread(links, work, vdot, gravity)
    transmit(links, work)
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        n = link.v
        if link.kind == REVOLUTE:
            tau[n] = dot(get3(here.axis), get3(here.bias_moment))
        elif link.kind == PRISMATIC:
            tau[n] = dot(get3(here.axis), get3(here.bias_force))
        else:
            if link.kind == FREE:
                tau[n], tau[n + 1], tau[n + 2] = get3(here.bias_force)
                n += 3
            tau[n], tau[n + 1], tau[n + 2] = transposed_times(get9(here.rotation), get3(here.bias_moment))


@kernel
def mass_matrix(links: Records, work: Records, M: Array) -> None:
    """Fill M (nv, nv) from composite inertias; needs the poses and overwrites the factors."""
    clear(M)
    weigh(links, work)
    for i in range(links.shape[0] - 1, -1, -1):
        if links[i].parent >= 0:
            here = work[i]
            pass_inertia_on(work, i, links[i].parent, 1, get6(here.J), get9(here.H), get6(here.M))
    for i in range(links.shape[0]):
        link = links[i]
        for c in range(freedoms(link.kind)):
            here = work[i]
            turn, shift = freedom(link.kind, here, c)
            H = get9(here.H)
            moment = plus(symmetric_times(get6(here.J), turn), times(H, shift))
            force = plus(transposed_times(H, turn), symmetric_times(get6(here.M), shift))
            j = i
            while j >= 0:
                other = links[j]
                for k in range(freedoms(other.kind)):
                    turn, shift = freedom(other.kind, work[j], k)
                    entry = dot(turn, moment) + dot(shift, force)
                    M[link.v + c, other.v + k] = entry
                    M[other.v + k, link.v + c] = entry
                moment = plus(moment, cross(get3(work[j].arm), force))
                j = other.parent
