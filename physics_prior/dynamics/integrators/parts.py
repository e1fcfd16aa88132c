"""A step in parts: as many as the integrator needs for its error to stay small, or for its equations to have a solution.

Constraints are projected after each. Of a step that goes through at once the part is the whole.
"""

from physics_prior.dynamics.arrays import clear, copy
from physics_prior.dynamics.integrators.implicit_runge_kutta import attempt, differentiate_part
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.memory import TIME, tangent_sections
from physics_prior.dynamics.motion import differentiate, evaluate, sections, settle, settle_columns, spread_noise
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array

SMALLEST = 1e-6  # of the step: a part shorter than that is given up


@kernel
def smooth_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Move q (nq,) and v (nv,) in place by one step of h seconds of smooth motion; return the constraints' rank.

    A negative number tells that no part was short enough.
    """
    time, done, part = memory[TIME], 0.0, h
    while True:
        rest = h - done
        last = abs(part) >= (1.0 - SMALLEST) * abs(rest)
        take = rest if last else part
        rank, part = attempt(memory, q, v, extra, take)
        if rank >= 0:
            done += take
            memory[TIME] = time + h if last else time + done
            settle(memory, q, v)
            if last:
                return rank
        else:
            memory[TIME] = time + done
            if not abs(part) > SMALLEST * abs(h):
                return rank


@kernel
def linearise_smooth(
    memory: Array, tangent: Array, q: Array, v: Array, extra: Array, h: float, force_noise: Array, F: Array, G: Array
) -> int:
    """``smooth_step`` with its derivatives: F and G (2 nv, 2 nv) as ``linearise`` describes them."""
    links, _, _, rows, _, _, spare, _ = sections(memory)
    nv = v.shape[0]
    stages = tangent_sections(tangent, links.shape[0], row_count(rows), nv)[6]
    own, chained = stages[1:3].reshape(2 * nv, 2 * nv), stages[3:5].reshape(2 * nv, 2 * nv)
    clear(F)
    for k in range(2 * nv):
        F[k, k] = 1.0
    evaluate(memory, q, v, extra, 0.0, spare[3])
    differentiate(memory, tangent, q, v, 0.0)
    spread_noise(memory, tangent, force_noise, h, G)
    time, done, part = memory[TIME], 0.0, h
    while True:
        rest = h - done
        last = abs(part) >= (1.0 - SMALLEST) * abs(rest)
        take = rest if last else part
        rank, part = attempt(memory, q, v, extra, take)
        if rank >= 0:
            begin = time + done
            done += take
            memory[TIME] = time + h if last else time + done
            settle(memory, q, v)
            differentiate_part(memory, tangent, begin, extra, take, own)
            memory[TIME] = time + h if last else time + done
            settle_columns(memory, tangent, q, v, own, G)
            copy(F, chained)
            clear(F)
            add_product(own, 0, chained, F)
            if last:
                return rank
        else:
            memory[TIME] = time + done
            if not abs(part) > SMALLEST * abs(h):
                return rank
