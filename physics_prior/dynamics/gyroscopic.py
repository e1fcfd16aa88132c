"""Gyroscopic torque of fast spin, taken at the middle of the step.

The explicit torque omega x I omega feeds energy into a fast top (numerics 3.1). Euler's equation of the free body solved by
the implicit midpoint rule, I (w+ - w) + h wm x I wm = 0 with wm = (w + w+)/2, keeps its energy at any h; the torque of that
solution is what the semi-implicit step applies to links on ball and free joints, about the point that they turn about.
"""

from physics_prior.dynamics.algebra import (
    cross,
    dot,
    full,
    get3,
    get6,
    minus,
    plus,
    put3,
    scale,
    scale9,
    solve3,
    sum9,
    symmetric_times,
    times,
)
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import FREE, SPHERICAL
from physics_prior.dynamics.types import Matrix, Record, Records, Symmetric, Vector

NEWTON_ITERATIONS = 20
NEWTON_TOLERANCE = 1e-30  # of the squared angular velocity: what the next change would be, at the rate of the last


@inline_kernel
def spin_matrix(inertia: Symmetric, omega: Vector) -> Matrix:
    """The derivative of omega x I omega by omega: [omega]x I - [I omega]x, a 9-tuple."""
    i = full(inertia)
    x, y, z = omega
    a, b, c = symmetric_times(inertia, omega)
    return (
        y * i[6] - z * i[3],
        y * i[7] - z * i[4] + c,
        y * i[8] - z * i[5] - b,
        z * i[0] - x * i[6] - c,
        z * i[1] - x * i[7],
        z * i[2] - x * i[8] + a,
        x * i[3] - y * i[0] + b,
        x * i[4] - y * i[1] - a,
        x * i[5] - y * i[2],
    )


@inline_kernel
def middle_rate(inertia: Symmetric, omega: Vector, step: float) -> Vector:
    """The angular velocity in the middle of a free body's step, by Newton's method with its first slope."""
    after, before = omega, dot(omega, omega)
    slope = sum9(full(inertia), scale9(0.5 * step, spin_matrix(inertia, omega)))
    for _ in range(NEWTON_ITERATIONS):
        middle = scale(0.5, plus(omega, after))
        error = plus(
            symmetric_times(inertia, minus(after, omega)),
            scale(step, cross(middle, symmetric_times(inertia, middle))),
        )
        change = solve3(slope, error)
        after = minus(after, change)
        size = dot(change, change)
        if size * size <= NEWTON_TOLERANCE * before * dot(after, after):
            break
        before = size
    return scale(0.5, plus(omega, after))


@inline_kernel
def turning_inertia(link: Record, here: Record) -> Symmetric:
    """The inertia that a link turns with: about its joint where a ball joint holds that, about its centre where it is free."""
    xx, xy, xz, yy, yz, zz = get6(here.inertia)
    m = link.mass if link.kind == SPHERICAL else 0.0
    x, y, z = get3(here.center)
    return (
        xx + m * (y * y + z * z),
        xy - m * x * y,
        xz - m * x * z,
        yy + m * (x * x + z * z),
        yz - m * y * z,
        zz + m * (x * x + y * y),
    )


@kernel
def take_at_middle(links: Records, work: Records, step: float) -> None:
    """Replace the gyroscopic torque of links on ball and free joints by that of the middle of the step."""
    for i in range(links.shape[0]):
        if (links[i].kind == SPHERICAL or links[i].kind == FREE) and links[i].mass > 0.0:
            here = work[i]
            inertia, omega = turning_inertia(links[i], here), get3(here.omega)
            middle = middle_rate(inertia, omega, step)
            start_torque = cross(omega, symmetric_times(inertia, omega))
            change = minus(cross(middle, symmetric_times(inertia, middle)), start_torque)
            put3(here.gyroscopic, plus(get3(here.gyroscopic), change))


@inline_kernel
def middle_correction(inertia: Symmetric, omega: Vector, step: float, direction: Vector) -> Vector:
    """How much more the middle torque changes along a direction of omega than the explicit one.

    From the implicit equation: (I + h/2 K) dw+ = (I - h/2 K) dw, K the spin matrix at wm, torque = -I (w+ - w) / h.
    """
    middle = middle_rate(inertia, omega, step)
    K = spin_matrix(inertia, middle)
    slope = sum9(full(inertia), scale9(0.5 * step, K))
    right = minus(
        symmetric_times(inertia, direction),
        scale(
            0.5 * step,
            times(K, direction),
        ),
    )
    change = minus(solve3(slope, right), direction)
    torque = scale(-1.0 / step, symmetric_times(inertia, change))
    return minus(torque, times(spin_matrix(inertia, omega), direction))
