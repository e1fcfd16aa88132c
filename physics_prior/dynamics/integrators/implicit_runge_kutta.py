"""Implicit Runge-Kutta steps by Newton's method with analytic derivatives, for the coefficients of one of the methods here.

The stages are V_i = v + h sum_j A_ij vdot(q [+] theta_j, V_j), theta_j = h sum_k A_jk V_k: exact for one stage, where theta
is parallel to V; of two stages the commutator of their turns is left out, which is of third order in h.
"""

import math

from physics_prior.dynamics.arrays import accumulate, clear, copy
from physics_prior.dynamics.integrators.implicit_midpoint import STAGES, A, B, C, D
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.linear_solve import factorize_square, solve_square
from physics_prior.dynamics.manifold import differential_product, displace, displacement_derivative
from physics_prior.dynamics.memory import SPARE, TIME, stage_configuration, tangent_sections, workspace
from physics_prior.dynamics.motion import differentiate, evaluate, sections
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array

ITERATIONS = 25
SLOW = 0.1  # a change that shrinks less than this asks for a new derivative
ROUNDING = 1e-16  # of the velocity, at which Newton's method has nothing left to gain
STALL = 1e-9  # of the velocity: below it, changes that no longer shrink are rounding of the forces
RETRY = 0.25  # a step without solution is taken in parts so much shorter


@kernel
def attempt(memory: Array, q: Array, v: Array, extra: Array, h: float) -> tuple[int, float]:
    """Move q (nq,) and v (nv,) in place by h seconds; return the constraints' rank and h.

    Where Newton's method does not converge nothing is moved: then return -2 (-1 if not finite) and a step that may do. It
    must do so monotonically (Deuflhard 2004, 2.1): what it reached by a detour would be another solution, many turns away.
    """
    links, _, _, rows, _, start, spare, _ = sections(memory)
    nv, inner, time = v.shape[0], workspace(memory), memory[TIME]
    size = STAGES * nv
    stages = tangent_sections(inner, links.shape[0], row_count(rows), nv)[6]
    slope = stages[5:7].reshape(-1)[: size * size].reshape(size, size)
    V, change = spare[SPARE + 3 : SPARE + 3 + STAGES], spare[SPARE + 3 + 2 * STAGES : SPARE + 3 + 3 * STAGES]
    pivots = spare[SPARE + 3 + 3 * STAGES : SPARE + 3 + 4 * STAGES].reshape(-1)
    copy(q, start)
    copy(v, spare[SPARE + 2])
    for i in range(STAGES):
        copy(v, V[i])
    before, slow, rank = math.inf, True, 0
    for iteration in range(ITERATIONS):
        rank = _stages(memory, inner, time, extra, h, slow)
        if slow:
            factorize_square(slope, pivots)
        solve_square(slope, pivots, change.reshape(-1, 1))
        moved, scale = 0.0, abs(h)  # sums, in which what is not a number stays visible
        for i in range(STAGES):
            for k in range(nv):
                V[i, k] += change[i, k]
                moved += abs(change[i, k])
                scale += abs(V[i, k])
        if not math.isfinite(moved + scale):
            return -1, RETRY * h
        shrunk = moved / before if iteration > 0 else 1.0
        if slow and shrunk > 1.0 and moved > STALL * scale:
            break
        if moved * shrunk <= ROUNDING * scale or (shrunk > 0.5 and moved <= STALL * scale):
            theta = spare[4]
            clear(theta)
            for i in range(STAGES):
                for k in range(nv):
                    theta[k] += h * B[i] * V[i, k]
                    v[k] += D[i] * (V[i, k] - spare[SPARE + 2, k])
            displace(links, start, theta, q)
            return rank, h
        slow = iteration > 0 and shrunk > SLOW
        before = moved
    return -2, RETRY * h


@kernel
def differentiate_part(memory: Array, tangent: Array, time: float, extra: Array, h: float, F: Array) -> None:
    """Fill F (2 nv, 2 nv), the derivative of the ``attempt`` just made at that time, by the implicit function theorem."""
    links, _, _, rows, _, _, spare, _ = sections(memory)
    nv = extra.shape[0]
    size = STAGES * nv
    stages = tangent_sections(tangent, links.shape[0], row_count(rows), nv)[6]
    slope = stages[5:7].reshape(-1)[: size * size].reshape(size, size)
    V, V_x = spare[SPARE + 3 : SPARE + 3 + STAGES], stages[7 : 7 + STAGES]
    pivots = spare[SPARE + 3 + 3 * STAGES : SPARE + 3 + 4 * STAGES].reshape(-1)
    theta, theta_x, start_x = spare[4], stages[9], stages[10]
    _stages(memory, tangent, time, extra, h, True)
    factorize_square(slope, pivots)
    solve_square(slope, pivots, V_x.reshape(size, 2 * nv))
    clear(F)
    clear(theta)
    clear(theta_x)
    clear(start_x)
    for k in range(nv):
        start_x[k, k] = 1.0
        F[nv + k, nv + k] = 1.0
    for i in range(STAGES):
        accumulate(h * B[i], V_x[i], theta_x)
        accumulate(D[i], V_x[i], F[nv:])
        for k in range(nv):
            theta[k] += h * B[i] * V[i, k]
            F[nv + k, nv + k] -= D[i]
    displacement_derivative(links, theta, start_x, theta_x, F[:nv])


@kernel
def _stages(memory: Array, tangent: Array, time: float, extra: Array, h: float, linear: bool) -> int:
    """Fill what the stages' equations miss, and, if linear, their derivatives by V and, negated, by q and v at the start."""
    links, _, _, rows, _, start, spare, _ = sections(memory)
    nv = extra.shape[0]
    size = STAGES * nv
    derivative, _, _, _, _, _, stages = tangent_sections(tangent, links.shape[0], row_count(rows), nv)
    by_q, by_v = derivative[:, :nv], derivative[:, nv:]
    slope = stages[5:7].reshape(-1)[: size * size].reshape(size, size)
    V_x, turned, position = stages[7 : 7 + STAGES], stages[9][:, :nv], stage_configuration(memory)
    old, V = spare[SPARE + 2], spare[SPARE + 3 : SPARE + 3 + STAGES]
    vdot = spare[SPARE + 3 + STAGES : SPARE + 3 + 2 * STAGES]
    missing, theta = spare[SPARE + 3 + 2 * STAGES : SPARE + 3 + 3 * STAGES], spare[4]
    if linear:
        clear(slope)
        clear(V_x)
        for i in range(STAGES):
            for k in range(nv):
                slope[i * nv + k, i * nv + k] = 1.0
                V_x[i, k, nv + k] = 1.0
    rank = 0
    for j in range(STAGES):
        clear(theta)
        for i in range(STAGES):
            for k in range(nv):
                theta[k] += h * A[j, i] * V[i, k]
        displace(links, start, theta, position)
        memory[TIME] = time + C[j] * h
        rank = evaluate(memory, position, V[j], extra, 0.0, vdot[j])
        if linear:
            differentiate(memory, tangent, position, V[j], 0.0)
            differential_product(links, theta, by_q, False, turned)
            differential_product(links, theta, by_q, True, by_q)
            for i in range(STAGES):
                for r in range(nv):
                    own = V_x[i, r]
                    for c in range(nv):
                        own[c] += h * A[i, j] * turned[r, c]
                    for k in range(STAGES):
                        share = h * A[i, j] * h * A[j, k]
                        line = slope[i * nv + r, k * nv : k * nv + nv]
                        for c in range(nv):
                            line[c] -= share * by_q[r, c]
                    line = slope[i * nv + r, j * nv : j * nv + nv]
                    for c in range(nv):
                        line[c] -= h * A[i, j] * by_v[r, c]
    for i in range(STAGES):
        for k in range(nv):
            missing[i, k] = old[k] - V[i, k]
            for j in range(STAGES):
                missing[i, k] += h * A[i, j] * vdot[j, k]
    return rank
