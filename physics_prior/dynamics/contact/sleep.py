"""Sleep: islands at rest are asked for contact no more, and stand still, until something touches or pushes them.

Part of the composed step, after events.py, of scenes that say so. An island is what holds or touches each other, the world
apart: it falls asleep once all of it has been slower than a tolerance for a while, and lies at rest exactly. It wakes when its
state is changed from outside, when its acceleration (contact apart) changes by more than would take it to that tolerance in that
while, or before anything awake can reach it. Skipped are its detection, rows and impulses of contact; the step altogether
where all is asleep.
The answer differs from that without sleep by less than the tolerance times the time asleep.
"""

import math

from physics_prior.dynamics.arrays import copy
from physics_prior.dynamics.contact.detect import TOUCHING, find_points, sweep_reach
from physics_prior.dynamics.contact.events import event_step
from physics_prior.dynamics.contact.memory import KEPT, PUSHED, QUIET, RESTED, contact_sections, sleep_settings
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.memory import TIME, sections
from physics_prior.dynamics.motion import evaluate
from physics_prior.dynamics.types import Array

ASLEEP = math.inf  # how long what sleeps has rested


@kernel
def sleeping_step(memory: Array, q: Array, v: Array, extra: Array, h: float) -> int:
    """Do as ``event_step`` does, with what is awake; return the rank, negative as of ``advance``."""
    links, _, _, _, _, _, spare, _ = sections(memory)
    candidates, _, _, _, _, _, states = contact_sections(memory)
    kept, rested = states[KEPT], states[RESTED]
    rank = evaluate(memory, q, v, extra, 0.0, spare[3])
    wake(memory, q, v, spare[3], h)
    separate(memory, spare[3], h)
    awake = lay_down(memory, q, v, spare[3])
    if awake == 0:
        memory[TIME] += h
        return rank
    for i in range(candidates.shape[0]):
        a, b = candidates[i].link_a, candidates[i].link_b
        candidates[i].asleep = (a < 0 or rested[a] == ASLEEP) and (b < 0 or rested[b] == ASLEEP)
    rank = event_step(memory, q, v, extra, h)
    for i in range(candidates.shape[0]):
        candidates[i].asleep = 0
    for i in range(links.shape[0]):
        if rested[i] == ASLEEP:
            q_end, v_end = ends(memory, i)
            for k in range(links[i].q, q_end):
                q[k] = kept[k]
            for k in range(links[i].v, v_end):
                v[k] = 0.0
    return rank


@kernel
def ends(memory: Array, i: int) -> tuple[int, int]:
    """Return where the coordinates and the freedoms of a link end."""
    links = sections(memory)[0]
    if i + 1 < links.shape[0]:
        return links[i + 1].q, links[i + 1].v
    return int(memory[3]), int(memory[4])


@kernel
def wake(memory: Array, q: Array, v: Array, vdot: Array, h: float) -> None:
    """Count how long each link has rested, and wake those that something has moved or pushes otherwise than before."""
    links = sections(memory)[0]
    kept, pushed, rested, quiet = _rest(memory)
    velocity, duration = sleep_settings(memory)
    for i in range(links.shape[0]):
        q_end, v_end = ends(memory, i)
        if rested[i] == ASLEEP:
            for k in range(links[i].q, q_end):
                if q[k] != kept[k]:
                    rested[i] = 0.0
            for k in range(links[i].v, v_end):
                if v[k] != 0.0 or not abs(vdot[k] - pushed[k]) <= velocity / duration:
                    rested[i] = 0.0
        else:
            rested[i] += h
            for k in range(links[i].v, v_end):
                if not abs(v[k]) <= velocity:
                    rested[i] = 0.0
        quiet[i] = rested[i] >= duration


@kernel
def separate(memory: Array, vdot: Array, h: float) -> None:
    """Leave those links quiet whose whole island is: what joins, holds or may touch one that is not is not either."""
    links, work, pairs, _, _, _, _, _ = sections(memory)
    candidates, _, points, _, _, _, _ = contact_sections(memory)
    _, _, _, quiet = _rest(memory)
    fastest = 0.0  # of the accelerations, m/s^2 and rad/s^2
    for k in range(vdot.shape[0]):
        fastest = max(fastest, abs(vdot[k]))
    changed = True
    while changed:
        changed = False
        for i in range(links.shape[0]):
            changed = _disturb(quiet, links[i].parent, i) or changed
        for p in range(pairs.shape[0]):
            if pairs[p].active:
                changed = _disturb(quiet, pairs[p].link_a, pairs[p].link_b) or changed
        for i in range(candidates.shape[0]):
            candidate = candidates[i]
            a, b = candidate.link_a, candidate.link_b
            if candidate.is_limit or a < 0 or b < 0 or quiet[a] == quiet[b]:
                continue
            # twice what the two can come nearer in the step
            reach = TOUCHING + 2.0 * (sweep_reach(work, candidate, h) + h * h * fastest)
            found = find_points(work, candidate, reach, points)
            for k in range(found):
                if points[k, 9] <= reach:
                    changed = _disturb(quiet, a, b) or changed


@kernel
def lay_down(memory: Array, q: Array, v: Array, vdot: Array) -> int:
    """Have those links sleep that are quiet and wake those that are not; return how many are awake."""
    links = sections(memory)[0]
    kept, pushed, rested, quiet = _rest(memory)
    awake = 0
    for i in range(links.shape[0]):
        q_end, v_end = ends(memory, i)
        if not quiet[i]:
            awake += 1
            if rested[i] == ASLEEP:
                rested[i] = 0.0
        elif rested[i] != ASLEEP:
            rested[i] = ASLEEP
            copy(q[links[i].q : q_end], kept[links[i].q : q_end])
            copy(vdot[links[i].v : v_end], pushed[links[i].v : v_end])
            for k in range(links[i].v, v_end):
                v[k] = 0.0
    return awake


@kernel
def _disturb(quiet: Array, a: int, b: int) -> bool:
    """Have two links be quiet only together; return whether that changed anything."""
    if a < 0 or b < 0 or quiet[a] == quiet[b]:
        return False
    quiet[a] = quiet[b] = 0.0
    return True


@kernel
def _rest(memory: Array) -> tuple[Array, Array, Array, Array]:
    """The configuration and acceleration in which each link fell asleep, how long it has rested, s, and whether it is quiet."""
    states = contact_sections(memory)[6]
    return states[KEPT], states[PUSHED], states[RESTED], states[QUIET]
