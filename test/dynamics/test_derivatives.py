"""Analytic derivatives against central differences: of accelerations, of the step, of constraint rows."""

from typing import Any, ClassVar

import numpy as np
import pytest

from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Hinge, Rod
from physics_prior.effects.effect import Effect
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.model import JointKind

GRAVITY = Gravity(acceleration=(0.3, -0.2, -9.81))
STEP = 1e-5  # of central differences


class Pairs(Effect):
    """Any point pairs, as an effect."""

    kind: ClassVar[str] = "pairs"
    pairs: Any

    def point_pairs(self, tree):
        return self.pairs


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    return float(np.max(np.abs(actual - expected)) / max(1.0, np.max(np.abs(expected))))


def by_difference(tree, function, q, v):
    """Derivative (k, 2 nv) of function(q, v) -> (k,) by the tangent of q and by v."""
    columns = []
    for d in STEP * np.eye(2 * tree.nv):
        ahead = function(tree.integrate(q, d[: tree.nv]), v + d[tree.nv :])
        behind = function(tree.integrate(q, -d[: tree.nv]), v - d[tree.nv :])
        columns.append((ahead - behind) / (2.0 * STEP))
    return np.array(columns).T


def step_by_difference(simulator, q, v, h):
    """F (2 nv, 2 nv) of ``advance`` from a state, without what projection does to the perturbed start."""
    tree = simulator.tree
    end_q, end_v = q.copy(), v.copy()
    simulator.advance(end_q, end_v, h)

    def end(start_q, start_v):
        moved_q, moved_v = start_q.copy(), start_v.copy()
        simulator.advance(moved_q, moved_v, h)
        return np.concatenate([tree.difference(end_q, moved_q), moved_v - end_v])

    return by_difference(tree, end, q, v)


def held(rng, random_tree, random_state, kind):
    """A tree with a free root, what holds it, and a state that fits."""
    tree = random_tree(rng, size=5, root=JointKind.FREE)
    q, v = random_state(rng, tree)
    part, other = tree.links[-1].part, tree.links[0].part
    free = Simulator(tree)
    free.move(q, v)
    (x, R), (y, S) = free.pose(part), free.pose(other)
    point, axis = rng.normal(scale=0.3, size=3), rng.normal(size=3)
    at = x + R @ point
    if kind == "attachment":
        effect = Attachment(part=part, point=tuple(point), at=tuple(at))
    elif kind == "hinge":
        effect = Hinge(part=part, point=tuple(point), at=tuple(at), axis=tuple(axis), to_axis=tuple(R @ axis))
    elif kind == "loop":
        effect = Attachment(part=part, point=tuple(point), to=other, at=tuple(S.T @ (at - y)))
    else:
        length = float(np.linalg.norm(at - y))
        effect = Rod(part=part, point=tuple(point), to=other, length=length)
    return tree, effect, q, v


@pytest.mark.parametrize("seed", range(10))
def test_derivatives_of_accelerations(seed, random_tree, random_state):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, massless=True)
    q, v = random_state(rng, tree)
    simulator, tau = Simulator(tree, [GRAVITY]), rng.normal(size=tree.nv)
    by_q, by_v = simulator.acceleration_derivatives(q, v, tau)
    expected = by_difference(tree, lambda q, v: simulator.acceleration(q, v, tau), q, v)
    assert off(np.hstack([by_q, by_v]), expected) < 1e-6  # measured 2e-8


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["attachment", "hinge", "loop", "rod"])
def test_derivatives_of_constrained_accelerations(seed, kind, random_tree, random_state):
    """At a state that fits the constraints, along all directions: also those that leave them."""
    rng = np.random.default_rng(seed)
    tree, effect, q, v = held(rng, random_tree, random_state, kind)
    simulator, tau = Simulator(tree, [GRAVITY, effect]), rng.normal(size=tree.nv)
    simulator.project(q, v)
    if simulator.acceleration(q, v, tau) is not None and simulator.rank < simulator.rows:
        pytest.skip("redundant rows: off the constraints there is no acceleration that meets them all")
    by_q, by_v = simulator.acceleration_derivatives(q, v, tau)
    expected = by_difference(tree, lambda q, v: simulator.acceleration(q, v, tau), q, v)
    assert off(np.hstack([by_q, by_v]), expected) < 1e-5  # measured 4e-7


@pytest.mark.parametrize("seed", range(20))
def test_derivatives_of_any_point_pairs(seed, random_tree, random_state, random_pairs, consistent_velocity):
    """Rows of one or two directions between turning parts, points apart along the free directions."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, size=6, root=JointKind.FREE)
    q, v = random_state(rng, tree)
    pairs = random_pairs(rng, tree, q, 1 + seed % 2)
    v = consistent_velocity(tree, q, v, pairs)
    simulator, tau = Simulator(tree, [GRAVITY, Pairs(pairs=pairs)]), rng.normal(size=tree.nv)
    simulator.acceleration(q, v, tau)
    if simulator.rank < simulator.rows:
        pytest.skip("redundant rows: off the constraints there is no acceleration that meets them all")
    by_q, by_v = simulator.acceleration_derivatives(q, v, tau)
    expected = by_difference(tree, lambda q, v: simulator.acceleration(q, v, tau), q, v)
    assert off(np.hstack([by_q, by_v]), expected) < 1e-5


@pytest.mark.parametrize("kind", ["attachment", "hinge", "loop", "rod"])
def test_tangent_rows(kind, random_tree, random_state):
    """A is the derivative of the rows' errors by q; A_q that of their velocities A v."""
    rng = np.random.default_rng(11)
    tree, effect, q, v = held(rng, random_tree, random_state, kind)
    simulator = Simulator(tree, [GRAVITY, effect])
    simulator.project(q, v)
    A, A_q = simulator.tangent_rows(q, v)
    error = by_difference(tree, lambda q, v: simulator.constraint_error(q, v), q, v)
    rate = by_difference(tree, lambda q, v: simulator.tangent_rows(q, v)[0] @ v, q, v)
    assert off(A, error[:, : tree.nv]) < 1e-8  # measured 1e-10
    assert off(A_q, rate[:, : tree.nv]) < 1e-8
    assert off(A, rate[:, tree.nv :]) < 1e-8
    assert off(A @ v, np.zeros(simulator.rows)) < 1e-11


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_step_of_a_tree(seed, integrator, random_tree, random_state):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, massless=True)
    q, v = random_state(rng, tree)
    simulator = Simulator(tree, [GRAVITY], integrator)
    expected = step_by_difference(simulator, q, v, 0.01)
    F, _ = simulator.linearise(q, v, 0.01, np.zeros(tree.nv))
    assert off(F, expected) < 1e-7  # measured 1e-9


@pytest.mark.parametrize("integrator", ["rk4", "semi_implicit_euler", "lobatto_iiic"])
def test_step_of_a_tree_with_damping(integrator, random_tree, random_state):
    rng = np.random.default_rng(4)
    tree = random_tree(rng, size=5, root=JointKind.FREE)
    q, v = random_state(rng, tree)
    damping = JointDamping(coefficients={link.joint.name: 0.5 for link in tree.links[1:]})
    simulator = Simulator(tree, [GRAVITY, damping], integrator)
    expected = step_by_difference(simulator, q, v, 0.01)
    F, _ = simulator.linearise(q, v, 0.01, np.zeros(tree.nv))
    assert off(F, expected) < 1e-7  # measured 1e-9


def test_linearise_makes_the_step_of_advance(random_tree, random_state):
    """Bit for bit."""
    rng = np.random.default_rng(2)
    tree, effect, q, v = held(rng, random_tree, random_state, "loop")
    for effects in ([GRAVITY], [GRAVITY, effect]):
        for integrator in INTEGRATORS:
            simulator = Simulator(tree, effects, integrator)
            a, b, c, d = q.copy(), v.copy(), q.copy(), v.copy()
            simulator.advance(a, b, 1e-3)
            simulator.linearise(c, d, 1e-3, np.zeros(tree.nv))
            assert np.array_equal(a, c)
            assert np.array_equal(b, d)


@pytest.mark.parametrize(
    ("integrator", "bound"),
    # RK4 leaves the constraints by O(h^5) a step, Euler by O(h^2): so far off F is, which takes the projection for that
    # at the end; measured 3e-8 and 3e-4 at h = 1 ms, 3e-6 at 0.1 ms (Euler, kinds alike)
    [
        ("rk4", 1e-6),
        ("semi_implicit_euler", 5e-3),
        ("implicit_midpoint", 1e-4),
        ("lobatto_iiic", 1e-4),
        ("dop853", 1e-6),
    ],
)
@pytest.mark.parametrize("kind", ["attachment", "hinge", "loop", "rod"])
def test_constrained_step_along_the_constraints(kind, integrator, bound, random_tree, random_state):
    """F times tangent directions; and all columns of F and G satisfy the linearised constraints."""
    rng = np.random.default_rng(6)
    tree, effect, q, v = held(rng, random_tree, random_state, kind)
    simulator = Simulator(tree, [GRAVITY, effect], integrator)
    simulator.project(q, v)
    A, A_q = simulator.tangent_rows(q, v)
    rows = np.block([[A, np.zeros_like(A)], [A_q, A]])
    tangent = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows, tol=1e-9) :].T
    expected = step_by_difference(simulator, q, v, 1e-3) @ tangent
    F, G = simulator.linearise(q, v, 1e-3, np.ones(tree.nv))
    assert off(F @ tangent, expected) < bound
    A, A_q = simulator.tangent_rows(q, v)
    for columns in (F, G):
        assert off(A @ columns[: tree.nv], 0.0 * A[:, :1]) < 1e-10  # measured 3e-13
        assert off(A @ columns[tree.nv :] + A_q @ columns[: tree.nv], 0.0 * A[:, :1]) < 1e-10


def test_force_noise_of_a_free_body(free_top):
    """The double integrator: G G^T = [[h^3/3, h^2/2], [h^2/2, h]] times the squared density over the mass, squared."""
    simulator, h, density = Simulator(free_top), 0.02, 3.0
    q, v, noise = free_top.neutral(), np.zeros(6), np.array([density, 0.0, 0.0, 0.0, 0.0, 0.0])
    _, G = simulator.linearise(q, v, h, noise)
    covariance = (G @ G.T)[np.ix_([0, 6], [0, 6])]
    expected = density**2 * np.array([[h**3 / 3.0, h**2 / 2.0], [h**2 / 2.0, h]])
    assert np.allclose(covariance, expected, rtol=1e-13, atol=0.0)
    assert np.count_nonzero(np.abs(G @ G.T) > 1e-30) == 4
