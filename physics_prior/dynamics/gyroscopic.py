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
    inverse9,
    minus,
    plus,
    scale,
    scale9,
    sum9,
    symmetric_times,
    times,
)
from physics_prior.dynamics.blocks import at_most
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.lanes import numbers, put_numbers
from physics_prior.dynamics.records import SPHERICAL
from physics_prior.dynamics.spatial import inertia_about
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
    """The angular velocity in the middle of a free body's step, by Newton's method with its first slope.

    For its difference y from omega: (I + h/2 K) y = -h/2 (omega x I omega + y x I y), K the spin matrix at omega.
    """
    torque = cross(omega, symmetric_times(inertia, omega))
    slope = sum9(full(inertia), scale9(0.5 * step, spin_matrix(inertia, omega)))
    back = scale9(-0.5 * step, inverse9(slope))
    y = times(back, torque)
    before, least = dot(y, y), NEWTON_TOLERANCE * dot(omega, omega)
    for _ in range(NEWTON_ITERATIONS):
        better = times(back, plus(torque, cross(y, symmetric_times(inertia, y))))
        change = minus(better, y)
        y, size = better, dot(change, change)
        if at_most(size * size, least * before):
            break
        before = size
    return plus(omega, y)


@inline_kernel
def turning_inertia(link: Record, here: Record) -> Symmetric:
    """The inertia that a link turns with: about its joint where a ball joint holds that, about its centre where it is free."""
    mass = link.mass if link.kind == SPHERICAL else 0.0
    return inertia_about(get6(here.inertia), mass, get3(here.center))


@kernel
def take_at_middle(links: Records, work: Records, step: float) -> None:
    """Replace the gyroscopic torque of links on ball and free joints by that of the middle of the step; four links at once."""
    last = links.shape[0] - 1
    for begin in range(0, last + 1, 4):
        first, end = links[begin].turning, links[min(begin + 3, last)].turning
        if first < 0 or (begin > 0 and first == links[begin - 1].turning):
            break
        where = (first, links[min(begin + 1, last)].turning, links[min(begin + 2, last)].turning, end)
        mass, center = numbers(links, "turning_mass", 1, where), numbers(work, "center", 3, where)
        inertia = inertia_about(numbers(work, "inertia", 6, where), mass, center)
        omega = numbers(work, "omega", 3, where)
        middle = middle_rate(inertia, omega, step)
        start_torque = cross(omega, symmetric_times(inertia, omega))
        change = minus(cross(middle, symmetric_times(inertia, middle)), start_torque)
        put_numbers(work, "gyroscopic", where, plus(numbers(work, "gyroscopic", 3, where), change))


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
    change = minus(times(inverse9(slope), right), direction)
    torque = scale(-1.0 / step, symmetric_times(inertia, change))
    return minus(torque, times(spin_matrix(inertia, omega), direction))
