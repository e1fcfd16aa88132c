"""Manifolds of shapes at rest, and of shapes placed so that directions are lost."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics_prior.dynamics.contact.geometry.pairs import BOX, CAPSULE, ELLIPSOID, PLANE, SPHERE

CURVED = (SPHERE, CAPSULE, BOX, ELLIPSOID)
UP = np.array([0.0, 0.0, 1.0])
LYING = (0.0, np.pi / 2.0, 0.0)


@pytest.fixture(scope="module")
def shape(geometry):
    def make(kind, size, center=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
        return geometry.Shape(kind, np.array(size, float), np.array(center, float), geometry.matrix(turn))

    return make


def test_box_on_a_plane_lists_its_corners_in_their_order(geometry, shape):
    plane, box = shape(PLANE, (1, 1, 1)), shape(BOX, (0.1, 0.2, 0.3), (0.0, 0.0, 0.3))
    rows = geometry.manifold(plane, box, 1e-3)
    corners = [[-0.1, -0.2, 0.0], [0.1, -0.2, 0.0], [-0.1, 0.2, 0.0], [0.1, 0.2, 0.0]]
    assert np.allclose(rows[:, 3:6], corners, rtol=0.0, atol=1e-15)
    assert np.all(rows[:, 6:9] == UP)
    assert len(geometry.manifold(plane, box, 1.0)) == 8
    tilted = shape(BOX, (0.1, 0.2, 0.3), (0.0, 0.0, 0.5), (0.3, 0.2, 0.0))
    assert len(geometry.manifold(plane, tilted, 0.0)) == 1  # far above: the nearest corner only
    edge = shape(BOX, (0.1, 0.2, 0.3), (0.0, 0.0, 0.25), (0.3, 0.0, 0.0))
    assert len(geometry.manifold(plane, edge, 0.0)) == 2


def test_flush_faces_meet_in_the_corners_of_their_overlap(geometry, shape):
    below = shape(BOX, (0.5, 0.4, 0.1))
    same = shape(BOX, (0.5, 0.4, 0.2), (0.0, 0.0, 0.3))
    assert len(geometry.manifold(below, same, 1e-3)) == 4
    shifted = shape(BOX, (0.5, 0.4, 0.2), (0.3, 0.2, 0.3 + 1e-4))
    rows = geometry.manifold(below, shifted, 1e-3)
    assert sorted(np.round(rows[:, :2], 9).tolist()) == [[-0.2, -0.2], [-0.2, 0.4], [0.5, -0.2], [0.5, 0.4]]
    assert np.allclose(rows[:, 9], 1e-4, rtol=0.0, atol=1e-15)
    assert np.all(rows[:, 6:9] == UP)
    small = shape(BOX, (0.1, 0.1, 0.1), (0.1, 0.1, 0.2))
    assert len(geometry.manifold(below, small, 1e-3)) == 4
    assert len(geometry.manifold(small, below, 1e-3)) == 4
    turned = shape(BOX, (0.4, 0.4, 0.1), (0.0, 0.0, 0.2), (0.0, 0.0, np.pi / 4.0))
    octagon = geometry.manifold(shape(BOX, (0.4, 0.4, 0.1)), turned, 1e-3)
    assert np.allclose(
        np.linalg.norm(octagon[:, :2], axis=1), 0.4 / np.cos(np.pi / 8.0), rtol=0.0, atol=2e-12
    )  # the rim is as wide
    assert len(octagon) == 8


def test_a_stack_tilted_by_rounding_keeps_its_corners(geometry, shape):
    """Flush boxes of the same size, one turned ever so little: never a lone edge on an edge."""
    below = shape(BOX, (0.5, 0.4, 0.1))
    rng = np.random.default_rng(1)
    for angle in np.logspace(-16.0, -4.0, 60):
        turn = angle * rng.normal(size=3)
        rows = geometry.manifold(below, shape(BOX, (0.5, 0.4, 0.2), (0.0, 0.0, 0.3), turn), 1e-3)
        spread = np.ptp(rows[:, :2], axis=0)
        assert np.all(spread > (0.99, 0.79)), (angle, rows)
        assert np.all(rows[:, 8] > 0.999)


def test_crossed_edges_meet_in_one_point(geometry, shape):
    a = shape(BOX, (0.5, 0.1, 0.1), (0.0, 0.0, 0.0), (np.pi / 4.0, 0.0, 0.0))
    b = shape(BOX, (0.1, 0.5, 0.1), (0.0, 0.0, 0.2 * np.sqrt(2.0) - 1e-3), (0.0, np.pi / 4.0, 0.0))
    rows = geometry.manifold(a, b, 1e-3)
    assert len(rows) == 1
    assert np.allclose(rows[0, 6:], [0.0, 0.0, 1.0, -1e-3], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("kind", [PLANE, BOX])
def test_capsule_lying_touches_with_both_ends(kind, geometry, shape):
    ground = shape(kind, (1.0, 1.0, 0.5), (0.0, 0.0, 0.0 if kind == PLANE else -0.5))
    rows = geometry.manifold(ground, shape(CAPSULE, (0.1, 0.3, 0.0), (0.2, 0.0, 0.1), LYING), 1e-3)
    assert sorted(np.round(rows[:, 3], 9).tolist()) == [-0.1, 0.5]
    assert np.allclose(rows[:, 6:], [*UP, 0.0], rtol=0.0, atol=1e-15)
    if kind == BOX:  # beyond the rim only what lies over the face
        rows = geometry.manifold(ground, shape(CAPSULE, (0.1, 0.3, 0.0), (0.9, 0.0, 0.1), LYING), 1e-3)
        assert sorted(np.round(rows[:, 3], 9).tolist()) == [0.6, 1.0]


def test_others_touch_in_one_point(geometry):
    rng = np.random.default_rng(2)
    for kind_a, kind_b in product(CURVED, CURVED):
        if BOX not in (kind_a, kind_b) or ELLIPSOID in (kind_a, kind_b) or SPHERE in (kind_a, kind_b):
            a, b = geometry.random_pair(rng, kind_a, kind_b, 0.0)
            assert len(geometry.manifold(a, b, 10.0)) == 1


@pytest.mark.parametrize(("kind_a", "kind_b"), list(product((PLANE, *CURVED), CURVED)))
def test_lost_directions_still_have_a_normal(kind_a, kind_b, geometry, shape):
    """One centre, one axis, parallel edges, flush and crossed, turned by quarters and by next to nothing."""
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    steps, noise = np.array([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.5]), np.array([0.0, 0.0, 1e-16, 1e-13, 1e-9])

    def place(kind):
        turn = rng.choice([0.0, np.pi / 4.0, np.pi / 2.0, np.pi], 3) * np.eye(3)[rng.integers(3)]
        turn = turn + rng.choice(noise) * rng.normal(size=3)
        center = rng.choice(steps, 3) + rng.choice(noise) * rng.normal(size=3)
        return shape(kind, rng.choice([0.5, 1.0, 1.5], 3), center * rng.integers(2), turn)

    for _ in range(150):
        a, b = place(kind_a), place(kind_b)
        rows = geometry.manifold(a, b, 0.1)
        assert 1 <= len(rows) <= 8
        assert np.all(np.isfinite(rows))
        assert np.max(np.abs(np.linalg.norm(rows[:, 6:9], axis=1) - 1.0)) < 1e-14  # measured 1e-15
        gaps = np.sum(rows[:, 6:9] * (rows[:, 3:6] - rows[:, :3]), axis=1)
        assert np.max(np.abs(gaps - rows[:, 9])) < 1e-14  # measured 2e-15
        assert np.count_nonzero(rows[:, 9] > 0.1) in (0, len(rows))  # beyond reach only the nearest


sizes = st.tuples(*[st.floats(1e-4, 1e4)] * 3)
vectors = st.tuples(*[st.floats(-1e4, 1e4)] * 3)


@given(st.sampled_from((PLANE, *CURVED)), st.sampled_from(CURVED), sizes, sizes, vectors, vectors, vectors, vectors)
@settings(max_examples=300, deadline=None)
def test_anything_gives_finite_rows(geometry, kind_a, kind_b, size_a, size_b, at_a, at_b, turn_a, turn_b):
    a = geometry.Shape(kind_a, np.array(size_a), np.array(at_a), geometry.matrix(turn_a))
    b = geometry.Shape(kind_b, np.array(size_b), np.array(at_b), geometry.matrix(turn_b))
    rows = geometry.manifold(a, b, 1.0)
    assert 1 <= len(rows) <= 8
    assert np.all(np.isfinite(rows))
    assert np.max(np.abs(np.linalg.norm(rows[:, 6:9], axis=1) - 1.0)) < 1e-12


def test_needles_of_any_size_do_not_lose_their_reach_to_rounding(geometry, shape):
    """n . B n by the entries of B, whose condition is 1e20 here, would be negative."""
    needle = shape(ELLIPSOID, (0.46, 1.3e-3, 32.0), (-0.09, -1.3, 2.3))
    rng = np.random.default_rng(4)
    for _ in range(50):
        rows = geometry.manifold(needle, shape(ELLIPSOID, (7.2e4, 2e-3, 1.4e7), turn=rng.normal(size=3)))
        assert np.all(np.isfinite(rows))
