"""The manifold of configurations, compiled: the exponential map and the derivatives that a step needs.

Tangent vectors (nv,) stand to the right of q, as Tree.integrate does: q [+] delta. Within a step the motion is written in
the coordinates theta of q = q0 [+] theta (Munthe-Kaas 1999), a plain vector space in which RK4 keeps its order.
"""

import math
from typing import Any

from physics_prior.dynamics.algebra import cross, dot, dot_on, fma, plus, scale
from physics_prior.dynamics.blocks import at_most, either, root, size
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.lanes import elements, integers, put_elements, those
from physics_prior.dynamics.records import FREE, SPHERICAL
from physics_prior.dynamics.rotation_vector import exponential, right_jacobian, rotation_back, second_coefficient
from physics_prior.dynamics.types import Array, Records, Vector


@inline_kernel
def local_rate(theta: Vector, omega: Vector, exact: bool) -> Vector:
    """The rate of the rotation vector theta under body angular velocity omega: the inverse right Jacobian times omega.

    theta_dot = omega + 1/2 theta x omega + c theta x (theta x omega); c = 1/12, the next term being O(theta^4), is what methods
    of order four need.
    """
    c = second_coefficient(dot(theta, theta))[0] if exact else 1.0 / 12.0
    once = cross(theta, omega)
    return plus(omega, plus(scale(0.5, once), scale(c, cross(theta, once))))


@inline_kernel
def local_rate_by_theta(theta: Vector, omega: Vector, direction: Vector, exact: bool) -> Vector:
    """The derivative of local_rate by theta along a direction."""
    once = cross(theta, omega)
    turned = cross(direction, omega)
    twice = plus(cross(direction, once), cross(theta, turned))
    if not exact:
        return plus(scale(0.5, turned), scale(1.0 / 12.0, twice))
    c, slope = second_coefficient(dot(theta, theta))
    change = scale(2.0 * slope * dot(theta, direction), cross(theta, once))
    return plus(plus(scale(0.5, turned), scale(c, twice)), change)


@kernel
def displace(links: Records, q: Array, delta: Array, out: Array) -> None:
    """Fill out (nq,) = q [+] delta; q and out may be the same array. Quaternions leave with unit norm."""
    step = 0
    while step < links.shape[0]:
        i, some = links[step].visit, links[step].together
        link = links[i]
        k, n = link.q, link.v
        if link.kind == FREE:
            put_elements(out, k, plus(elements(q, 3, k), elements(delta, 3, n)))
            _displace(q, delta, out, k + 3, n + 3, SPHERICAL)
        elif some > 1:
            where = those(links, step, some)[0]
            _displace(q, delta, out, integers(links, "q", where), integers(links, "v", where), link.kind)
        else:
            _displace(q, delta, out, k, n, link.kind)
        step += some


@inline_kernel
def _displace(q: Array, delta: Array, out: Array, k: Any, n: Any, kind: int) -> None:
    """Do so at joints of one kind, k and n being where they begin."""
    if kind == SPHERICAL:
        w, x, y, z = elements(q, 4, k)
        turn = elements(delta, 3, n)
        a, b, c, d = exponential(turn[0], turn[1], turn[2])
        out0 = dot_on(w * a, -x, -y, -z, b, c, d)
        out1 = dot_on(w * b, x, y, -z, a, d, c)
        out2 = dot_on(w * c, -x, y, z, d, a, b)
        out3 = dot_on(w * d, x, -y, z, c, b, a)
        square = dot_on(out0 * out0, out1, out2, out3, out1, out2, out3)
        # the root's first terms, exact where the norm is one but for rounding: always but for what a user gives
        off, norm = size(square - 1.0), fma(-0.5, square, 1.5)
        if not at_most(off, 1e-8):
            norm = either(off, 1e-8, norm, 1.0 / root(square))
        put_elements(out, k, (out0 * norm, out1 * norm, out2 * norm, out3 * norm))
    else:
        put_elements(out, k, elements(q, 1, k) + elements(delta, 1, n))


@kernel
def difference(links: Records, start: Array, end: Array, out: Array) -> None:
    """Fill out (nv,) = end [-] start, configurations (nq,) less than half a turn apart."""
    for i in range(links.shape[0]):
        link = links[i]
        k, n = link.q, link.v
        if link.kind == SPHERICAL or link.kind == FREE:
            if link.kind == FREE:
                for e in range(3):
                    out[n + e] = end[k + e] - start[k + e]
                k, n = k + 3, n + 3
            w, x, y, z = start[k], start[k + 1], start[k + 2], start[k + 3]
            a, b, c, d = end[k], end[k + 1], end[k + 2], end[k + 3]
            turn = (
                w * b - x * a - y * d + z * c,
                w * c - y * a - z * b + x * d,
                w * d - z * a - x * c + y * b,
            )
            half = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
            cosine = w * a + x * b + y * c + z * d
            # a quaternion and its negative are one pose
            angle = 2.0 * math.atan2(half, abs(cosine))
            factor = angle / half if half > 0.0 else 2.0
            if cosine < 0.0:
                factor = -factor
            out[n], out[n + 1], out[n + 2] = factor * turn[0], factor * turn[1], factor * turn[2]
        else:
            out[n] = end[k] - start[k]


@kernel
def rate(links: Records, theta: Array, v: Array, exact: bool, out: Array) -> None:
    """Fill out (nv,): the rate of the local coordinates theta (nv,) under velocity v (nv,), to fourth order or exact."""
    for i in range(links.shape[0]):
        link = links[i]
        n = link.v
        if link.kind == SPHERICAL or link.kind == FREE:
            if link.kind == FREE:
                for c in range(3):
                    out[n + c] = v[n + c]
                n += 3
            out[n], out[n + 1], out[n + 2] = local_rate(
                (theta[n], theta[n + 1], theta[n + 2]), (v[n], v[n + 1], v[n + 2]), exact
            )
        else:
            out[n] = v[n]


@kernel
def rate_derivative(
    links: Records, theta: Array, v: Array, theta_x: Array, v_x: Array, exact: bool, out: Array
) -> None:
    """Fill out (nv, k): the derivative of ``rate`` from those of theta and v, (nv, k) each."""
    columns = out.shape[1]
    for i in range(links.shape[0]):
        link = links[i]
        n = link.v
        if link.kind == SPHERICAL or link.kind == FREE:
            if link.kind == FREE:
                for c in range(3):
                    for j in range(columns):
                        out[n + c, j] = v_x[n + c, j]
                n += 3
            angle, omega = (theta[n], theta[n + 1], theta[n + 2]), (v[n], v[n + 1], v[n + 2])
            for j in range(columns):
                by_theta = local_rate_by_theta(
                    angle, omega, (theta_x[n, j], theta_x[n + 1, j], theta_x[n + 2, j]), exact
                )
                by_v = local_rate(angle, (v_x[n, j], v_x[n + 1, j], v_x[n + 2, j]), exact)
                for c in range(3):
                    out[n + c, j] = by_theta[c] + by_v[c]
        else:
            for j in range(columns):
                out[n, j] = v_x[n, j]


@kernel
def displacement_derivative(links: Records, theta: Array, start_x: Array, theta_x: Array, out: Array) -> None:
    """Fill out (nv, k): the tangent error at q0 [+] theta from those of q0 and theta, (nv, k) each."""
    columns = out.shape[1]
    for i in range(links.shape[0]):
        link = links[i]
        n = link.v
        if link.kind == SPHERICAL or link.kind == FREE:
            if link.kind == FREE:
                for c in range(3):
                    for j in range(columns):
                        out[n + c, j] = start_x[n + c, j] + theta_x[n + c, j]
                n += 3
            angle = (theta[n], theta[n + 1], theta[n + 2])
            back, jacobian = rotation_back(angle), right_jacobian(angle)
            for j in range(columns):
                for r in range(3):
                    total = 0.0
                    for c in range(3):
                        total += back[3 * r + c] * start_x[n + c, j]
                        total += jacobian[3 * r + c] * theta_x[n + c, j]
                    out[n + r, j] = total
        else:
            for j in range(columns):
                out[n, j] = start_x[n, j] + theta_x[n, j]


@kernel
def differential_product(links: Records, theta: Array, matrix: Array, by_theta: bool, out: Array) -> None:
    """Fill out (n, nv) with a derivative by the tangent at q0 [+] theta, matrix (n, nv), taken by theta, or by that at q0.

    matrix and out may be the same array.
    """
    for i in range(links.shape[0]):
        link = links[i]
        n = link.v
        if link.kind == SPHERICAL or link.kind == FREE:
            if link.kind == FREE:
                for r in range(matrix.shape[0]):
                    for c in range(3):
                        out[r, n + c] = matrix[r, n + c]
                n += 3
            angle = (theta[n], theta[n + 1], theta[n + 2])
            turn = right_jacobian(angle) if by_theta else rotation_back(angle)
            for r in range(matrix.shape[0]):
                x, y, z = matrix[r, n], matrix[r, n + 1], matrix[r, n + 2]
                for c in range(3):
                    out[r, n + c] = x * turn[c] + y * turn[3 + c] + z * turn[6 + c]
        else:
            for r in range(matrix.shape[0]):
                out[r, n] = matrix[r, n]
