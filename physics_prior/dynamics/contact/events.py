"""The step of a scene with contact or limits: smooth motion until something touches, an impact, contact from there on.

Part of the composed step, between the integrator and step.py. Where nothing touches and nothing is reached within the step, it is
the integrator's own, of its own order. Where something is reached at speed the time of impact is found, and the motion goes on
from the impact: at most one in a step. What touches is stepped at velocity level, semi-implicitly (order one).
"""

from physics_prior.dynamics.anchor_motion import move_anchors
from physics_prior.dynamics.arrays import clear, copy
from physics_prior.dynamics.contact.detect import TOUCHING, look
from physics_prior.dynamics.contact.impulse import impact, push_out, resolve, urgency
from physics_prior.dynamics.contact.memory import contact_sections
from physics_prior.dynamics.integrators.rk4 import linearise_smooth, smooth_step
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import pose
from physics_prior.dynamics.manifold import difference, displace
from physics_prior.dynamics.memory import TIME, sections
from physics_prior.dynamics.motion import differentiate, evaluate, settle, spread_noise
from physics_prior.dynamics.types import Array

SEARCHES = 60  # for a time of impact
DIFFERENCE = 1e-6  # rad, m or their rates: half the width of central differences across events
EXACT = 1e-13  # m or rad: gap at the time of impact


@kernel
def contact_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Move q (nq,) and v (nv,) in place by h seconds, everything within reach being a contact; return the rank."""
    links, work, pairs, _, _, _, spare, parameters = sections(memory)
    vdot, theta = spare[3], spare[4]
    rank = evaluate(memory, q, v, extra, h, vdot)
    for k in range(v.shape[0]):
        v[k] += h * vdot[k]
    memory[TIME] += h
    move_anchors(work, pairs, parameters, memory[TIME])
    resolve(memory, q, v, h, False)
    for k in range(v.shape[0]):
        theta[k] = h * v[k]
    displace(links, q, theta, q)
    settle(memory, q, v)
    push_out(memory, q)
    return rank


@kernel
def event_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Move q (nq,), v (nv,) and the time in place by h seconds, through at most one impact; return the rank.

    Negative as of ``advance``.
    """
    _, work, _, _, _, _, _, _ = sections(memory)
    candidates, _, points, _, _, _, states = contact_sections(memory)
    q_start, v_start = states[0], states[1, : v.shape[0]]
    left, bounced, rank = h, False, 0
    while left > 0.0:
        holding, soon = urgency(memory, q, v, left)
        if not holding:
            copy(q, q_start)
            copy(v, v_start)
            time = memory[TIME]
            look(work, candidates, points, q)
            for i in range(candidates.shape[0]):
                candidates[i].coming = candidates[i].gap > TOUCHING
                candidates[i].before = candidates[i].gap
            rank = smooth_step(memory, q, v, extra, left)
            pose(sections(memory)[0], work, q)
            if rank < 0 or look(work, candidates, points, q) >= -TOUCHING:
                return rank
            meets = False
            for i in range(candidates.shape[0]):
                candidate = candidates[i]
                fast = candidate.before - candidate.gap > candidate.quiet * left
                candidate.coming = candidate.coming and candidate.gap < -TOUCHING and fast
                meets = meets or candidate.coming
            copy(q_start, q)
            copy(v_start, v)
            memory[TIME] = time
            if meets and not bounced:
                tau = meet(memory, q, v, extra, left)
                impact(memory, q, v)
                left, bounced = left - tau, True
                continue
        elif soon < left and not bounced:
            if soon > 0.0:
                rank = contact_step(memory, q, v, extra, soon)
            impact(memory, q, v)
            left, bounced = left - soon, True
            continue
        return contact_step(memory, q, v, extra, left)
    return rank


@kernel
def meet(memory: Array, q: Array, v: Array, extra: Array, h: float) -> float:
    """Move q and v in place until the first of the candidates that are coming touches; return when, s.

    By the Illinois variant of the rule of false position, on smooth motion of h seconds at the end of which they overlap.
    """
    _, work, _, _, _, _, _, _ = sections(memory)
    candidates, _, points, _, _, _, states = contact_sections(memory)
    q_start, v_start, time = states[0], states[1, : v.shape[0]], memory[TIME]
    early, late, before, after = 0.0, h, 1e300, 1e300
    for i in range(candidates.shape[0]):
        if candidates[i].coming:
            before, after = min(before, candidates[i].before), min(after, candidates[i].gap)
    tau = h
    for _ in range(SEARCHES):
        tau = (before * late - after * early) / (before - after)
        copy(q_start, q)
        copy(v_start, v)
        memory[TIME] = time
        smooth_step(memory, q, v, extra, tau)
        pose(sections(memory)[0], work, q)
        look(work, candidates, points, q)
        gap = 1e300
        for i in range(candidates.shape[0]):
            if candidates[i].coming:
                gap = min(gap, candidates[i].gap)
        if abs(gap) <= EXACT or late - early <= 1e-15 * h:
            break
        if gap > 0.0:
            early, before, after = tau, gap, 0.5 * after
        else:
            late, after, before = tau, gap, 0.5 * before
    return tau


@kernel
def linearise_events(
    memory: Array, tangent: Array, q: Array, v: Array, extra: Array, h: float, force_noise: Array, F: Array, G: Array
) -> int:
    """Do as ``linearise_smooth`` does, through contacts and impacts.

    Across events F is central differences of the step, whose time of impact moves with the state: so it is the saltation
    matrix (Aizerman and Gantmacher 1958) times the smooth motion about it, and no error is left into what holds.
    """
    links, work, _, _, _, _, spare, _ = sections(memory)
    candidates, _, points, _, _, _, states = contact_sections(memory)
    nv = v.shape[0]
    q_first, v_first = states[2], states[3, :nv]
    time = memory[TIME]
    copy(q, q_first)
    copy(v, v_first)
    holding, _ = urgency(memory, q, v, h)
    if not holding:
        rank = linearise_smooth(memory, tangent, q, v, extra, h, force_noise, F, G)
        pose(links, work, q)
        if rank < 0 or look(work, candidates, points, q) >= -TOUCHING:
            return rank
        copy(q_first, q)
        copy(v_first, v)
        memory[TIME] = time
    evaluate(memory, q, v, extra, h, spare[3])
    differentiate(memory, tangent, q, v, h)
    spread_noise(memory, tangent, force_noise, h, G)
    rank = event_step(memory, q, v, extra, h)
    copy(q, states[4])
    copy(v, states[5, :nv])
    end = memory[TIME]
    delta = states[8, :nv]
    for k in range(2 * nv):
        for side in range(2):
            width = DIFFERENCE if side == 0 else -DIFFERENCE
            clear(delta)
            copy(q_first, states[6])
            copy(v_first, states[7, :nv])
            if k < nv:
                delta[k] = width
                displace(links, q_first, delta, states[6])
            else:
                states[7, k - nv] += width
            memory[TIME] = time
            event_step(memory, states[6], states[7, :nv], extra, h)
            _difference_column(memory, nv, 0.5 / width, F, k, side == 0)
    # white force noise over the step is an impulse at its beginning: below on the right, G holds half of M^-1 times that
    for k in range(nv):
        for j in range(nv):
            states[10, j] = 2.0 * G[nv + j, nv + k]
        for i in range(2 * nv):
            total = 0.0
            for j in range(nv):
                total += F[i, nv + j] * states[10, j]
            G[i, k] = total
            G[i, nv + k] = 0.0
    memory[TIME] = end
    return rank


@kernel
def _difference_column(memory: Array, nv: int, weight: float, out: Array, k: int, first: bool) -> None:
    """Add to a column (or begin it) how a varied end of the step stands from the end of the unvaried one."""
    links, _, _, _, _, _, _, _ = sections(memory)
    _, _, _, _, _, _, states = contact_sections(memory)
    delta = states[8, :nv]
    difference(links, states[4], states[6], delta)
    for i in range(nv):
        if first:
            out[i, k], out[nv + i, k] = 0.0, 0.0
        out[i, k] += weight * delta[i]
        out[nv + i, k] += weight * (states[7, i] - states[5, i])
