"""Wrenches at points of links, and their derivatives: what springs, drag and a user's own effects push with.

Points are in the world, link -1 is the world itself. A wrench (moment M; force F) on a link at p has the generalized forces
tau_k = w_k . M + J_k . F, where freedom k turns the link by w_k and moves p by J_k = S_k at p. Along a freedom n by the
tangent of q they change as the wrench does, and because the freedoms that n carries are turned by it (docs/equations.md):
    dw_k = w_n x w_k,  dJ_k = w_n x J_k where n carries k, and dJ_k = w_k x J_n where k carries n.
"""

from physics_prior.dynamics.algebra import ZERO, add3, cross, dot, get3, get9, minus, plus, scale, times
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.spatial import add, at_point, cross_motion, get_spatial, power
from physics_prior.dynamics.types import Array, Matrix, Record, Records, Spatial, Vector


@inline_kernel
def world_point(work: Records, link: int, point: Vector) -> Vector:
    """Where a point that is fixed on a link, in the link's frame, is in the world, m."""
    if link < 0:
        return point
    return plus(get3(work[link].origin), times(get9(work[link].rotation), point))


@inline_kernel
def world_velocity(work: Records, link: int, p: Vector) -> Vector:
    """The velocity of the world point p as it moves with a link, m/s."""
    if link < 0:
        return ZERO
    return plus(get3(work[link].velocity), cross(get3(work[link].omega), minus(p, get3(work[link].origin))))


@inline_kernel
def push(work: Records, link: int, p: Vector, wrench: Spatial) -> None:
    """Put a wrench (moment, force), world axes, on a link at the world point p; the world takes any."""
    if link >= 0:
        add3(work[link].force, wrench[1])
        add3(work[link].moment, plus(wrench[0], cross(minus(p, get3(work[link].origin)), wrench[1])))


@inline_kernel
def end_of_freedoms(links: Records, link: int, nv: int) -> int:
    """One past the last degree of freedom of a link's joint; its first one is links[link].v."""
    return int(links[link + 1].v) if link + 1 < links.shape[0] else nv


@inline_kernel
def point_motion(work: Records, freedom: Record, composite: Record, p: Vector) -> tuple[Spatial, Spatial]:
    """What a freedom that carries a link does at its world point p: (turn, shift), and by q to (omega, velocity).

    The first holds by the tangent of q, and by v to (omega, velocity). ``composite`` is the link's own.
    """
    lever = minus(p, get3(work[0].origin))
    S, V = get_spatial(freedom.S), get_spatial(composite.V)
    moved, by_q = at_point(S, lever), add(cross_motion(S, V), get_spatial(freedom.psi_dot))
    return (S[0], moved), (by_q[0], plus(at_point(by_q, lever), cross(V[0], moved)))


@kernel
def add_wrench_column(
    links: Records, work: Records, freedoms: Records, link: int, p: Vector, change: Spatial, n: int, tau_x: Array
) -> None:
    """Add to column n of tau_x (nv, nv) what the change of a wrench on a link at p, by freedom n, does to tau."""
    lever = minus(p, get3(work[0].origin))
    i = link
    while i >= 0:
        for k in range(links[i].v, end_of_freedoms(links, i, freedoms.shape[0])):
            S = get_spatial(freedoms[k].S)
            tau_x[k, n] += power((S[0], at_point(S, lever)), change)
        i = links[i].parent


@kernel
def add_lever_change(
    links: Records, work: Records, freedoms: Records, link: int, p: Vector, wrench: Spatial, tau_q: Array
) -> None:
    """Add to tau_q (nv, nv) what moving does to the generalized forces of a wrench on a link at p that stays as it is."""
    lever, nv = minus(p, get3(work[0].origin)), freedoms.shape[0]
    i = link
    while i >= 0:
        for k in range(links[i].v, end_of_freedoms(links, i, nv)):
            S = get_spatial(freedoms[k].S)
            moved = at_point(S, lever)
            j = i
            while j >= 0:
                for n in range(links[j].v, end_of_freedoms(links, j, nv)):
                    turn = get3(freedoms[n].S)
                    by_force = dot(cross(turn, moved), wrench[1])
                    if j != i:
                        tau_q[n, k] += by_force
                    elif dot(S[0], S[0]) == 0.0:
                        continue  # the translation of a free joint is not turned by its own turn
                    tau_q[k, n] += by_force + dot(cross(turn, S[0]), wrench[0])
                j = links[j].parent
        i = links[i].parent


@kernel
def differentiate_point_force(
    links: Records,
    work: Records,
    freedoms: Records,
    composites: Records,
    link_a: int,
    a: Vector,
    link_b: int,
    b: Vector,
    force: Vector,
    by_gap: Matrix,
    by_rate: Matrix,
    tau_q: Array,
    tau_v: Array,
) -> None:
    """Add the derivatives (nv, nv) of a force ON link b at b, and its opposite ON link a at a.

    by_gap and by_rate are those of the force by b - a, N/m, and by the velocity of b less that of a, N s/m; world axes.
    """
    for side in range(2):
        link, p, sign = (link_b, b, 1.0) if side == 1 else (link_a, a, -1.0)
        add_lever_change(links, work, freedoms, link, p, (ZERO, scale(sign, force)), tau_q)
        i = link
        while i >= 0:
            for n in range(links[i].v, end_of_freedoms(links, i, freedoms.shape[0])):
                motion, by_q = point_motion(work, freedoms[n], composites[link], p)
                q = scale(sign, plus(times(by_gap, motion[1]), times(by_rate, by_q[1])))
                v = scale(sign, times(by_rate, motion[1]))
                add_wrench_column(links, work, freedoms, link_b, b, (ZERO, q), n, tau_q)
                add_wrench_column(links, work, freedoms, link_a, a, (ZERO, scale(-1.0, q)), n, tau_q)
                add_wrench_column(links, work, freedoms, link_b, b, (ZERO, v), n, tau_v)
                add_wrench_column(links, work, freedoms, link_a, a, (ZERO, scale(-1.0, v)), n, tau_v)
            i = links[i].parent
