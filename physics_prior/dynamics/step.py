"""The step of a scene, compiled: advance and linearise, by the integrator that the scene names.

The composer (dynamics/compose.py) writes it as one module: the scene's equation of motion (motion.py), its integrator
(integrators/), the events of contact where there is any (contact/events.py), and this. ``memory`` is that of memory.py; its
seventh number is the time, s. ``linearise`` is the integrator's own, or that of the events: a function around it would be
optimised once more, for seconds.
"""

import math

from physics_prior.dynamics.integrators.rk4 import linearise_smooth, smooth_step
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.memory import OPEN
from physics_prior.dynamics.projection import APART
from physics_prior.dynamics.types import Array

move, linearise = smooth_step, linearise_smooth  # scene: events


@kernel
def advance(memory: Array, q: Array, v: Array, extra: Array, h: float, count: int) -> int:
    """Move q (nq,) and v (nv,) in place, and the time, by count steps of h seconds.

    Return the constraints' rank; -1 if the state is not finite; -2 if the integrator found no solution; -3 if projection could
    not put the state back onto the constraints. extra (nv,) is constant.
    """
    rank = 0
    for _ in range(count):
        rank = move(memory, q, v, extra, h)
        if rank < 0:
            return rank
        if memory[OPEN] > APART:
            return -3
    total = 0.0  # squares, because an energy has to be finite too
    for k in range(v.shape[0]):
        total += v[k] * v[k]
    for k in range(q.shape[0]):
        total += q[k] * q[k]
    return rank if math.isfinite(total) else -1
