"""The gap along motions: the same from either side and anywhere, without jumps, and falling as fast as the points meet."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics_prior.dynamics.contact.geometry.pairs import BOX, CAPSULE, ELLIPSOID, PLANE, SPHERE

CURVED = (SPHERE, CAPSULE, BOX, ELLIPSOID)
seeds = st.integers(0, 2**32 - 1)
kinds = st.sampled_from(CURVED)
gaps = st.one_of(st.floats(-0.01, 1.0), st.just(0.0))


@given(st.sampled_from((PLANE, *CURVED)), kinds, gaps, seeds)
@settings(max_examples=60, deadline=None)
def test_either_shape_may_be_first(geometry, kind_a, kind_b, gap, seed):
    a, b = geometry.random_pair(np.random.default_rng(seed), kind_a, kind_b, gap)
    there, back = geometry.manifold(a, b, 0.5), geometry.manifold(b, a, 0.5)
    assert abs(np.min(there[:, 9]) - np.min(back[:, 9])) < 1e-12  # measured 1e-15
    if kind_a != kind_b:
        assert np.array_equal(there[:, :3], back[:, 3:6])
        assert np.array_equal(there[:, 6:9], -back[:, 6:9])


@given(st.sampled_from((PLANE, *CURVED)), kinds, gaps, seeds)
@settings(max_examples=60, deadline=None)
def test_moved_together_nothing_changes(geometry, kind_a, kind_b, gap, seed):
    rng = np.random.default_rng(seed)
    a, b = geometry.random_pair(rng, kind_a, kind_b, gap)
    R, shift = geometry.matrix(rng.normal(size=3)), rng.normal(size=3)

    def move(s):
        return geometry.Shape(s.kind, s.size, R @ s.center + shift, R @ s.R)

    here, there = geometry.nearest(a, b), geometry.nearest(move(a), move(b))
    assert abs(here[9] - there[9]) < 1e-12  # measured 4e-15
    if gap > 1e-3:  # a face and an edge may be equally deep
        assert np.max(np.abs(R @ here[6:9] - there[6:9])) < 1e-10  # measured 3e-15


def motion(rng, size=1.0):
    return size * rng.normal(size=3), size * rng.normal(size=3)


@pytest.mark.parametrize(("kind_a", "kind_b"), list(product((PLANE, *CURVED), CURVED)))
def test_gap_never_jumps(kind_a, kind_b, geometry):
    """The signed distance changes no more than any point of the moving shape moves, also over 1e-7 s around contact."""
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    for _ in range(4):
        a, b = geometry.random_pair(rng, kind_a, kind_b, 0.0)
        shift, turn = motion(rng)
        for times in (np.linspace(-0.2, 0.2, 120), np.linspace(-1e-7, 1e-7, 20)):
            gap = np.array([geometry.nearest(a, b.moved(t * shift, t * turn))[9] for t in times])
            shallow = (gap[1:] > -0.02) & (gap[:-1] > -0.02)
            fastest = np.linalg.norm(shift) + np.linalg.norm(turn) * b.radius
            most = fastest * (times[1] - times[0]) + 1e-13
            assert np.all(np.abs(np.diff(gap))[shallow] <= most)


@pytest.mark.parametrize(("kind_a", "kind_b"), list(product((PLANE, *CURVED), CURVED)))
def test_gap_falls_as_fast_as_its_points_meet(kind_a, kind_b, geometry):
    """d gap / dt = normal . (velocity of b's point - velocity of a's point): what makes a time of impact right."""
    rng = np.random.default_rng(kind_a + 7 * kind_b)
    h = 1e-6
    for case in range(12):
        a, b = geometry.random_pair(rng, kind_a, kind_b, rng.uniform(-0.01, 0.0) if case % 2 else rng.uniform(0.1, 1.0))
        (va, wa), (vb, wb) = motion(rng), motion(rng)
        row = geometry.nearest(a, b)
        velocity_a = va + np.cross(wa, row[:3] - a.center)
        velocity_b = vb + np.cross(wb, row[3:6] - b.center)
        ends = [geometry.nearest(a.moved(t * va, t * wa), b.moved(t * vb, t * wb))[9] for t in (h, -h)]
        assert abs((ends[0] - ends[1]) / (2.0 * h) - row[6:9] @ (velocity_b - velocity_a)) < 1e-8  # measured 1e-9


def test_same_arguments_give_the_same_bits(geometry):
    rng = np.random.default_rng(0)
    for kind_a, kind_b in product(CURVED, CURVED):
        a, b = geometry.random_pair(rng, kind_a, kind_b, 0.01)
        assert geometry.manifold(a, b, 0.1).tobytes() == geometry.manifold(a, b, 0.1).tobytes()
