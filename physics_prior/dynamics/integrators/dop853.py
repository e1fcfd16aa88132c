"""The embedded pair of Dormand and Prince, order 8 with error estimates of order 5 and 3: explicit, steps of its own size.

In the coordinates theta of q = q0 [+] theta (Munthe-Kaas 1999). Coefficients and estimate: Hairer, Norsett and Wanner 1993,
II.5 and II.10. The error of a step, m and rad, m/s and rad/s, or relative where a velocity is above one, stays below the
scene's tolerance. The first attempt is the whole step, so that what ran before leaves no trace.
"""

import math

import numpy as np
from scipy.integrate import DOP853

from physics_prior.dynamics.arrays import accumulate, clear, copy
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.manifold import displace, displacement_derivative, rate, rate_derivative
from physics_prior.dynamics.memory import SPARE, TIME, TOLERANCE, stage_configuration, tangent_sections
from physics_prior.dynamics.motion import differentiate, evaluate, sections
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array

STAGES = 12
A = np.ascontiguousarray(DOP853.A)
B = np.ascontiguousarray(DOP853.B)
C = np.ascontiguousarray(DOP853.C)
THIRD = np.ascontiguousarray(DOP853.E3)
FIFTH = np.ascontiguousarray(DOP853.E5)

SAFETY = 0.9
LEAST, MOST = 0.2, 5.0  # change of size from one part of a step to the next


@kernel
def attempt(memory: Array, q: Array, v: Array, extra: Array, h: float) -> tuple[int, float]:
    """Move q (nq,) and v (nv,) in place by h seconds; return the constraints' rank and the size, s, of a next part.

    Where the error is above the tolerance nothing is moved: then return -2 (-1 if not finite) and a size that may do.
    """
    links, _, _, _, _, start, spare, _ = sections(memory)
    nv, time, tolerance = v.shape[0], memory[TIME], memory[TOLERANCE]
    theta_rate, vdot = spare[SPARE + 3 : SPARE + 3 + STAGES], spare[SPARE + 3 + STAGES : SPARE + 3 + 2 * STAGES]
    theta, middle, position = spare[4], spare[5], stage_configuration(memory)
    copy(q, start)
    copy(v, spare[SPARE + 2])
    rank = 0
    for i in range(STAGES):
        _stage_state(theta_rate, vdot, i, v, h, theta, middle)
        memory[TIME] = time + C[i] * h
        displace(links, start, theta, position)
        rank = evaluate(memory, position, middle, extra, 0.0, vdot[i])
        rate(links, theta, middle, True, theta_rate[i])
    third, fifth = 0.0, 0.0
    clear(theta)
    clear(middle)
    for k in range(nv):
        theta_3, theta_5, v_3, v_5 = 0.0, 0.0, 0.0, 0.0
        for i in range(STAGES):
            theta[k] += h * B[i] * theta_rate[i, k]
            middle[k] += h * B[i] * vdot[i, k]
            theta_3 += THIRD[i] * theta_rate[i, k]
            theta_5 += FIFTH[i] * theta_rate[i, k]
            v_3 += THIRD[i] * vdot[i, k]
            v_5 += FIFTH[i] * vdot[i, k]
        one = tolerance * max(1.0, abs(v[k]))
        third += (theta_3 / tolerance) ** 2 + (v_3 / one) ** 2
        fifth += (theta_5 / tolerance) ** 2 + (v_5 / one) ** 2
    error = 0.0
    if fifth != 0.0:
        error = abs(h) * fifth / math.sqrt((fifth + 0.01 * third) * 2.0 * nv)
    if not math.isfinite(error):
        return -1, LEAST * h
    factor = MOST
    if error > 0.0:
        factor = min(MOST, max(LEAST, SAFETY * error**-0.125))
    if error > 1.0:
        return -2, factor * h
    displace(links, start, theta, q)
    for k in range(nv):
        v[k] += middle[k]
    return rank, factor * h


@kernel
def differentiate_part(memory: Array, tangent: Array, time: float, extra: Array, h: float, F: Array) -> None:
    """Fill F (2 nv, 2 nv), the derivative of the ``attempt`` that was just made at that time, by the chain rule."""
    links, _, _, rows, _, start, spare, _ = sections(memory)
    nv, old = extra.shape[0], spare[SPARE + 2]
    theta_rate, vdot = spare[SPARE + 3 : SPARE + 3 + STAGES], spare[SPARE + 3 + STAGES : SPARE + 3 + 2 * STAGES]
    theta, middle, position = spare[4], spare[5], stage_configuration(memory)
    derivative, _, _, _, _, _, stages = tangent_sections(tangent, links.shape[0], row_count(rows), nv)
    start_x, theta_x, v_x, q_x = stages[5], stages[6], stages[7], stages[8]
    theta_rate_x, vdot_x = stages[9 : 9 + STAGES], stages[9 + STAGES : 9 + 2 * STAGES]
    clear(start_x)
    for k in range(nv):
        start_x[k, k] = 1.0
    for i in range(STAGES):
        _stage_state(theta_rate, vdot, i, old, h, theta, middle)
        memory[TIME] = time + C[i] * h
        displace(links, start, theta, position)
        evaluate(memory, position, middle, extra, 0.0, vdot[i])
        differentiate(memory, tangent, position, middle, 0.0)
        clear(theta_x)
        clear(v_x)
        for k in range(nv):
            v_x[k, nv + k] = 1.0
        for j in range(i):
            if A[i, j] != 0.0:
                accumulate(h * A[i, j], theta_rate_x[j], theta_x)
                accumulate(h * A[i, j], vdot_x[j], v_x)
        displacement_derivative(links, theta, start_x, theta_x, q_x)
        rate_derivative(links, theta, middle, theta_x, v_x, True, theta_rate_x[i])
        clear(vdot_x[i])
        add_product(derivative, 0, q_x, vdot_x[i])
        add_product(derivative, nv, v_x, vdot_x[i])
    clear(theta)
    clear(theta_x)
    clear(F)
    for k in range(nv):
        F[nv + k, nv + k] = 1.0
    for i in range(STAGES):
        accumulate(h * B[i], theta_rate_x[i], theta_x)
        accumulate(h * B[i], vdot_x[i], F[nv:])
        for k in range(nv):
            theta[k] += h * B[i] * theta_rate[i, k]
    displacement_derivative(links, theta, start_x, theta_x, F[:nv])


@kernel
def _stage_state(theta_rate: Array, vdot: Array, stage: int, v: Array, h: float, theta: Array, middle: Array) -> None:
    """Fill theta and the velocity (nv,) of a stage from the rates (12, nv) of those before it."""
    clear(theta)
    copy(v, middle)
    for j in range(stage):
        weight, turned, gained = h * A[stage, j], theta_rate[j], vdot[j]
        if weight != 0.0:
            for k in range(v.shape[0]):
                theta[k] += weight * turned[k]
                middle[k] += weight * gained[k]
