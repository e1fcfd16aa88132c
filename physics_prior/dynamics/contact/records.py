"""What may touch, and what does, as arrays of records."""

import math
from collections.abc import Sequence

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.contact.geometry.pairs import BOX, CAPSULE, ELLIPSOID, PLANE, SPHERE, finder
from physics_prior.effects.touching import JointRange, Surface, TouchingPair
from physics_prior.model import Tree

KINDS = {"plane": PLANE, "sphere": SPHERE, "capsule": CAPSULE, "box": BOX, "ellipsoid": ELLIPSOID}

CANDIDATE = np.dtype(
    [
        ("link_a", "i8"),  # of a pair of surfaces; of an end of a joint's range the joint's link is b
        ("link_b", "i8"),
        ("is_limit", "i8"),
        ("coordinate", "i8"),  # of a limit: its place in q
        ("sign", "f8"),  # of a limit: +1 at the lower end, -1 at the upper one
        ("bound", "f8"),  # of a limit: that end, rad or m
        ("finder", "i8"),  # address of the geometry of its two kinds of surfaces
        ("exchanged", "i8"),  # whether that takes them in the opposite order
        ("size_a", "f8", 3),
        ("size_b", "f8", 3),
        ("position_a", "f8", 3),  # of the surface's centre in its link's frame, m
        ("position_b", "f8", 3),
        ("rotation_a", "f8", 9),  # surface to link
        ("rotation_b", "f8", 9),
        ("radius", "f8"),  # of a sphere about surface b's centre that holds it, m
        ("velocity", "f8", 3),  # of surface a's material beside its link's, world, m/s
        ("friction", "f8"),
        ("rolling", "f8"),  # m
        ("restitution", "f8"),
        ("friction_deviation", "f8"),
        ("restitution_deviation", "f8"),
        ("impulse_deviation", "f8"),
        ("astray", "f8", 3),  # what an impact does beside its law: shares of its normal impulse, along it and across
        ("quiet", "f8"),  # speed below which nothing bounces
        ("gap", "f8"),  # least distance when last looked at, m or rad
        ("before", "f8"),  # ... at the beginning of the step
        ("asleep", "i8"),  # whether all of it rests, and the present step leaves it out
        ("coming", "i8"),  # whether it is about to touch within the step
        ("force", "f8", 3),  # ON link b when last asked for, world, N; of a limit along its axis, in [0]
        ("moment", "f8", 3),  # about ``point``
        ("point", "f8", 3),  # where the force acts, world, m
    ],
    align=True,
)
"""Two surfaces, or a joint and an end of its range, that may touch."""

CONTACT = np.dtype(
    [
        ("candidate", "i8"),
        ("first", "i8"),  # its first row in the system; its normal's
        ("rows", "i8"),
        ("gap", "f8"),
        ("point", "f8", 3),  # world, m
        ("frame", "f8", 9),  # rows: normal from a to b and two tangents, world
        ("approach", "f8"),  # velocity of the gap before, m/s or rad/s
    ],
    align=True,
)
"""A point at which a candidate touches, or will soon."""


def candidate_records(tree: Tree, ranges: Sequence[JointRange], pairs: Sequence[TouchingPair]) -> np.ndarray:
    """Every pair of surfaces, then every finite end of a range, as CANDIDATE records."""
    ends = [
        (each, sign, bound)
        for each in ranges
        for sign, bound in ((1.0, each.lower), (-1.0, each.upper))
        if math.isfinite(bound)
    ]
    records = np.zeros(len(pairs) + len(ends), dtype=CANDIDATE)
    for record, pair in zip(records, pairs, strict=False):
        for side, surface in (("a", pair.a), ("b", pair.b)):
            link, position, R = _on_link(tree, surface)
            record[f"link_{side}"] = link
            record[f"size_{side}"], record[f"position_{side}"] = surface.size, position
            record[f"rotation_{side}"] = R.ravel()
        record["finder"], record["exchanged"] = finder(KINDS[pair.a.kind], KINDS[pair.b.kind])
        record["radius"] = float(np.linalg.norm(pair.b.size)) + float(np.max(pair.b.size))
        record["velocity"], record["friction"], record["rolling"] = pair.velocity, pair.friction, pair.rolling
        record["restitution"], record["quiet"] = pair.restitution, pair.quiet
        record["friction_deviation"] = pair.friction_deviation
        record["restitution_deviation"] = pair.restitution_deviation
        record["impulse_deviation"] = pair.impulse_deviation
    for record, (each, sign, bound) in zip(records[len(pairs) :], ends, strict=True):
        own = tree.link(each.joint)
        record["is_limit"], record["sign"], record["bound"] = 1, sign, bound
        record["link_a"], record["link_b"], record["coordinate"] = own.parent, tree.links.index(own), own.q.start
        record["restitution"], record["quiet"] = each.restitution, each.quiet
        record["restitution_deviation"] = each.restitution_deviation
    return records


def _on_link(tree: Tree, surface: Surface) -> tuple[int, np.ndarray, np.ndarray]:
    """Link index, centre in the link's frame and rotation surface to link."""
    frame = tree.frame(surface.part)
    R = rotations.matrix_from_quaternion(frame.orientation)
    own = rotations.matrix_from_quaternion(rotations.normalize(surface.orientation))
    return frame.link, frame.position + R @ surface.position, R @ own
