"""Wrenches that joints and constraint effects exert, told from what the equation of motion leaves in the workspace."""

from physics_prior.dynamics.algebra import cross, get3, minus, plus, put3
from physics_prior.dynamics.constraint import load_links
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.newton_euler import transmit
from physics_prior.dynamics.types import Array, Records


@kernel
def tell_wrenches(links: Records, work: Records, pairs: Records, firsts: Array, out: Array) -> None:
    """Fill rows of out (., 6) with force and moment ON a part BY each joint, then by each constraint effect; world axes.

    About the joint, or the effect's first point. Its pairs are those from firsts[k] to firsts[k + 1]. Needs accelerations of the
    links, what pushes them beside, and the forces of the pairs, which are added to that.
    """
    load_links(work, pairs)
    transmit(links, work)
    count = links.shape[0]
    for i in range(count):
        put3(out[i, :3], get3(work[i].bias_force))
        put3(out[i, 3:], get3(work[i].bias_moment))
    for k in range(firsts.shape[0] - 1):
        row = out[count + k]
        for e in range(6):
            row[e] = 0.0
        for p in range(firsts[k], firsts[k + 1]):
            force, arm = get3(pairs[p].force), minus(get3(pairs[p].b), get3(pairs[firsts[k]].b))
            put3(row[:3], plus(get3(row[:3]), force))
            put3(row[3:], plus(get3(row[3:]), cross(arm, force)))
