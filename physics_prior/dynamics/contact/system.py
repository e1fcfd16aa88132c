"""The system of all rows, equality and inequality, in the space of their impulses: A M^-1 A^T, velocities and responses.

As in constraint.py, unit forces run once through the articulated-body factors, Y and Z = D^-1 Y, so that
A M^-1 A^T = Y Z^T.
"""

from physics_prior.dynamics.algebra import ZERO, add3, cross, dot, get3, get9, minus, minus9, plus, scale
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.articulated_body import pull
from physics_prior.dynamics.constraint_errors import point_velocity
from physics_prior.dynamics.contact.complementarity import BILATERAL, DISC, NORMAL, PARTNER
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import ALL
from physics_prior.dynamics.row_system import row_count, width
from physics_prior.dynamics.types import Array, Record, Records, Vector
from physics_prior.dynamics.unit_forces import push, push_joint, push_wrenches

NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def assemble_contacts(
    links: Records,
    work: Records,
    candidates: Records,
    contacts: Records,
    count: int,
    rows: Array,
    YZ: Array,
    S: Array,
    vectors: Array,
) -> int:
    """Fill Y, Z, S, kinds, owners and bounds of the equality rows and then the contacts'; return the number of rows.

    Needs factors, and with equality rows ``refresh``.
    """
    Y, Z, kinds, owners, bounds = YZ[0], YZ[1], vectors[1], vectors[2], vectors[3]
    m, w = row_count(rows), Y.shape[1]
    own = width(rows)
    for r in range(m):
        for k in range(w):
            Y[r, k] = rows[r, k] if k < own else 0.0
            Z[r, k] = rows[r, own + k] if k < own else 0.0
        kinds[r] = BILATERAL
    for i in range(count):
        contact = contacts[i]
        candidate = candidates[contact.candidate]
        contact.first = m
        kinds[m] = NORMAL
        if candidate.is_limit:
            contact.rows = 1
            clear(Y[m])
            clear(Z[m])
            push_joint(links, work, candidate.link_b, candidate.sign, Y[m : m + 1], Z[m : m + 1])
            m += 1
            continue
        frame, point = get9(contact.frame), get3(contact.point)
        number = 3 if candidate.friction > 0.0 else 1
        for r in range(m, m + number):
            clear(Y[r])
            clear(Z[r])
        y, z = Y[m : m + number], Z[m : m + number]
        push(links, work, candidate.link_b, point, frame, number, False, y, z)
        push(links, work, candidate.link_a, point, minus9(frame), number, False, y, z)
        if number == 3:
            _disc(kinds, owners, bounds, m + 1, m, candidate.friction)
        if candidate.rolling > 0.0:
            r = m + number
            clear(Y[r])
            clear(Z[r])
            clear(Y[r + 1])
            clear(Z[r + 1])
            turn = (frame[3], frame[4], frame[5], frame[6], frame[7], frame[8], 0.0, 0.0, 0.0)
            push_wrenches(links, work, candidate.link_b, turn, NOTHING, 2, False, Y[r : r + 2], Z[r : r + 2])
            push_wrenches(links, work, candidate.link_a, minus9(turn), NOTHING, 2, False, Y[r : r + 2], Z[r : r + 2])
            _disc(kinds, owners, bounds, r, m, candidate.rolling)
            number += 2
        contact.rows = number
        m += number
    for r in range(m):
        one = Y[r]
        for s in range(r + 1):
            other, total = Z[s], 0.0
            for k in range(w):
                total += one[k] * other[k]
            S[r, s] = total
            S[s, r] = total
    return m


@inline_kernel
def _disc(kinds: Array, owners: Array, bounds: Array, r: int, owner: int, bound: float) -> None:
    kinds[r], kinds[r + 1] = DISC, PARTNER
    owners[r], owners[r + 1] = owner, owner
    bounds[r], bounds[r + 1] = bound, bound


@inline_kernel
def slip(work: Records, candidate: Record, point: Vector) -> Vector:
    """Velocity of surface b's material against a's at a world point, m/s."""
    rate = minus(ZERO, get3(candidate.velocity))
    if candidate.link_b >= 0:
        rate = plus(rate, point_velocity(work[candidate.link_b], point))
    if candidate.link_a >= 0:
        rate = minus(rate, point_velocity(work[candidate.link_a], point))
    return rate


@inline_kernel
def relative_turn(work: Records, candidate: Record) -> Vector:
    """Angular velocity of b against a, rad/s."""
    turn = ZERO
    if candidate.link_b >= 0:
        turn = get3(work[candidate.link_b].omega)
    if candidate.link_a >= 0:
        turn = minus(turn, get3(work[candidate.link_a].omega))
    return turn


@kernel
def contact_velocities(
    links: Records, work: Records, candidates: Records, contacts: Records, count: int, v: Array, out: Array
) -> None:
    """Fill out with the velocities of the contacts' rows; needs ``flow`` of v (nv,)."""
    for i in range(count):
        contact = contacts[i]
        candidate = candidates[contact.candidate]
        r = contact.first
        if candidate.is_limit:
            out[r] = candidate.sign * v[links[candidate.link_b].v]
            continue
        frame = get9(contact.frame)
        n, s, t = (frame[0], frame[1], frame[2]), (frame[3], frame[4], frame[5]), (frame[6], frame[7], frame[8])
        rate = slip(work, candidate, get3(contact.point))
        out[r] = dot(n, rate)
        r += 1
        if candidate.friction > 0.0:
            out[r], out[r + 1] = dot(s, rate), dot(t, rate)
            r += 2
        if candidate.rolling > 0.0:
            turn = relative_turn(work, candidate)
            out[r], out[r + 1] = dot(s, turn), dot(t, turn)


@kernel
def respond_to(links: Records, work: Records, Z: Array, impulses: Array, m: int, z: Array, change: Array) -> None:
    """Fill change (nv,) = M^-1 A^T impulses (m,), and the links' increments. z (nv,) is scratch."""
    clear(z)
    for r in range(m):
        known = impulses[r]
        if known != 0.0:
            for k in range(Z.shape[1]):
                z[k] += Z[r, k] * known
    pull(links, work, z, ALL, change)


@kernel
def store_forces(candidates: Records, contacts: Records, count: int, impulses: Array, h: float) -> None:
    """Fill the candidates' forces and moments, means over h seconds, each about the middle of its normal force."""
    for i in range(candidates.shape[0]):
        candidate = candidates[i]
        for k in range(3):
            candidate.force[k], candidate.moment[k], candidate.point[k] = 0.0, 0.0, 0.0
        weight = 0.0
        for c in range(count):
            contact = contacts[c]
            if contact.candidate == i:
                share = impulses[contact.first]
                add3(candidate.point, scale(share, get3(contact.point)))
                weight += share
        if weight > 0.0:
            for k in range(3):
                candidate.point[k] /= weight
        for c in range(count):
            contact = contacts[c]
            if contact.candidate == i:
                _add_force(candidate, contact, impulses, 1.0 / h)


@inline_kernel
def _add_force(candidate: Record, contact: Record, impulses: Array, rate: float) -> None:
    r = contact.first
    if candidate.is_limit:
        candidate.force[0] += rate * candidate.sign * impulses[r]
        return
    frame = get9(contact.frame)
    n, s, t = (frame[0], frame[1], frame[2]), (frame[3], frame[4], frame[5]), (frame[6], frame[7], frame[8])
    force = scale(rate * impulses[r], n)
    r += 1
    if candidate.friction > 0.0:
        force = plus(force, plus(scale(rate * impulses[r], s), scale(rate * impulses[r + 1], t)))
        r += 2
    add3(candidate.force, force)
    add3(candidate.moment, cross(minus(get3(contact.point), get3(candidate.point)), force))
    if candidate.rolling > 0.0:
        add3(candidate.moment, plus(scale(rate * impulses[r], s), scale(rate * impulses[r + 1], t)))
