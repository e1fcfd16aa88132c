"""The model and the workspace as arrays of records: what the kernels read and write, one record a link."""

from collections.abc import Sequence

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.kernel import constant_fields
from physics_prior.effects.effect import PointPair
from physics_prior.model import JointKind, Link, Tree
from physics_prior.model.joint import FREEDOMS

ALL, MOVED = 0, 1
"""The links that a sweep outward visits: all, or those that constraint rows move."""
LANES, ENOUGH = 4, 3
"""Links that sweeps visit side by side: at most, and at least, as their numbers have to be brought there."""
BOUNDS = 4
"""Numbers at the end of a constraint row: where its columns begin and end, the first row coupled to it, that behind the last."""
REVOLUTE, PRISMATIC, SPHERICAL, FREE = (int(kind) for kind in JointKind if kind is not JointKind.FIXED)

LINK = np.dtype(
    [
        ("visit", "i8"),  # of the i-th record: which link sweeps visit i-th outward, those alike one after another
        ("together", "i8"),  # ... of how many, alike, it is one, which sweeps visit side by side
        ("moved", "i8"),  # ... which link is the i-th outward of those that constraint rows move, -1 behind the last
        (
            "turning",
            "i8",
        ),  # ... which link that has mass is the i-th on a ball or free joint, the last again and again behind it
        ("parent", "i8"),  # index of the parent link, -1 for the world
        ("kind", "i8"),  # JointKind
        ("q", "i8"),  # first coordinate in q
        ("v", "i8"),  # first degree of freedom in v
        ("column", "i8"),  # the same in the order of constraint rows: what constraints move comes first
        ("turned", "i8"),  # whether the placement turns at all
        ("principal", "i8"),  # whether the link's axes are its principal ones: an inertia that is diagonal
        ("axis", "f8", 3),  # joint axis in the link frame
        ("position", "f8", 3),  # joint in the parent link's frame, m
        ("placement", "f8", 9),  # rotation matrix, link to parent link at zero
        ("mass", "f8"),  # kg
        ("turning_mass", "f8"),  # of a ball joint's: what turns about the joint, not about its centre, kg
        ("center", "f8", 3),  # centre of mass in the link frame, m
        ("inertia", "f8", 6),  # about the centre of mass, link axes: xx xy xz yy yz zz, kg m^2
    ],
    align=True,
)
"""One moving part of the model; constant while a scene runs."""

ABSENT = {"parent": -1, "kind": FREE, "together": 1}
FREE_LINK = np.dtype(
    {
        "names": [name for name in LINK.names or () if name not in ABSENT],
        "formats": [field[0] for name, field in (LINK.fields or {}).items() if name not in ABSENT],
        "offsets": [field[1] for name, field in (LINK.fields or {}).items() if name not in ABSENT],
        "itemsize": LINK.itemsize,
    },
    align=True,
)
"""A link of a scene without joints, laid out as LINK is. Kernels take the fields that it lacks as constants, and are compiled
without what other joints need."""
constant_fields(FREE_LINK, ABSENT)

WORK = np.dtype(
    [
        ("rotation", "f8", 9),  # link to world
        ("origin", "f8", 3),  # of the link frame (the joint), world, m
        ("arm", "f8", 3),  # from the parent link's origin to this one, world, m
        ("axis", "f8", 3),  # joint axis, world
        ("omega", "f8", 3),  # angular velocity, world, rad/s
        ("velocity", "f8", 3),  # of the origin, world, m/s
        ("coriolis_angular", "f8", 3),  # what velocities alone add to the angular acceleration
        ("coriolis_linear", "f8", 3),  # ... and to the acceleration of the origin
        ("bias_moment", "f8", 3),  # articulated bias wrench
        ("bias_force", "f8", 3),
        ("gyroscopic", "f8", 3),  # torque omega x I omega, or its midpoint form, world
        ("moment", "f8", 3),  # external moment about the origin, world, N m
        ("force", "f8", 3),  # external force, world, N
        ("factored", "i8"),  # of the first link: whether factors and rows are those of these poses
        ("inertia", "f8", 6),  # of the link about its centre of mass, world axes
        ("J", "f8", 6),  # articulated inertia about the origin, world axes: moment per angular acceleration
        ("H", "f8", 9),  # ... moment per acceleration of the origin
        ("M", "f8", 6),  # ... force per acceleration of the origin
        ("center", "f8", 3),  # from the origin to the centre of mass, world, m
        ("U_moment", "f8", 3),  # column of the articulated inertia along the joint axis
        ("U_force", "f8", 3),
        ("D", "f8"),  # its entry along the axis, inverted
        ("u", "f8", 3),  # joint force left over for acceleration (scalar joints use u[0])
        ("J_inverse", "f8", 6),  # of spherical and free joints
        ("K", "f8", 9),  # J^-1 H
        ("M_inverse", "f8", 6),  # of a free joint: inverse of M - H^T J^-1 H
        ("alpha", "f8", 3),  # angular acceleration, world, rad/s^2
        ("acceleration", "f8", 3),  # of the origin minus gravity, world, m/s^2
        ("delta_alpha", "f8", 3),  # the same of an increment (constraint forces, projections)
        ("delta_acceleration", "f8", 3),
    ],
    align=True,
)
"""What the kernels compute for one link."""

PAIR = np.dtype(
    [
        ("link_a", "i8"),  # -1 for the world
        ("link_b", "i8"),
        ("rows", "i8"),  # 1..3
        ("first", "i8"),  # its first row
        ("is_rod", "i8"),
        ("active", "i8"),  # whether it holds now; if not, its rows do nothing
        ("here", "i8"),  # whether it holds where it took hold: an error of position then is none of its rows
        (
            "motion",
            "i8",
        ),  # where in the step's parameters the motion of point a begins (anchor_motion.py); 0 if it has none
        ("length", "f8"),  # of a rod, m
        ("point_a", "f8", 3),  # in link a's frame, m
        ("point_b", "f8", 3),
        ("directions", "f8", 9),  # rows of unit vectors in link a's frame
        ("base", "f8", 3),  # point a of a moving anchor where its motion displaces it by nothing, world, m
        ("drift", "f8", 3),  # velocity of a moving anchor, world, m/s
        ("drift_rate", "f8", 3),  # its acceleration, m/s^2
        ("a", "f8", 3),  # point a, world, m
        ("b", "f8", 3),
        ("hold", "f8", 3),  # where the force acts on link a: at b, but at a for a rod
        ("d", "f8", 9),  # rows of unit vectors, world
        ("force", "f8", 3),  # of the constraint ON link b at point b, world, N
    ],
    align=True,
)
"""One point pair: its constants and what the kernels compute for it."""


def link_records(tree: Tree, *touched: np.ndarray) -> np.ndarray:
    """The tree's moving parts as LINK records (N,), held by records with a link_a and a link_b each."""
    records = np.zeros(len(tree.links), dtype=LINK)
    moved = _moved_links(tree, touched)
    records["moved"] = (sorted(moved) + [-1] * len(records))[: len(records)]
    column = 0
    for i in sorted(range(len(records)), key=lambda i: i not in moved):
        records[i]["column"] = column
        column += tree.links[i].joint.nv
    groups = _alike(tree)
    records["visit"] = [i for group in groups for i in group]
    records["together"] = [len(group) for group in groups for _ in group]
    balls = [
        i
        for i, link in enumerate(tree.links)
        if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE) and link.mass_properties.mass > 0.0
    ]
    records["turning"] = (balls + balls[-1:] * len(records))[: len(records)] or -1
    for record, link in zip(records, tree.links, strict=True):
        inertia = link.mass_properties.inertia
        record["parent"], record["kind"] = link.parent, int(link.joint.kind)
        record["q"], record["v"] = link.q.start, link.v.start
        record["axis"], record["position"] = link.joint.axis, link.joint.position
        record["placement"] = rotations.matrix_from_quaternion(link.joint.orientation).ravel()
        record["turned"] = _turned(link)
        record["mass"], record["center"] = link.mass_properties.mass, link.mass_properties.center_of_mass
        record["turning_mass"] = record["mass"] if link.joint.kind is JointKind.SPHERICAL else 0.0
        record["inertia"] = inertia[np.triu_indices(3)]
        record["principal"] = _principal(link)
    return records


def _alike(tree: Tree) -> list[list[int]]:
    """The links in an outward order, those together that sweeps visit side by side: enough of them for that to pay.

    They are as high above the outermost link, so that none carries another, and the kernels do the same with all. What hangs on
    the world stands alone.
    """
    heights = [0] * len(tree.links)
    for i in range(len(tree.links) - 1, -1, -1):
        if (parent := tree.links[i].parent) >= 0:
            heights[parent] = max(heights[parent], heights[i] + 1)
    alike: dict[tuple[int, ...], list[int]] = {}
    for i, link in enumerate(tree.links):
        key = (-heights[i], int(link.joint.kind), _turned(link), _principal(link), i if link.parent < 0 else -1)
        alike.setdefault(key, []).append(i)
    groups: list[list[int]] = []
    for _, links in sorted(alike.items()):
        while links:
            some = LANES if len(links) >= ENOUGH else 1
            groups.append(links[:some])
            links = links[some:]
    return groups


def _turned(link: Link) -> bool:
    """Whether a joint's placement turns at all."""
    return not np.array_equal(rotations.matrix_from_quaternion(link.joint.orientation), np.eye(3))


def _principal(link: Link) -> bool:
    """Whether a link's axes are its principal ones."""
    inertia = link.mass_properties.inertia
    return np.array_equal(inertia, np.diag(np.diag(inertia)))


def moved_freedoms(tree: Tree, *touched: np.ndarray) -> int:
    """Number of degrees of freedom that such records move: the width of the constraint rows."""
    return sum(tree.links[i].joint.nv for i in _moved_links(tree, touched))


def pair_records(tree: Tree, pairs: list[PointPair]) -> np.ndarray:
    """Point pairs as PAIR records (P,), rows numbered in order."""
    records = np.zeros(len(pairs), dtype=PAIR)
    first = 0
    for record, pair in zip(records, pairs, strict=True):
        rows = 1 if pair.length is not None else len(pair.directions)
        link_a, record["point_a"], R = pair.a.on_link(tree)
        link_b, record["point_b"], _ = pair.b.on_link(tree)
        record["link_a"], record["link_b"], record["rows"], record["first"] = link_a, link_b, rows, first
        record["is_rod"], record["length"] = pair.length is not None, pair.length or 0.0
        record["active"], record["base"] = 1, record["point_a"]
        record["directions"][: 3 * rows] = (pair.directions[:rows] @ R.T).ravel()
        first += rows
    return records


def row_bounds(links: np.ndarray, pairs: np.ndarray, columns: int) -> np.ndarray:
    """The BOUNDS (m, 4) of the pairs' rows; the last two numbers never fall, as elimination fills rows in."""
    moved = np.zeros((int(pairs["rows"].sum()), columns), dtype=bool)
    for pair in pairs:
        for i in (int(pair["link_a"]), int(pair["link_b"])):
            while i >= 0:
                first, column = pair["first"], links[i]["column"]
                moved[first : first + pair["rows"], column : column + FREEDOMS[links[i]["kind"]]] = True
                i = int(links[i]["parent"])
    begin, end = moved.argmax(axis=1), columns - moved[:, ::-1].argmax(axis=1)
    meet = (begin[:, None] < end) & (begin < end[:, None])
    reach = np.maximum.accumulate(len(moved) - meet[:, ::-1].argmax(axis=1))
    return np.stack([begin, end, np.searchsorted(reach, np.arange(len(moved)), side="right"), reach], axis=1)


def motion_tables(tree: Tree, pairs: list[PointPair], records: np.ndarray, begin: int) -> np.ndarray:
    """The tables of all moving anchors, in world axes, and in the records where each begins, the first of them at ``begin``."""
    tables = [np.zeros(0)]
    for record, pair in zip(records, pairs, strict=True):
        if pair.motion is not None:
            record["motion"] = begin + sum(map(len, tables))
            R = rotations.matrix_from_quaternion(tree.frame(pair.a.part).orientation)
            tables.append(pair.motion.table(R))
    return np.concatenate(tables)


def _moved_links(tree: Tree, touched: Sequence[np.ndarray]) -> set[int]:
    """The links between the world and any that the records touch."""
    moved: set[int] = set()
    for i in [each for records in touched for side in ("link_a", "link_b") for each in records[side]]:
        while i >= 0:
            moved.add(int(i))
            i = tree.links[i].parent
    return moved
