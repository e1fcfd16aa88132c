"""The mass matrix factored along the branches of the tree, for many right sides at once: M = L^T D L.

Source: Featherstone 2008, ch. 6.5: L has entries only where one degree of freedom carries another, so that no branch meets
another. The articulated bodies have them already (Jain 2011, ch. 7.2, the innovations factor of M): the entry of a freedom k
and one that carries it is gain_k . S, with the wrench gain_k that k passes on per unit of its own force, turned around.
"""

from physics_prior.dynamics.algebra import (
    IDENTITY,
    cross,
    fma,
    get3,
    get6,
    get9,
    minus,
    plus,
    product,
    rotated_inertia,
    scale,
    transposed,
)
from physics_prior.dynamics.blocks import NARROW, WIDE, get_block, put_block
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import FREE, PRISMATIC, REVOLUTE
from physics_prior.dynamics.spatial import add, put_spatial
from physics_prior.dynamics.types import Array, Matrix, Records, Spatial, Symmetric, Vector


@kernel
def factorize_mass(links: Records, work: Records, freedom_records: Records) -> None:
    """Fill the freedoms' gains, about the first link's origin, and inverses of D; needs ``factorize``."""
    base = get3(work[0].origin)
    for i in range(links.shape[0]):
        link, here = links[i], work[i]
        n, d = link.v, minus(get3(here.origin), base)
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            own, force = freedom_records[n], get3(here.U_force)
            moment = plus(get3(here.U_moment), cross(d, force))
            put_spatial(own.gain[0:6], (scale(here.D, moment), scale(here.D, force)))
            own.inverse = here.D
        else:
            if link.kind == FREE:
                nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                _factorize_three(freedom_records, n, nothing, IDENTITY, d, get6(here.M_inverse))
                n += 3
            axes = transposed(get9(here.rotation))
            forces = product(axes, get9(here.K))
            _factorize_three(freedom_records, n, axes, forces, d, rotated_inertia(axes, get6(here.J_inverse)))


@inline_kernel
def _factorize_three(
    freedom_records: Records, first: int, moments: Matrix, forces: Matrix, d: Vector, inverse: Symmetric
) -> None:
    """Fill three freedoms at d from the rows of gains and the inverse of D that they have together: D becomes diagonal."""
    x, y, z = freedom_records[first], freedom_records[first + 1], freedom_records[first + 2]
    a, b, c = _wrench(moments, forces, 0, d), _wrench(moments, forces, 1, d), _wrench(moments, forces, 2, d)
    x.inverse = inverse[0]
    s, t = inverse[1] / inverse[0], inverse[2] / inverse[0]
    y.inverse = fma(-s, inverse[1], inverse[3])
    left = fma(-s, inverse[2], inverse[4])
    u = left / y.inverse
    z.inverse = fma(-u, left, fma(-t, inverse[2], inverse[5]))
    b = _minus_times(b, s, a)
    put_spatial(x.gain[0:6], a)
    put_spatial(y.gain[0:6], b)
    put_spatial(z.gain[0:6], _minus_times(_minus_times(c, t, a), u, b))


@inline_kernel
def _wrench(moments: Matrix, forces: Matrix, row: int, d: Vector) -> Spatial:
    """A row's moment and force at d, about the base."""
    k = 3 * row
    force = (forces[k], forces[k + 1], forces[k + 2])
    return plus((moments[k], moments[k + 1], moments[k + 2]), cross(d, force)), force


@inline_kernel
def _minus_times(f: Spatial, s: float, g: Spatial) -> Spatial:
    """The wrench f - s g."""
    return add(f, (scale(-s, g[0]), scale(-s, g[1])))


@kernel
def solve_mass(freedom_records: Records, L: Array, columns: Array) -> None:
    """Replace columns (nv, k), generalized forces, by the accelerations M^-1 of them.

    L (nv, nv), below its diagonal, from ``inverse_dynamics_derivatives``.
    """
    width = columns.shape[1]
    narrow = width - width % WIDE
    for begin in range(0, narrow, WIDE):
        _solve_block(freedom_records, L, columns, begin, WIDE, WIDE)
    for begin in range(narrow, width, NARROW):
        _solve_block(freedom_records, L, columns, begin, NARROW, min(width - begin, NARROW))


@inline_kernel
def _solve_block(freedom_records: Records, L: Array, columns: Array, begin: int, count: int, some: int) -> None:
    """Do so for some, at most count, columns, which stay in registers while others are taken from them."""
    nv, width = columns.shape
    for i in range(nv - 1, -1, -1):
        own = get_block(columns, i * width + begin, count, some)
        for k in range(i + 1, freedom_records[i].last):
            own = fma(-L[k, i], get_block(columns, k * width + begin, count, some), own)
        put_block(columns, i * width + begin, own, some)
    for k in range(nv):
        own = freedom_records[k].inverse * get_block(columns, k * width + begin, count, some)
        i = freedom_records[k].parent
        while i >= 0:
            own = fma(-L[k, i], get_block(columns, i * width + begin, count, some), own)
            i = freedom_records[i].parent
        put_block(columns, k * width + begin, own, some)
