"""Semi-implicit Euler: order 1, one evaluation a step; gyroscopic torques by the implicit midpoint rule (gyroscopic.py).

v+ = v + h vdot(q, v), then q+ = q [+] h v+.
"""

from physics_prior.dynamics.arrays import accumulate, clear
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.manifold import displace, displacement_derivative
from physics_prior.dynamics.memory import TIME, tangent_sections
from physics_prior.dynamics.motion import differentiate, evaluate, sections, settle, settle_columns, spread_noise
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array


@kernel
def smooth_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Move q (nq,) and v (nv,) in place by one step of h seconds of smooth motion; return the constraints' rank."""
    links, _, _, _, _, _, spare, _ = sections(memory)
    vdot, theta = spare[3], spare[4]
    rank = evaluate(memory, q, v, extra, h, vdot)
    for k in range(v.shape[0]):
        v[k] += h * vdot[k]
        theta[k] = h * v[k]
    displace(links, q, theta, q)
    memory[TIME] += h
    settle(memory, q, v)
    return rank


@kernel
def linearise_smooth(
    memory: Array, tangent: Array, q: Array, v: Array, extra: Array, h: float, force_noise: Array, F: Array, G: Array
) -> int:
    """``smooth_step`` with its derivatives: F and G (2 nv, 2 nv) as ``linearise`` describes them."""
    links, _, _, rows, _, _, spare, _ = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, _, _, _, _, _, stages = tangent_sections(tangent, links.shape[0], m, nv)
    vdot, theta, start_x, theta_x = spare[3], spare[4], stages[1], stages[2]
    rank = evaluate(memory, q, v, extra, h, vdot)
    differentiate(memory, tangent, q, v, h)
    spread_noise(memory, tangent, force_noise, h, G)
    clear(F)
    clear(start_x)
    clear(theta_x)
    for k in range(nv):
        v[k] += h * vdot[k]
        theta[k] = h * v[k]
        start_x[k, k] = 1.0
        theta_x[k, nv + k] = h
    accumulate(h, derivative, F[nv:])
    accumulate(h, F[nv:], theta_x)
    for k in range(nv):
        F[nv + k, nv + k] += 1.0
    displacement_derivative(links, theta, start_x, theta_x, F[:nv])
    displace(links, q, theta, q)
    memory[TIME] += h
    settle(memory, q, v)
    settle_columns(memory, tangent, q, v, F, G)
    return rank
