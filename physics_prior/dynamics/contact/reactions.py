"""Forces of contact and limits, by the names under which effects publish them."""

from collections.abc import Sequence

import numpy as np

from physics_prior.dynamics.wrench import Wrench
from physics_prior.effects.effect import Effect
from physics_prior.model import JointKind, Tree


def candidates_by_name(tree: Tree, effects: Sequence[Effect]) -> dict[str, list[int]]:
    """Name of a reaction -> the indices of its CANDIDATE records: pairs of surfaces stand before ends of ranges."""
    out: dict[str, list[int]] = {}
    index = 0
    for effect in effects:
        for name, _ in zip(effect.reactions(tree), effect.touching_pairs(tree), strict=False):
            out[name] = [index]
            index += 1
    for effect in effects:
        for name, each in zip(effect.reactions(tree), effect.joint_ranges(tree), strict=False):
            ends = int(sum(np.isfinite([each.lower, each.upper])))
            out[name] = list(range(index, index + ends))
            index += ends
    return out


def reaction(tree: Tree, work: np.ndarray, own: np.ndarray) -> Wrench:
    """What the CANDIDATE records of one name do to the part, world axes, when last asked for.

    Of a pair of surfaces at the middle of its normal force, the world's origin while nothing touches; of a joint's two ends along
    or about the axis, at the joint.
    """
    if not own[0]["is_limit"]:
        return Wrench(own[0]["force"], own[0]["moment"], own[0]["point"])
    link = own[0]["link_b"]
    push = own["force"][:, 0].sum() * work[link]["axis"]
    turns = tree.links[link].joint.kind is JointKind.REVOLUTE
    force, moment = (np.zeros(3), push) if turns else (push, np.zeros(3))
    return Wrench(force, moment, work[link]["origin"])
