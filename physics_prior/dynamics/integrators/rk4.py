"""The classical Runge-Kutta method on the manifold: order 4, explicit.

In the coordinates theta of q = q0 [+] theta, a vector space, so that quaternions stay unit (Munthe-Kaas 1999).
"""

from physics_prior.dynamics.arrays import accumulate, clear, copy
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.manifold import displace, displacement_derivative, rate, rate_derivative
from physics_prior.dynamics.memory import TIME, tangent_sections
from physics_prior.dynamics.motion import differentiate, evaluate, sections, settle, settle_columns, spread_noise
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array


@kernel
def smooth_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Move q (nq,) and v (nv,) in place by one step of h seconds of smooth motion; return the constraints' rank."""
    links, _, _, _, _, start, spare, _ = sections(memory)
    nv, time = v.shape[0], memory[TIME]
    vdot, theta, middle = spare[3], spare[4], spare[5]
    theta_rate, theta_sum, v_sum = spare[6], spare[7], spare[8]
    copy(q, start)
    copy(v, middle)
    clear(theta)
    clear(theta_sum)
    clear(v_sum)
    rank = 0
    for stage in range(4):
        rank = evaluate(memory, q, middle, extra, 0.0, vdot)
        rate(links, theta, middle, False, theta_rate)
        weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        ahead = h if stage == 2 else 0.5 * h
        for k in range(nv):
            theta_sum[k] += weight * theta_rate[k]
            v_sum[k] += weight * vdot[k]
            theta[k] = ahead * theta_rate[k]
            middle[k] = v[k] + ahead * vdot[k]
        if stage < 3:
            memory[TIME] = time + ahead
            displace(links, start, theta, q)
    displace(links, start, theta_sum, q)
    for k in range(nv):
        v[k] += v_sum[k]
    settle(memory, q, v)
    return rank


@kernel
def linearise_smooth(
    memory: Array, tangent: Array, q: Array, v: Array, extra: Array, h: float, force_noise: Array, F: Array, G: Array
) -> int:
    """``smooth_step`` with its derivatives: F and G (2 nv, 2 nv) as ``linearise`` describes them."""
    links, _, _, rows, _, start, spare, _ = sections(memory)
    m, nv, time = row_count(rows), v.shape[0], memory[TIME]
    derivative, _, _, _, _, _, stages = tangent_sections(tangent, links.shape[0], m, nv)
    vdot, theta, middle = spare[3], spare[4], spare[5]
    theta_rate, theta_sum, v_sum = spare[6], spare[7], spare[8]
    rate_x, start_x, theta_x, v_x, q_x, theta_sum_x, v_sum_x = (
        stages[0],
        stages[1],
        stages[2],
        stages[3],
        stages[4],
        stages[5],
        stages[6],
    )
    clear(start_x)
    clear(v_x)
    clear(theta_x)
    clear(theta_sum_x)
    clear(v_sum_x)
    clear(theta)
    clear(theta_sum)
    clear(v_sum)
    for k in range(nv):
        start_x[k, k] = 1.0
        v_x[k, nv + k] = 1.0
    copy(q, start)
    copy(v, middle)
    copy(start_x, q_x)
    rank = 0
    for stage in range(4):
        rank = evaluate(memory, q, middle, extra, 0.0, vdot)
        differentiate(memory, tangent, q, middle, 0.0)
        if stage == 0:
            spread_noise(memory, tangent, force_noise, h, G)
        rate(links, theta, middle, False, theta_rate)
        rate_derivative(links, theta, middle, theta_x, v_x, False, rate_x)
        weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        ahead = h if stage == 2 else 0.5 * h
        accumulate(weight, rate_x, theta_sum_x)
        for k in range(nv):
            theta_sum[k] += weight * theta_rate[k]
            v_sum[k] += weight * vdot[k]
            theta[k] = ahead * theta_rate[k]
            middle[k] = v[k] + ahead * vdot[k]
        clear(theta_x)
        accumulate(ahead, rate_x, theta_x)
        if stage == 0:  # q_x and v_x are those of the state itself
            copy(derivative, rate_x)
        else:
            clear(rate_x)
            add_product(derivative, 0, q_x, rate_x)
            add_product(derivative, nv, v_x, rate_x)
        accumulate(weight, rate_x, v_sum_x)
        clear(v_x)
        for k in range(nv):
            v_x[k, nv + k] = 1.0
        accumulate(ahead, rate_x, v_x)
        if stage < 3:
            memory[TIME] = time + ahead
            displace(links, start, theta, q)
            displacement_derivative(links, theta, start_x, theta_x, q_x)
    displace(links, start, theta_sum, q)
    displacement_derivative(links, theta_sum, start_x, theta_sum_x, q_x)
    for k in range(nv):
        v[k] += v_sum[k]
        v_sum_x[k, nv + k] += 1.0
    copy(q_x, F[:nv])
    copy(v_sum_x, F[nv:])
    settle(memory, q, v)
    settle_columns(memory, tangent, q, v, F, G)
    return rank
