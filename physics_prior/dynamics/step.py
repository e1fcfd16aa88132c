"""The step of a scene, compiled: advance, and carry with a covariance, by the integrator that the scene names.

The composer (dynamics/compose.py) writes it as one module: the scene's equation of motion (motion.py), its integrator
(integrators/), the events of contact where there is any (contact/events.py), and this. ``memory`` is that of memory.py; its
seventh number is the time, s. ``linearise`` is the integrator's own, or that of the events.
"""

import math

from physics_prior.dynamics.arrays import copy, within
from physics_prior.dynamics.covariance import carry_factor
from physics_prior.dynamics.covariance import triangularise as triangularise  # scene: errors
from physics_prior.dynamics.integrators.rk4 import linearise_smooth, smooth_step
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.memory import OPEN, tangent_sections
from physics_prior.dynamics.motion import sections
from physics_prior.dynamics.projection import APART
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array

LARGEST = 1e150  # beyond it squares are not finite: an energy has to be, too
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
    return rank if within(q, LARGEST) and within(v, LARGEST) else -1


@kernel
def carry(
    memory: Array,
    tangent: Array,
    q: Array,
    v: Array,
    extra: Array,
    h: float,
    count: int,
    force_noise: Array,
    U: Array,
    T: Array,
    reduced: bool,
) -> int:
    """Move q (nq,) and v (nv,) as ``advance`` does, and the factor U (2 nv, 2 nv) of their errors; return as it does.

    force_noise (nv, nv): a factor of the density of white generalized forces. T (4 nv, 2 nv) is left as the last step's U F^T
    above G^T; or, if reduced, U as their triangular factor and T as scratch.
    """
    links, _, _, rows, _, _, _, _ = sections(memory)
    nv, rank, total = v.shape[0], 0, 0.0
    n = 2 * nv
    stages = tangent_sections(tangent, links.shape[0], row_count(rows), nv)[6]
    last = stages.shape[0]
    F, G = stages[last - 4 : last - 2].reshape(n, n), stages[last - 2 : last].reshape(n, n)
    for index in range(count):
        rank = linearise(memory, tangent, q, v, extra, h, force_noise, F, G)
        if rank < 0:
            return rank
        if memory[OPEN] > APART:
            return -3
        carry_factor(F, G, U, T)
        if reduced or index < count - 1:
            triangularise(T, n, tangent)  # what derivatives needed is scratch
            copy(T[:n], U)
    if reduced:
        for k in range(n):
            total += U[k, k]  # a reflection takes what is not finite in a row to the diagonal
    return rank if math.isfinite(total) and within(q, LARGEST) and within(v, LARGEST) else -1
