"""The equation of motion of a scene, compiled: evaluate, differentiate, project.

This file is that of a scene without force effects and without constraints. For any other scene the composer
(dynamics/compose.py) copies it into the scene's step with the lines marked ``scene`` replaced, so that it holds the
effects that the scene names and nothing else. ``memory`` is that of memory.py.
"""

import math

from physics_prior.dynamics.anchor_motion import move_anchors
from physics_prior.dynamics.arrays import clear, copy
from physics_prior.dynamics.articulated_body import accelerate, factorize
from physics_prior.dynamics.constraint import POSITION_TOLERANCE, UNMET, accelerate_constrained, refresh, responses
from physics_prior.dynamics.constraint_derivatives import differentiate_rows
from physics_prior.dynamics.derivatives import inverse_dynamics_derivatives, sweep
from physics_prior.dynamics.gyroscopic import take_at_middle
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import flow, pose, weigh
from physics_prior.dynamics.manifold import displace
from physics_prior.dynamics.mass_factor import factorize_mass, solve_mass
from physics_prior.dynamics.memory import OPEN, SPARE, TIME, correction_sections, tangent_sections
from physics_prior.dynamics.memory import sections as sections  # scene: links
from physics_prior.dynamics.products import add_product, subtract_transposed_product
from physics_prior.dynamics.projection import project
from physics_prior.dynamics.reactions import tell_wrenches
from physics_prior.dynamics.row_system import multiply_columns, row_count
from physics_prior.dynamics.types import Array
from physics_prior.effects.none import differentiate_forces, forces, potential_energy  # scene: effects

CONSTRAINED = False  # scene: constraints
MIDDLE = False  # scene: gyroscopic torques
BESIDE, CLEAR = 3e-4, 3e-3  # rad or m that the fastest freedom moves to either side of a fold, and to be clear of it


@kernel
def evaluate(memory: Array, q: Array, v: Array, extra: Array, step: float, vdot: Array) -> int:
    """Fill vdot (nv,) at q and v under the effects and extra generalized forces (nv,); return the constraints' rank.

    step > 0 takes gyroscopic torques at the middle of such a step where the integrator does (MIDDLE).
    """
    rank, unmet = evaluate_at(memory, q, v, extra, step, vdot)
    if CONSTRAINED and unmet > UNMET:
        rank = evaluate_beside(memory, q, v, extra, step, vdot, rank)
    return rank


@kernel
def evaluate_at(memory: Array, q: Array, v: Array, extra: Array, step: float, vdot: Array) -> tuple[int, float]:
    """``evaluate``, where nothing folds; return, too, what is unmet of the constraints, relative."""
    links, work, pairs, rows, known, _, spare, parameters = sections(memory)
    gravity, tau = parameters[:3], spare[2]
    rank, unmet = 0, 0.0
    if CONSTRAINED:
        move_anchors(work, pairs, parameters, memory[TIME])
        rank = refresh(links, work, pairs, rows, known, q)
    else:
        pose(links, work, q)
        weigh(links, work)
        factorize(links, work)
    flow(links, work, v)
    if MIDDLE and step > 0.0:
        take_at_middle(links, work, step)
    copy(extra, tau)
    forces(parameters, links, work, q, v, tau)
    if CONSTRAINED:
        unmet = accelerate_constrained(links, work, pairs, rows, tau, gravity, vdot, spare[0])
    else:
        accelerate(links, work, tau, gravity, vdot)
    return rank, unmet


@kernel
def evaluate_beside(memory: Array, q: Array, v: Array, extra: Array, step: float, vdot: Array, rank: int) -> int:
    """Where the mechanism folds: the mean of the motion a little ahead and a little behind; vdot + O(BESIDE^2).

    At a dead centre rows lose the rank that they have beside it, and the motion that they let go would take its free
    acceleration; on either side the forces that hold it grow like one over the distance, with opposite signs. The mechanism
    crosses by their principal value. Forces are those of the side it comes from. Where the rank is the same beside, rows
    are redundant and merely contradict each other in a stage of a step: vdot stays.
    """
    links, work, pairs, rows, known, _, spare, _ = sections(memory)
    nq, nv, time = q.shape[0], v.shape[0], memory[TIME]
    delta, ahead, side = spare[SPARE - 4], spare[SPARE - 3], spare[SPARE - 2 : SPARE].reshape(-1)[:nq]
    fastest = 0.0
    for k in range(nv):
        fastest = max(fastest, abs(v[k]))
    if fastest == 0.0:
        return rank
    for k in range(nv):
        delta[k] = CLEAR / fastest * v[k]
    displace(links, q, delta, side)
    if refresh(links, work, pairs, rows, known, side) <= rank:
        return refresh(links, work, pairs, rows, known, q)
    tau = BESIDE / fastest
    for k in range(nv):
        delta[k] = tau * v[k]
    displace(links, q, delta, side)
    memory[TIME] = time + tau
    evaluate_at(memory, side, v, extra, step, ahead)
    for k in range(nv):
        delta[k] = -delta[k]
    displace(links, q, delta, side)
    memory[TIME] = time - tau
    rank, _ = evaluate_at(memory, side, v, extra, step, vdot)
    memory[TIME] = time
    for k in range(nv):
        vdot[k] = 0.5 * (vdot[k] + ahead[k])
    return rank


@kernel
def differentiate(memory: Array, tangent: Array, q: Array, v: Array, step: float) -> None:
    """Fill the tangent's derivative (nv, 2 nv): of vdot by the tangent of q, and beside it by v.

    Needs ``evaluate`` at the same state.
    """
    links, work, pairs, rows, _, _, spare, parameters = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, matrices, scratch, freedoms, composites, gaps, _ = tangent_sections(tangent, links.shape[0], m, nv)
    gravity, L, tau_q, tau_v = parameters[:3], matrices[0:nv], derivative[:, :nv], derivative[:, nv:]
    clear(derivative)
    sweep(links, work, gravity, step, freedoms, composites)
    factorize_mass(links, work, freedoms)
    inverse_dynamics_derivatives(links, freedoms, composites, tau_q, tau_v, L)
    A, A_q = matrices[nv : nv + m], matrices[nv + m : nv + 2 * m]
    rows_q, rows_v = matrices[nv + 2 * m : nv + 3 * m], matrices[nv + 3 * m : nv + 4 * m]
    if CONSTRAINED:
        differentiate_rows(links, work, pairs, freedoms, composites, gravity, gaps, A, A_q, rows_q, rows_v, tau_q)
    differentiate_forces(parameters, links, work, freedoms, composites, q, v, tau_q, tau_v)
    solve_mass(freedoms, L, derivative)
    if CONSTRAINED:
        response, right, answer, change = correction_sections(scratch, m, nv, 2 * nv)
        responses(links, work, pairs, rows, spare[0], response)
        clear(right)
        add_product(A, 0, derivative, right)
        for r in range(m):
            for j in range(nv):
                right[r, j] += rows_q[r, j]
                right[r, nv + j] += rows_v[r, j]
        multiply_columns(rows, right, answer, change)
        subtract_transposed_product(response, answer, derivative)


@kernel
def potential(memory: Array, q: Array) -> float:
    """Return the potential energy of the effects at q, J; poses are up to date."""
    links, work, _, _, _, _, _, parameters = sections(memory)
    return potential_energy(parameters, links, work, q)


@kernel
def differentiate_acceleration(memory: Array, tangent: Array, q: Array, v: Array, extra: Array) -> int:
    """Fill the tangent's derivative of ``evaluate`` at q, v and extra, gyroscopic torques explicit; return the rank."""
    rank = evaluate(memory, q, v, extra, 0.0, sections(memory)[6][3])
    differentiate(memory, tangent, q, v, 0.0)
    return rank


@kernel
def project_columns(memory: Array, A: Array, A_q: Array, columns: Array, scratch: Array, as_caught: bool) -> None:
    """Put the columns (2 nv, k) of errors of q and v onto the constraints' tangent space, in the mass metric.

    A dq = 0 and A dv + d(A v)/dq dq = 0: the covariance then has no mass in forbidden directions. With as_caught, errors
    keep their A dq in pairs that took hold where the part was: their anchor is as far off as the state was then. Needs
    ``refresh``, and scratch of ``correction_size``.
    """
    links, work, pairs, rows, _, _, spare, _ = sections(memory)
    m, nv = A.shape
    by_q, by_v = columns[:nv], columns[nv:]
    response, right, answer, change = correction_sections(scratch, m, nv, columns.shape[1])
    responses(links, work, pairs, rows, spare[0], response)
    clear(right)
    add_product(A, 0, by_q, right)
    if as_caught:
        for p in range(pairs.shape[0]):
            if pairs[p].here:
                for r in range(pairs[p].first, pairs[p].first + pairs[p].rows):
                    right[r, :] = 0.0
    multiply_columns(rows, right, answer, change)
    subtract_transposed_product(response, answer, by_q)
    clear(right)
    add_product(A, 0, by_v, right)
    add_product(A_q, 0, by_q, right)
    multiply_columns(rows, right, answer, change)
    subtract_transposed_product(response, answer, by_v)


@kernel
def tangent_rows(memory: Array, tangent: Array, q: Array, v: Array, A: Array, A_q: Array) -> None:
    """Fill A (m, nv) and A_q (m, nv), the constraint Jacobian and the derivative of A v by q, at q and v."""
    links, work, pairs, rows, known, _, _, parameters = sections(memory)
    m, nv = row_count(rows), v.shape[0]
    derivative, matrices, _, freedoms, composites, gaps, _ = tangent_sections(tangent, links.shape[0], m, nv)
    move_anchors(work, pairs, parameters, memory[TIME])
    refresh(links, work, pairs, rows, known, q)
    flow(links, work, v)
    sweep(links, work, parameters[:3], 0.0, freedoms, composites)
    rows_q, rows_v = matrices[nv + 2 * m : nv + 3 * m], matrices[nv + 3 * m : nv + 4 * m]
    differentiate_rows(
        links, work, pairs, freedoms, composites, parameters[:3], gaps, A, A_q, rows_q, rows_v, derivative[:, :nv]
    )


@kernel
def settle(memory: Array, q: Array, v: Array) -> None:
    """Put q (nq,) and v (nv,) back onto the constraints, as every step ends; needs ``evaluate`` near q."""
    links, work, pairs, rows, known, _, spare, parameters = sections(memory)
    if CONSTRAINED:
        move_anchors(work, pairs, parameters, memory[TIME])
        memory[OPEN] = project(links, work, pairs, rows, known, q, v, spare, POSITION_TOLERANCE)


@kernel
def settle_columns(memory: Array, tangent: Array, q: Array, v: Array, F: Array, G: Array) -> None:
    """Put the columns of F and G (2 nv, 2 nv) onto the constraints' tangent space at q and v, after ``settle``."""
    links, _, _, rows, _, _, _, _ = sections(memory)
    if CONSTRAINED:
        m, nv = row_count(rows), v.shape[0]
        _, matrices, scratch, _, _, _, _ = tangent_sections(tangent, links.shape[0], m, nv)
        A, A_q = matrices[nv : nv + m], matrices[nv + m : nv + 2 * m]
        tangent_rows(memory, tangent, q, v, A, A_q)
        project_columns(memory, A, A_q, F, scratch, True)
        project_columns(memory, A, A_q, G, scratch, False)


@kernel
def spread_noise(memory: Array, tangent: Array, force_noise: Array, h: float, G: Array) -> None:
    """Fill G (2 nv, 2 nv) from white generalized forces over a step of h seconds; needs ``differentiate`` at its beginning.

    Columns of force_noise (nv, nv) are independent ones. G G^T = integral of B B^T with B = M^-1 force_noise: the double
    integrator's exact second moments.
    """
    links, _, _, rows, _, _, _, _ = sections(memory)
    m, nv = row_count(rows), force_noise.shape[0]
    _, matrices, scratch, freedoms, _, _, stages = tangent_sections(tangent, links.shape[0], m, nv)
    columns, L = stages[0].reshape(-1)[: nv * nv].reshape(nv, nv), matrices[0:nv]
    near, far, late = h * math.sqrt(h / 3.0), 0.5 * math.sqrt(3.0 * h), 0.5 * math.sqrt(h)
    copy(force_noise, columns)
    solve_mass(freedoms, L, columns)
    clear(G)
    for k in range(nv):
        for j in range(nv):
            G[k, j] = near * columns[k, j]
            G[nv + k, j] = far * columns[k, j]
            G[nv + k, nv + j] = late * columns[k, j]
    if CONSTRAINED:
        project_columns(memory, matrices[nv : nv + m], matrices[nv + m : nv + 2 * m], G, scratch, False)


@kernel
def spread_wrenches(
    memory: Array,
    q: Array,
    v: Array,
    errors: Array,
    share: float,
    places: Array,
    firsts: Array,
    pair: Array,
    total: Array,
    scratch: Array,
) -> None:
    """Add to total (., 6) the squares of what errors (k, n) of a state do to its wrenches: differences, a share to either side.

    n: the tangent of q, v, and the nf parameters at places. pair (2, ., 6) is scratch, its wrenches those of ``tell_wrenches``,
    and scratch (4 nv + nf + nq,), zero at the beginning.
    """
    links, work, pairs, _, _, _, _, parameters = sections(memory)
    nv, nf = v.shape[0], places.shape[0]
    delta, rate, still, vdot = scratch[:nv], scratch[nv : 2 * nv], scratch[2 * nv : 3 * nv], scratch[3 * nv : 4 * nv]
    force, moved = scratch[4 * nv : 4 * nv + nf], scratch[4 * nv + nf :]
    for j in range(nf):
        force[j] = parameters[places[j]]
    for k in range(errors.shape[0]):
        own, any_error = errors[k], False
        for j in range(own.shape[0]):
            any_error = any_error or own[j] != 0.0
        if not any_error:
            continue
        for side in range(2):
            s = share if side == 0 else -share
            for j in range(nv):
                delta[j], rate[j] = s * own[j], v[j] + s * own[nv + j]
            displace(links, q, delta, moved)
            for j in range(nf):
                parameters[places[j]] = force[j] + s * own[2 * nv + j]
            evaluate(memory, moved, rate, still, 0.0, vdot)
            tell_wrenches(links, work, pairs, firsts, pair[side])
        for row in range(pair.shape[1]):
            for e in range(6):
                slope = (pair[0, row, e] - pair[1, row, e]) / (2.0 * share)
                total[row, e] += slope * slope
    for j in range(nf):
        parameters[places[j]] = force[j]
