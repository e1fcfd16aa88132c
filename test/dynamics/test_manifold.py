"""The compiled manifold against rotations.py and Tree, and its derivatives against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from physics_prior import rotations
from physics_prior.dynamics import manifold
from physics_prior.dynamics.records import link_records, pair_records
from physics_prior.dynamics.simulator import Simulator

STEP = 1e-6  # of central differences
ANGLES = (0.0, 1e-12, 1e-6, 1e-4, 1e-3, 1.0, np.pi, 3.0 * np.pi)


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    return float(np.max(np.abs(np.subtract(actual, expected))) / max(1.0, np.max(np.abs(expected))))


def records_of(tree):
    return link_records(tree, pair_records(tree, []))


@pytest.fixture(params=range(6))
def case(request, random_tree, random_state):
    rng = np.random.default_rng(request.param)
    tree = random_tree(rng, size=6)
    return rng, tree, records_of(tree), *random_state(rng, tree)


@given(
    st.sampled_from(ANGLES),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
)
def test_exponential_and_right_jacobian(angle, axis):
    """Also where the series take over from the sines, and beyond a full turn."""
    theta = angle * np.array(axis) / np.linalg.norm(axis)
    assert off(manifold.exponential(*theta), rotations.exp(theta)) < 1e-15
    back = rotations.matrix_from_quaternion(rotations.exp(theta)).T
    assert off(np.reshape(manifold.rotation_back(tuple(theta)), (3, 3)), back) < 1e-14
    jacobian = rotations.right_jacobian(theta)
    # (a - sin a) / a^3 loses digits above 1e-3, its series none below; measured 3e-11
    assert off(np.reshape(manifold.right_jacobian(tuple(theta)), (3, 3)), jacobian) < 1e-10


def test_displacement_equals_that_of_the_tree(case):
    rng, tree, links, q, _ = case
    delta, out = rng.normal(size=tree.nv), np.zeros(tree.nq)
    manifold.displace(links, q, delta, out)
    assert off(out, tree.integrate(q, delta)) < 1e-14  # measured 3e-16
    assert off(Simulator(tree).displaced(q, delta), out) == 0.0
    same = q.copy()
    manifold.displace(links, same, delta, same)
    assert np.array_equal(same, out)
    assert off(tree.difference(q, out), tree.difference(q, tree.integrate(q, delta))) < 1e-14


def test_quaternions_stay_of_unit_length(case):
    rng, tree, links, q, _ = case
    for _ in range(1000):
        manifold.displace(links, q, rng.normal(scale=0.1, size=tree.nv), q)
    for link in tree.links:
        if link.joint.nq - link.joint.nv == 1:
            assert abs(np.linalg.norm(q[link.q.stop - 4 : link.q.stop]) - 1.0) < 1e-15


def test_rate_of_local_coordinates(case):
    """To fourth order in theta: q0 [+] theta moves with velocity v."""
    rng, tree, links, q, v = case
    for size, bound in ((1e-1, 1e-5), (1e-2, 1e-9)):
        theta, rate = size * rng.uniform(-1.0, 1.0, size=tree.nv), np.zeros(tree.nv)
        manifold.rate(links, theta, v, False, rate)
        ahead = tree.integrate(q, theta + STEP * rate)
        behind = tree.integrate(q, theta - STEP * rate)
        motion = tree.difference(behind, ahead) / (2.0 * STEP)
        assert off(motion, v) < bound  # measured 1e-6, 2e-10 (rounding of the difference)


def test_derivative_of_the_rate(case):
    rng, tree, links, _, v = case
    theta, direction = 0.1 * rng.normal(size=tree.nv), rng.normal(size=(2, tree.nv))
    out = np.zeros((tree.nv, 1))
    manifold.rate_derivative(links, theta, v, direction[0][:, None].copy(), direction[1][:, None].copy(), False, out)
    ends = np.zeros((2, tree.nv))
    for end, sign in zip(ends, (1.0, -1.0), strict=True):
        manifold.rate(links, theta + sign * STEP * direction[0], v + sign * STEP * direction[1], False, end)
    assert off(out[:, 0], (ends[0] - ends[1]) / (2.0 * STEP)) < 1e-8  # measured 4e-10


def test_derivative_of_the_displacement(case):
    rng, tree, links, q, _ = case
    theta, direction = rng.normal(size=tree.nv), rng.normal(size=(2, tree.nv))
    out = np.zeros((tree.nv, 1))
    manifold.displacement_derivative(links, theta, direction[0][:, None].copy(), direction[1][:, None].copy(), out)
    ends = [
        tree.integrate(tree.integrate(q, sign * STEP * direction[0]), theta + sign * STEP * direction[1])
        for sign in (1.0, -1.0)
    ]
    assert off(out[:, 0], tree.difference(ends[1], ends[0]) / (2.0 * STEP)) < 1e-8  # measured 4e-10
