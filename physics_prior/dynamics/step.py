"""The step of a scene, compiled: evaluate, advance, linearise.

This file is the step of a scene without force effects and without constraints. For any other scene the composer
(dynamics/compose.py) writes a copy of it into the kernel cache with the lines marked ``scene`` replaced, so that a
scene's step holds the effects that it names and nothing else. ``memory`` is that of memory.py.
"""

import math

from physics_prior.dynamics.arrays import accumulate, add_product, clear, copy, subtract_transposed_product
from physics_prior.dynamics.articulated_body import accelerate, factorize
from physics_prior.dynamics.constraint import (
    POSITION_TOLERANCE,
    constrain_acceleration,
    multiply_columns,
    refresh,
    responses,
    row_count,
)
from physics_prior.dynamics.constraint_derivatives import differentiate_rows
from physics_prior.dynamics.derivatives import inverse_dynamics_derivatives, sweep
from physics_prior.dynamics.gyroscopic import take_at_middle
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import flow, pose, weigh
from physics_prior.dynamics.manifold import displace, displacement_derivative, rate, rate_derivative
from physics_prior.dynamics.mass_factor import factorize_mass, solve_mass
from physics_prior.dynamics.memory import correction_sections, sections, tangent_sections
from physics_prior.dynamics.projection import project
from physics_prior.dynamics.types import Array, Records
from physics_prior.effects.none import differentiate_forces, forces  # scene: effects

CONSTRAINED = False  # scene: constraints
RUNGE_KUTTA = True  # scene: integrator


@kernel
def evaluate(memory: Array, q: Array, v: Array, extra: Array, step: float, vdot: Array) -> int:
    """Fill vdot (nv,) at q and v under the effects and extra generalized forces (nv,); return the constraints' rank.

    step > 0 takes gyroscopic torques at the middle of such a step.
    """
    links, work, pairs, rows, known, _, spare, parameters = sections(memory)
    gravity, tau = parameters[:3], spare[2]
    rank = 0
    if CONSTRAINED:
        rank = refresh(links, work, pairs, rows, known, q)
    else:
        pose(links, work, q)
        weigh(links, work)
        factorize(links, work)
    flow(links, work, v)
    if step > 0.0:
        take_at_middle(links, work, step)
    copy(extra, tau)
    forces(parameters, links, work, q, v, tau)
    accelerate(links, work, tau, gravity, vdot)
    if CONSTRAINED:
        constrain_acceleration(links, work, pairs, rows, gravity, vdot, spare)
    return rank


@kernel
def advance(memory: Array, q: Array, v: Array, extra: Array, h: float, count: int) -> int:
    """Move q (nq,) and v (nv,) in place by count steps of h seconds; return the constraints' rank, -1 if not finite.

    Semi-implicit Euler, or the classical Runge-Kutta method of order four in the coordinates theta of q0 [+] theta (Munthe-Kaas
    1999). Constraints are projected after each step. extra (nv,) is constant.
    """
    links, work, pairs, rows, known, start, spare, _ = sections(memory)
    nv = v.shape[0]
    vdot, theta, middle = spare[3], spare[4], spare[5]
    theta_rate, theta_sum, v_sum = spare[6], spare[7], spare[8]
    rank = 0
    for _ in range(count):
        if RUNGE_KUTTA:
            copy(q, start)
            copy(v, middle)
            clear(theta)
            clear(theta_sum)
            clear(v_sum)
            for stage in range(4):
                rank = evaluate(memory, q, middle, extra, 0.0, vdot)
                rate(links, theta, middle, theta_rate)
                weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
                ahead = h if stage == 2 else 0.5 * h
                for k in range(nv):
                    theta_sum[k] += weight * theta_rate[k]
                    v_sum[k] += weight * vdot[k]
                    theta[k] = ahead * theta_rate[k]
                    middle[k] = v[k] + ahead * vdot[k]
                if stage < 3:
                    displace(links, start, theta, q)
            displace(links, start, theta_sum, q)
            for k in range(nv):
                v[k] += v_sum[k]
        else:
            rank = evaluate(memory, q, v, extra, h, vdot)
            for k in range(nv):
                v[k] += h * vdot[k]
                theta[k] = h * v[k]
            displace(links, q, theta, q)
        if CONSTRAINED:
            project(links, work, pairs, rows, known, q, v, spare, POSITION_TOLERANCE)
    total = 0.0
    for k in range(nv):
        total += abs(v[k])
    for k in range(q.shape[0]):
        total += abs(q[k])
    return rank if math.isfinite(total) else -1


@kernel
def differentiate(memory: Array, tangent: Array, q: Array, v: Array, step: float) -> None:
    """Fill the tangent's derivative (nv, 2 nv): of vdot by the tangent of q, and beside it by v.

    Needs ``evaluate`` at the same state.
    """
    links, work, pairs, rows, _, _, spare, parameters = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, matrices, _, scratch, freedoms, composites, gaps = tangent_sections(tangent, links.shape[0], m, nv)
    gravity, M, tau_q, tau_v = parameters[:3], matrices[0:nv], derivative[:, :nv], derivative[:, nv:]
    clear(derivative)
    sweep(links, work, gravity, step, freedoms, composites)
    inverse_dynamics_derivatives(links, freedoms, composites, tau_q, tau_v, M)
    A, A_q = matrices[nv : nv + m], matrices[nv + m : nv + 2 * m]
    rows_q, rows_v = matrices[nv + 2 * m : nv + 3 * m], matrices[nv + 3 * m : nv + 4 * m]
    if CONSTRAINED:
        differentiate_rows(links, work, pairs, freedoms, composites, gravity, gaps, A, A_q, rows_q, rows_v, tau_q)
    for i in range(nv):
        own = derivative[i]
        for j in range(2 * nv):
            own[j] = -own[j]
    differentiate_forces(parameters, links, work, q, v, tau_q, tau_v)
    factorize_mass(freedoms, M)
    solve_mass(freedoms, M, derivative)
    if CONSTRAINED:
        response, right, answer, change = correction_sections(scratch, m, nv, 2 * nv)
        responses(links, work, rows, spare[0], response)
        clear(right)
        add_product(A, derivative, right)
        for r in range(m):
            for j in range(nv):
                right[r, j] += rows_q[r, j]
                right[r, nv + j] += rows_v[r, j]
        multiply_columns(rows, right, answer, change)
        subtract_transposed_product(response, answer, derivative)


@kernel
def differentiate_acceleration(memory: Array, tangent: Array, q: Array, v: Array, extra: Array) -> int:
    """Fill the tangent's derivative of ``evaluate`` at q, v and extra, gyroscopic torques explicit; return the rank."""
    rank = evaluate(memory, q, v, extra, 0.0, sections(memory)[6][3])
    differentiate(memory, tangent, q, v, 0.0)
    return rank


@kernel
def project_columns(memory: Array, A: Array, A_q: Array, columns: Array, scratch: Array) -> None:
    """Put the columns (2 nv, k) of errors of q and v onto the constraints' tangent space, in the mass metric.

    A dq = 0 and A dv + d(A v)/dq dq = 0: the covariance then has no mass in forbidden directions. Needs ``refresh``, and
    scratch of ``correction_size``.
    """
    links, work, _, rows, _, _, spare, _ = sections(memory)
    m, nv = A.shape
    by_q, by_v = columns[:nv], columns[nv:]
    response, right, answer, change = correction_sections(scratch, m, nv, columns.shape[1])
    responses(links, work, rows, spare[0], response)
    clear(right)
    add_product(A, by_q, right)
    multiply_columns(rows, right, answer, change)
    subtract_transposed_product(response, answer, by_q)
    clear(right)
    add_product(A, by_v, right)
    add_product(A_q, by_q, right)
    multiply_columns(rows, right, answer, change)
    subtract_transposed_product(response, answer, by_v)


@kernel
def tangent_rows(memory: Array, tangent: Array, q: Array, v: Array, A: Array, A_q: Array) -> None:
    """Fill A (m, nv) and A_q (m, nv), the constraint Jacobian and the derivative of A v by q, at q and v."""
    links, work, pairs, rows, known, _, _, parameters = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, matrices, _, _, freedoms, composites, gaps = tangent_sections(tangent, links.shape[0], m, nv)
    refresh(links, work, pairs, rows, known, q)
    flow(links, work, v)
    sweep(links, work, parameters[:3], 0.0, freedoms, composites)
    rows_q, rows_v = matrices[nv + 2 * m : nv + 3 * m], matrices[nv + 3 * m : nv + 4 * m]
    differentiate_rows(
        links, work, pairs, freedoms, composites, parameters[:3], gaps, A, A_q, rows_q, rows_v, derivative[:, :nv]
    )


@kernel
def linearise(
    memory: Array, tangent: Array, q: Array, v: Array, extra: Array, h: float, force_noise: Array, F: Array, G: Array
) -> int:
    """Make one step as ``advance`` does, fill its derivatives and return the rank.

    F (2 nv, 2 nv): the new error by the old. G (2 nv, 2 nv): a factor of what white generalized forces of density
    force_noise (nv,) [N sqrt(s), N m sqrt(s)] add over the step: G G^T = integral of B B^T with B = M^-1 force_noise, the
    double integrator's exact second moments.
    """
    links, work, pairs, rows, known, start, spare, _ = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, matrices, stages, scratch, freedoms, _, _ = tangent_sections(tangent, links.shape[0], m, nv)
    vdot, theta, middle = spare[3], spare[4], spare[5]
    theta_rate, theta_sum, v_sum = spare[6], spare[7], spare[8]
    start_x, theta_x, v_x, q_x = stages[0], stages[1], stages[2], stages[3]
    rate_x, theta_sum_x, v_sum_x = stages[4], stages[5], stages[6]
    clear(start_x)
    clear(v_x)
    clear(theta_x)
    clear(theta_sum_x)
    clear(v_sum_x)
    for k in range(nv):
        start_x[k, k] = 1.0
        v_x[k, nv + k] = 1.0
        theta[k], theta_sum[k], v_sum[k] = 0.0, 0.0, 0.0
    copy(q, start)
    copy(v, middle)
    copy(start_x, q_x)
    step = 0.0 if RUNGE_KUTTA else h
    by_q, by_v, M = derivative[:, :nv], derivative[:, nv:], matrices[0:nv]
    A, A_q = matrices[nv : nv + m], matrices[nv + m : nv + 2 * m]
    rank = 0
    for stage in range(4 if RUNGE_KUTTA else 1):
        rank = evaluate(memory, q, middle, extra, step, vdot)
        differentiate(memory, tangent, q, middle, step)
        if stage == 0:
            _force_noise(freedoms, M, force_noise, h, stages[6], G)
            if CONSTRAINED:
                project_columns(memory, A, A_q, G, scratch)
        if RUNGE_KUTTA:
            rate(links, theta, middle, theta_rate)
            rate_derivative(links, theta, middle, theta_x, v_x, rate_x)
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
            clear(rate_x)
            add_product(by_q, q_x, rate_x)
            add_product(by_v, v_x, rate_x)
            accumulate(weight, rate_x, v_sum_x)
            clear(v_x)
            for k in range(nv):
                v_x[k, nv + k] = 1.0
            accumulate(ahead, rate_x, v_x)
            if stage < 3:
                displace(links, start, theta, q)
                displacement_derivative(links, theta, start_x, theta_x, q_x)
        else:
            accumulate(h, derivative, v_sum_x)
            for k in range(nv):
                v_sum[k] = h * vdot[k]
                theta_sum[k] = h * (v[k] + v_sum[k])
                theta_sum_x[k, nv + k] = h
            accumulate(h, v_sum_x, theta_sum_x)
    displace(links, start, theta_sum, q)
    displacement_derivative(links, theta_sum, start_x, theta_sum_x, q_x)
    for k in range(nv):
        v[k] += v_sum[k]
        v_sum_x[k, nv + k] += 1.0
    copy(q_x, F[:nv])
    copy(v_sum_x, F[nv:])
    if CONSTRAINED:
        project(links, work, pairs, rows, known, q, v, spare, POSITION_TOLERANCE)
        tangent_rows(memory, tangent, q, v, A, A_q)
        project_columns(memory, A, A_q, F, scratch)
        project_columns(memory, A, A_q, G, scratch)
    return rank


@kernel
def _force_noise(freedoms: Records, M: Array, force_noise: Array, h: float, columns: Array, G: Array) -> None:
    """Fill G (2 nv, 2 nv) from white generalized forces over h seconds; M is factored, columns (nv, 2 nv) is zero."""
    nv = force_noise.shape[0]
    near, far, late = h * math.sqrt(h / 3.0), 0.5 * math.sqrt(3.0 * h), 0.5 * math.sqrt(h)
    for k in range(nv):
        columns[k, k] = force_noise[k]
    solve_mass(freedoms, M, columns)
    clear(G)
    for k in range(nv):
        for j in range(nv):
            G[k, j] = near * columns[k, j]
            G[nv + k, j] = far * columns[k, j]
            G[nv + k, nv + j] = late * columns[k, j]
    clear(columns)
