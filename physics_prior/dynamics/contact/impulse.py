"""Impulses of contacts: the velocities after a step or an impact, and positions out of each other (design eq. 8).

Rows are at velocity level: within a step of h the gap of a contact may close but not become negative, u + gap / h >= 0, so
nothing penetrates and no spring is needed (Moreau 1988; Stewart and Trinkle 1996). An impact reverses the velocity of approach by
the restitution (Newton's law), less where together with friction that would create energy.
"""

import math

from physics_prior.dynamics.algebra import add3, cross, get3, minus, plus, scale
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.articulated_body import factorize
from physics_prior.dynamics.constraint import refresh
from physics_prior.dynamics.constraint_errors import direction, position_error, velocity_error
from physics_prior.dynamics.contact.complementarity import DISC, complement
from physics_prior.dynamics.contact.detect import TOUCHING, collect, look
from physics_prior.dynamics.contact.memory import contact_sections, remember, remembered
from physics_prior.dynamics.contact.system import (
    assemble_contacts,
    contact_velocities,
    respond_to,
    store_forces,
)
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import flow, pose, weigh
from physics_prior.dynamics.manifold import displace
from physics_prior.dynamics.memory import sections
from physics_prior.dynamics.row_system import row_count
from physics_prior.dynamics.types import Array, Records, Vector

OUT = 1e-10  # m or rad: penetration that is left
PASSES = 5  # of pushing out


@kernel
def prepare(memory: Array, q: Array) -> None:
    """Have poses, inertias and factors of q (nq,) in the workspace, and rows of equality constraints where there are."""
    links, work, pairs, rows, known, _, _, _ = sections(memory)
    if row_count(rows) > 0:
        refresh(links, work, pairs, rows, known, q)
    else:
        pose(links, work, q)
        weigh(links, work)
        factorize(links, work)


@kernel
def resolve(memory: Array, q: Array, v: Array, h: float, bounce: bool) -> None:
    """Change v (nv,) in place to what contacts admit.

    h > 0: v is the free velocity at the end of a step of h. h = 0: v meets those that touch, and with ``bounce`` those that
    approach faster than their quiet speed leave by their restitution. Needs ``prepare``. The impulses and the
    residual of the complementarity problem stay in the memory.
    """
    links, work, pairs, rows, _, _, spare, _ = sections(memory)
    candidates, contacts, points, YZ, SG, vectors, _ = contact_sections(memory)
    S, G, bias, impulses, u = SG[0], SG[1], vectors[0], vectors[4], vectors[8]
    flow(links, work, v)
    count = collect(work, candidates, contacts, points, q, v, links, h)
    m = assemble_contacts(links, work, candidates, contacts, count, rows, YZ, S, vectors) if count > 0 else 0
    remember(memory, count, m, 0.0)
    if count == 0:
        return
    equalities = row_count(rows)
    velocity_error(work, pairs, u)
    for r in range(equalities):
        u[r] = -u[r]
    contact_velocities(links, work, candidates, contacts, count, v, u)
    for r in range(m):
        bias[r] = u[r]
        impulses[r] = 0.0
    rebounds = False
    for i in range(count):
        contact = contacts[i]
        candidate = candidates[contact.candidate]
        contact.approach = u[contact.first]
        if h > 0.0:
            bias[contact.first] += max(contact.gap, 0.0) / h
        elif bounce and contact.approach < -candidate.quiet and candidate.restitution > 0.0:
            rebounds = True
    error = complement(S, bias, vectors[1], vectors[2], vectors[3], impulses, m, G, vectors[5:8])
    if rebounds:
        for i in range(count):
            contact = contacts[i]
            candidate = candidates[contact.candidate]
            if contact.approach < -candidate.quiet:
                bias[contact.first] += candidate.restitution * contact.approach
        error = max(error, rebound(S, vectors, m, G))
    respond_to(links, work, YZ[1], impulses, m, spare[0], spare[1])
    for k in range(v.shape[0]):
        v[k] += spare[1, k]
    remember(memory, count, m, error)


@kernel
def rebound(S: Array, vectors: Array, m: int, G: Array) -> float:
    """Replace impulses without restitution by those with it, as far as no energy is created; return the residual.

    An impulse p adds p (u + S p / 2) to the kinetic energy. Admissible impulses are convex: what lies between is one too.
    """
    u, impulses, plain = vectors[8], vectors[4], vectors[9]
    for r in range(m):
        plain[r] = impulses[r]
    error = complement(S, vectors[0], vectors[1], vectors[2], vectors[3], impulses, m, G, vectors[5:8])
    start, slope, curve = 0.0, 0.0, 0.0
    for r in range(m):
        change = impulses[r] - plain[r]
        bent, stopped = 0.0, 0.0
        for s in range(m):
            stopped += S[r, s] * plain[s]
            bent += S[r, s] * (impulses[s] - plain[s])
        start += plain[r] * (u[r] + 0.5 * stopped)
        slope += change * (u[r] + stopped)
        curve += change * bent
    if start + slope + 0.5 * curve > 0.0 and curve > 0.0:
        share = (math.sqrt(max(slope * slope - 2.0 * curve * min(start, 0.0), 0.0)) - slope) / curve
        share = min(1.0, max(0.0, share))
        for r in range(m):
            impulses[r] = plain[r] + share * (impulses[r] - plain[r])
    return error


@kernel
def push_out(memory: Array, q: Array) -> float:
    """Move q (nq,) in the mass metric until nothing penetrates; return the least gap. Velocities are left alone."""
    links, work, pairs, rows, _, _, spare, _ = sections(memory)
    candidates, contacts, points, YZ, SG, vectors, _ = contact_sections(memory)
    S, G, bias, kinds, bounds, impulses = SG[0], SG[1], vectors[0], vectors[1], vectors[3], vectors[4]
    least = 0.0
    for _ in range(PASSES):
        pose(links, work, q)
        least = look(work, candidates, points, q)
        if least >= -OUT:
            break
        prepare(memory, q)
        clear(spare[1])
        flow(links, work, spare[1])
        count = collect(work, candidates, contacts, points, q, spare[1], links, 0.0)
        m = assemble_contacts(links, work, candidates, contacts, count, rows, YZ, S, vectors)
        position_error(pairs, bias)
        for r in range(m):
            bias[r] = -bias[r] if r < row_count(rows) else 0.0
            impulses[r] = 0.0
            if kinds[r] == DISC:
                bounds[r] = 0.0
        for i in range(count):
            bias[contacts[i].first] = contacts[i].gap
        complement(S, bias, kinds, vectors[2], bounds, impulses, m, G, vectors[5:8])
        respond_to(links, work, YZ[1], impulses, m, spare[0], spare[1])
        displace(links, q, spare[1], q)
    return least


@kernel
def urgency(memory: Array, q: Array, v: Array, h: float) -> tuple[bool, float]:
    """Whether anything touches and does not part at q and v, and how soon, s, something else will that may bounce."""
    links, work, _, _, _, _, _, _ = sections(memory)
    candidates, contacts, points, _, _, vectors, _ = contact_sections(memory)
    pose(links, work, q)
    weigh(links, work)
    flow(links, work, v)
    count = collect(work, candidates, contacts, points, q, v, links, h)
    r = 0
    for i in range(count):
        contacts[i].first = r
        candidate = candidates[contacts[i].candidate]
        r += 1 + 2 * int(candidate.friction > 0.0) + 2 * int(candidate.rolling > 0.0)
    u = vectors[8]
    contact_velocities(links, work, candidates, contacts, count, v, u)
    holding, soon = False, math.inf
    for i in range(count):
        contact = contacts[i]
        approach = -u[contact.first]
        if contact.gap <= TOUCHING and approach >= -TOUCHING:
            holding = True
        if approach > candidates[contact.candidate].quiet:
            soon = min(soon, max(contact.gap, 0.0) / approach if contact.gap > TOUCHING else 0.0)
    return holding, soon


@kernel
def impact(memory: Array, q: Array, v: Array) -> None:
    """Change v (nv,) in place by the impact of all that touch at q (nq,)."""
    prepare(memory, q)
    resolve(memory, q, v, 0.0, True)
    if stray(memory, v):
        resolve(memory, q, v, 0.0, False)


@kernel
def stray(memory: Array, v: Array) -> bool:
    """Add to v (nv,) what the impacts that ``resolve`` left do beside their law; return whether they do anything."""
    links, work, _, _, _, _, spare, _ = sections(memory)
    candidates, contacts, _, YZ, _, vectors, _ = contact_sections(memory)
    count, m = remembered(memory)
    impulses, beside, strays = vectors[4], vectors[9], False
    for r in range(m):
        beside[r] = 0.0
    for i in range(count):
        contact = contacts[i]
        candidate = candidates[contact.candidate]
        for k in range(3 if candidate.friction > 0.0 else 1):
            share = candidate.astray[k]
            beside[contact.first + k] = share * impulses[contact.first]
            strays = strays or share != 0.0
    if strays:
        respond_to(links, work, YZ[1], beside, m, spare[0], spare[1])
        for k in range(v.shape[0]):
            v[k] += spare[1, k]
    return strays


@kernel
def load_contacts(memory: Array, h: float) -> None:
    """Add the impulses that ``resolve`` left, over h seconds, to the links' accelerations and loads, and store the forces.

    For ``transmit``; needs ``evaluate`` at the state after ``resolve``. The change of vdot stands in the second spare vector.
    """
    links, work, pairs, _, _, _, spare, _ = sections(memory)
    candidates, contacts, _, YZ, _, vectors, _ = contact_sections(memory)
    count, m = remembered(memory)
    respond_to(links, work, YZ[1], vectors[4], m, spare[0], spare[1])
    for i in range(links.shape[0]):
        here = work[i]
        add3(here.alpha, scale(1.0 / h, get3(here.delta_alpha)))
        add3(here.acceleration, scale(1.0 / h, get3(here.delta_acceleration)))
    store_forces(candidates, contacts, count, vectors[4], h)
    for p in range(pairs.shape[0] if m > 0 else 0):
        # what contact adds to the forces of equality rows
        pair = pairs[p]
        for row in range(pair.rows):
            add3(pair.force, scale(vectors[4, pair.first + row] / h, direction(pair, row)))
    for i in range(candidates.shape[0]):
        candidate = candidates[i]
        if not candidate.is_limit:
            force, moment, point = get3(candidate.force), get3(candidate.moment), get3(candidate.point)
            _load(work, candidate.link_b, 1.0, force, moment, point)
            _load(work, candidate.link_a, -1.0, force, moment, point)


@inline_kernel
def _load(work: Records, link: int, sign: float, force: Vector, moment: Vector, point: Vector) -> None:
    if link >= 0:
        on = work[link]
        add3(on.force, scale(sign, force))
        add3(on.moment, scale(sign, plus(moment, cross(minus(point, get3(on.origin)), force))))
