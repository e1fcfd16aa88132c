"""Prescribed motion of anchors in the world: where they are, how fast and how they accelerate (design eq. 4).

A table is: the number n of cubic pieces, the angular frequency and the phase of a sine, its amplitude (3,); then, for n > 0,
the times at which pieces begin and the last one ends (n + 1,), and each piece's coefficients of 1, s, s^2 and s^3 (4, 3), s
being the time since the piece began. The displacement is their sum; before the first piece and after the last it stays.
"""

import math

from physics_prior.dynamics.algebra import get3, plus, put3, scale
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Records, Vector

SPLINE = 6  # numbers before the times


@kernel
def move_anchors(work: Records, pairs: Records, parameters: Array, time: float) -> None:
    """Bring the moving anchors of active pairs to a time, s: their place, velocity and acceleration."""
    for p in range(pairs.shape[0]):
        pair = pairs[p]
        if pair.motion > 0 and pair.active:
            displacement, velocity, acceleration = displaced_anchor(parameters[pair.motion :], time)
            place = plus(get3(pair.base), displacement)
            put3(pair.point_a, place)
            put3(pair.a, place)
            put3(pair.drift, velocity)
            put3(pair.drift_rate, acceleration)
            if pair.is_rod:
                work[0].factored = 0  # its direction turns with the anchor


@inline_kernel
def displaced_anchor(table: Array, time: float) -> tuple[Vector, Vector, Vector]:
    """Displacement, m, velocity and acceleration of an anchor by its table at a time, s."""
    omega, angle = table[1], table[1] * time + table[2]
    sine, cosine = math.sin(angle), math.cos(angle)
    amplitude = (table[3], table[4], table[5])
    displacement = scale(sine, amplitude)
    velocity = scale(omega * cosine, amplitude)
    acceleration = scale(-omega * omega * sine, amplitude)
    n = int(table[0])
    if n > 0:
        begin, end = table[SPLINE], table[SPLINE + n]
        now = min(max(time, begin), end)
        low, high = 0, n
        while high - low > 1:
            middle = (low + high) // 2
            if table[SPLINE + middle] <= now:
                low = middle
            else:
                high = middle
        s, first = now - table[SPLINE + low], SPLINE + n + 1 + 12 * low
        c0, c1 = get3(table[first : first + 3]), get3(table[first + 3 : first + 6])
        c2, c3 = get3(table[first + 6 : first + 9]), get3(table[first + 9 : first + 12])
        displacement = plus(displacement, plus(plus(c0, scale(s, c1)), plus(scale(s * s, c2), scale(s * s * s, c3))))
        moving = 1.0 if begin <= time <= end else 0.0
        rate = plus(c1, plus(scale(2.0 * s, c2), scale(3.0 * s * s, c3)))
        velocity = plus(velocity, scale(moving, rate))
        acceleration = plus(acceleration, scale(moving, plus(scale(2.0, c2), scale(6.0 * s, c3))))
    return displacement, velocity, acceleration
