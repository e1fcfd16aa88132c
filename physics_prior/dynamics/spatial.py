"""Spatial vectors (Featherstone 2008, ch. 2) as pairs of 3-tuples, world axes, about one reference point.

A motion is (angular, linear), a force is (moment, force).
"""

from physics_prior.dynamics.algebra import cross, dot, get3, plus, put3
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Array, Spatial, Vector


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


@inline_kernel
def columns_times(columns: Array, u: Spatial) -> Spatial:
    """The product of a 6x6 matrix, stored as its columns (36,), and spatial vector u."""
    a, b, c, d, e, f = u[0][0], u[0][1], u[0][2], u[1][0], u[1][1], u[1][2]
    return (
        (
            columns[0] * a + columns[6] * b + columns[12] * c + columns[18] * d + columns[24] * e + columns[30] * f,
            columns[1] * a + columns[7] * b + columns[13] * c + columns[19] * d + columns[25] * e + columns[31] * f,
            columns[2] * a + columns[8] * b + columns[14] * c + columns[20] * d + columns[26] * e + columns[32] * f,
        ),
        (
            columns[3] * a + columns[9] * b + columns[15] * c + columns[21] * d + columns[27] * e + columns[33] * f,
            columns[4] * a + columns[10] * b + columns[16] * c + columns[22] * d + columns[28] * e + columns[34] * f,
            columns[5] * a + columns[11] * b + columns[17] * c + columns[23] * d + columns[29] * e + columns[35] * f,
        ),
    )


@inline_kernel
def rows_times(columns: Array, u: Spatial) -> Spatial:
    """The product of the transpose of a 6x6 matrix, stored as its columns (36,), and spatial vector u."""
    return (
        (
            power(get_spatial(columns[0:6]), u),
            power(get_spatial(columns[6:12]), u),
            power(get_spatial(columns[12:18]), u),
        ),
        (
            power(get_spatial(columns[18:24]), u),
            power(get_spatial(columns[24:30]), u),
            power(get_spatial(columns[30:36]), u),
        ),
    )
