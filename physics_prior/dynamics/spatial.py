"""Spatial vectors (Featherstone 2008, ch. 2) as pairs of 3-tuples, world axes, about one reference point.

A motion is (angular, linear), a force is (moment, force).
"""

from physics_prior.dynamics.algebra import cross, dot, fma, get3, plus, put3
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Array, Spatial, Symmetric, Vector


@inline_kernel
def get_spatial(a: Array) -> Spatial:
    """The spatial vector stored in array a (6,)."""
    return get3(a[0:3]), get3(a[3:6])


@inline_kernel
def put_spatial(a: Array, u: Spatial) -> None:
    """Store spatial vector u in array a (6,)."""
    put3(a[0:3], u[0])
    put3(a[3:6], u[1])


@inline_kernel
def add(u: Spatial, w: Spatial) -> Spatial:
    """The sum of two spatial vectors of a kind."""
    return plus(u[0], w[0]), plus(u[1], w[1])


@inline_kernel
def inertia_about(inertia: Symmetric, mass: float, center: Vector) -> Symmetric:
    """The inertia about a point from that about the centre of mass, which is at center from it (Steiner)."""
    x, y, z = center
    p, q, r = mass * x, mass * y, mass * z
    return (
        fma(q, y, fma(r, z, inertia[0])),
        fma(-p, y, inertia[1]),
        fma(-p, z, inertia[2]),
        fma(p, x, fma(r, z, inertia[3])),
        fma(-q, z, inertia[4]),
        fma(p, x, fma(q, y, inertia[5])),
    )


@inline_kernel
def cross_motion(u: Spatial, w: Spatial) -> Spatial:
    """The motion u x w."""
    return cross(u[0], w[0]), plus(cross(u[0], w[1]), cross(u[1], w[0]))


@inline_kernel
def cross_force(u: Spatial, f: Spatial) -> Spatial:
    """The force u x* f."""
    return plus(cross(u[0], f[0]), cross(u[1], f[1])), cross(u[0], f[1])


@inline_kernel
def power(u: Spatial, f: Spatial) -> float:
    """The scalar u . f of a motion and a force."""
    return dot(u[0], f[0]) + dot(u[1], f[1])


@inline_kernel
def at_point(u: Spatial, point: Vector) -> Vector:
    """The linear part of motion u at a point: u_linear + u_angular x point."""
    return plus(u[1], cross(u[0], point))
