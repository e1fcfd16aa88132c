"""The least gap is the signed distance: proved pair by pair by duality, searched for by brute force, and MuJoCo's.

Apart: any two points bound the distance from above and any direction bounds it from below. Where the pair of points lies
in the shapes, and they are apart along its normal by as much as the points are, that number is the distance.
"""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize

from physics_prior.dynamics.contact.geometry.pairs import BOX, CAPSULE, ELLIPSOID, PLANE, SPHERE
from physics_prior.dynamics.contact.geometry.point_ellipsoid import signed_distance

CURVED = (SPHERE, CAPSULE, BOX, ELLIPSOID)
PAIRS = list(product(CURVED, CURVED))
NAMES = ("plane", "sphere", "capsule", "box", "ellipsoid")


def pair_id(kind):
    return NAMES[kind]


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS, ids=pair_id)
def test_distance_apart_is_proved_by_its_own_points_and_normal(kind_a, kind_b, geometry):
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    worst = np.zeros(5)
    for case in range(40):
        gap = np.exp(rng.uniform(-14.0, 1.0))  # from a micrometre up
        a, b = geometry.random_pair(rng, kind_a, kind_b, gap, spread=0.7 if case % 2 else 2.0)
        row = geometry.nearest(a, b)
        on_a, on_b, normal, found = row[:3], row[3:6], row[6:9], row[9]
        size = a.radius + b.radius
        errors = (
            abs(np.linalg.norm(normal) - 1.0),
            abs(normal @ (on_b - on_a) - found) / size,
            max(a.outside(on_a), b.outside(on_b)) / size,
            abs(np.linalg.norm(on_b - on_a) - found) / size,
            abs(geometry.separation(a, b, normal) - found) / size,
        )
        worst = np.maximum(worst, errors)
    assert np.max(worst[:4]) < 1e-14, worst  # measured 8e-16
    assert worst[4] < 1e-12, worst  # measured 4e-15


def polytope_normals(a, b):
    """Every facet of the Minkowski difference of boxes and segments: face normals, and edges crossed."""
    edges = [s.R if s.kind == BOX else s.R[:, 2:] for s in (a, b)]
    faces = [s.R.T if s.kind == BOX else np.empty((0, 3)) for s in (a, b)]
    crossed = [np.cross(u, v) for u in edges[0].T for v in edges[1].T]
    normals = np.vstack([*faces, *(n / np.linalg.norm(n) for n in crossed)])
    return np.vstack([normals, -normals])


@pytest.mark.parametrize("reach", [0.0, 0.3])
def test_overlapping_boxes_are_as_deep_as_the_nearest_facet_says(reach, geometry):
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(60):
        a, b = geometry.random_pair(rng, BOX, BOX, -rng.uniform(0.0, 0.2))
        rows = geometry.manifold(a, b, reach)
        depth = max(geometry.separation(a, b, n) for n in polytope_normals(a, b))
        worst = max(worst, abs(np.min(rows[:, 9]) - depth))
        assert np.all(rows[:, 9] <= reach)
    assert worst < 1e-13  # measured 1e-15


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS, ids=pair_id)
def test_no_direction_leaves_a_shallow_overlap_sooner(kind_a, kind_b, geometry):
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    shell = rng.normal(size=(300, 3))
    worst, worst_dual = 0.0, 0.0
    for _ in range(8):
        a, b = geometry.random_pair(rng, kind_a, kind_b, -rng.uniform(0.0, 0.05))
        row = geometry.nearest(a, b)
        normals = np.vstack([shell, row[6:9] + 0.1 * rng.normal(size=(30, 3))])

        def apart(n, a=a, b=b):
            return geometry.separation(a, b, n / np.linalg.norm(n))

        start = max(normals, key=apart)
        found = minimize(lambda n: -apart(n), start, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-10})
        worst = max(worst, -found.fun - row[9])
        worst_dual = max(worst_dual, abs(apart(row[6:9]) - row[9]))
    assert worst < 1e-13  # measured 2e-15: the search never goes beyond ours
    assert worst_dual < 1e-13  # measured 2e-15


@pytest.mark.parametrize("kind", CURVED, ids=pair_id)
def test_plane_is_touched_by_what_lies_lowest(kind, geometry):
    rng = np.random.default_rng(kind)
    for _ in range(40):
        plane, b = geometry.random_shape(rng, PLANE), geometry.random_shape(rng, kind)
        row = geometry.nearest(plane, b)
        normal = plane.R[:, 2]
        assert np.array_equal(row[6:9], normal)
        expected = -b.support(-normal) - normal @ plane.center
        assert abs(row[9] - expected) < 1e-14  # measured 2e-15
        assert abs(b.outside(row[3:6])) < 1e-14
        assert abs(normal @ (row[:3] - plane.center)) < 1e-14


def test_point_and_ellipsoid_agree_on_the_foot_everywhere():
    """Points made from their feet, x = p + d n, out to the ellipsoid's least radius of curvature within."""
    rng = np.random.default_rng(5)
    for spread in (0.0, 0.5, 3.0):
        for _ in range(200):
            semi = np.exp(rng.uniform(-spread, spread, 3))
            u = rng.normal(size=3)
            foot = semi * u / np.linalg.norm(u)
            normal = foot / semi**2 / np.linalg.norm(foot / semi**2)
            deepest = 0.9 * np.min(semi) ** 2 / np.max(semi)
            distance = rng.choice([-deepest * rng.uniform(), np.exp(rng.uniform(-20.0, 3.0))])
            found, n, _, _ = signed_distance(tuple(semi), tuple(foot + distance * normal))
            size = np.max(semi) + abs(distance)
            assert abs(found - distance) < 1e-14 * size  # measured 3e-16
            bend = 1.0 + max(0.0, -distance) / (np.min(semi) ** 2 / np.max(semi) + distance)
            assert np.max(np.abs(np.subtract(n, normal))) < 1e-14 * bend * np.max(semi) / np.min(semi)  # measured 3e-16


MUJOCO = {
    SPHERE: ("sphere", lambda s: s[:1]),
    CAPSULE: ("capsule", lambda s: s[:2]),
    BOX: ("box", lambda s: s),
    ELLIPSOID: ("ellipsoid", lambda s: s),
}


@pytest.mark.parametrize(("kind_a", "kind_b"), PAIRS, ids=pair_id)
def test_mujoco_finds_the_same_distance(kind_a, kind_b, geometry):
    mujoco = pytest.importorskip("mujoco")
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    for _ in range(3):
        a, b = geometry.random_pair(rng, kind_a, kind_b, rng.uniform(0.05, 1.0))
        geoms = ""
        for shape in (a, b):
            name, sizes = MUJOCO[shape.kind]
            size, axes = " ".join(map(repr, sizes(shape.size.tolist()))), shape.R.T.ravel().tolist()[:6]
            at, along = " ".join(map(repr, shape.center.tolist())), " ".join(map(repr, axes))
            geoms += f'<body pos="{at}"><geom type="{name}" size="{size}" xyaxes="{along}"/></body>'
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option ccd_tolerance="1e-10"/><worldbody>{geoms}</worldbody></mujoco>'
        )
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        ends = np.zeros(6)
        theirs = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, ends)
        row = geometry.nearest(a, b)
        assert abs(theirs - row[9]) < 1e-8  # measured 2e-10
