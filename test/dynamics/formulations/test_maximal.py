"""Maximal coordinates: agreement with generalized ones, the joints' rows, references."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from physics_prior import rotations
from physics_prior.dynamics.formulations import generalized, maximal, point_pairs
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.newton_euler import Q, V, W
from physics_prior.errors import SimulationError
from physics_prior.inertia import point_mass
from physics_prior.model import Joint, JointKind, Part, Tree

GRAVITY = np.array([0.3, -0.2, -9.81])
DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(params=range(20))
def moving(request, random_tree, random_state):
    """A random tree, a state and joint forces; some with massless links."""
    rng = np.random.default_rng(100 + request.param)
    tree = random_tree(rng, massless=request.param % 2 == 0)
    q, v = random_state(rng, tree)
    return rng, tree, q, v, rng.normal(size=tree.nv)


def integrate(system, q, v, times):
    """States (times, n, 13) from q, v by DOP853 at 1e-12, no forces but gravity: equation 3 as it stands."""
    start = system.state(q, v)
    tau = np.zeros(system.tree.nv)
    out = solve_ivp(
        lambda _, y: system.derivative(y.reshape(start.shape), tau).ravel(),
        (times[0], times[-1]),
        start.ravel(),
        method="DOP853",
        t_eval=times,
        rtol=1e-12,
        atol=1e-12,
    )
    assert out.success
    return out.y.T.reshape(-1, *start.shape)


def test_tree_moves_as_in_generalized_coordinates(moving):
    _, tree, q, v, tau = moving
    expected = generalized.accelerations(tree, q, v, tau, GRAVITY)
    found = maximal.accelerations(tree, q, v, tau, GRAVITY)
    np.testing.assert_allclose(
        found.acceleration, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max()
    )  # measured 4e-15 relative
    assert found.rank == 0
    assert found.forces.shape == (0, 3)


@pytest.mark.parametrize("copies", [1, 2])
def test_constrained_tree_moves_as_in_generalized_coordinates(copies, moving, random_pairs, consistent_velocity):
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 2)
    v = consistent_velocity(tree, q, v, pairs)
    expected = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs * copies)
    found = maximal.accelerations(tree, q, v, tau, GRAVITY, pairs * copies)
    scale = 1.0 + np.abs(expected.acceleration).max()
    np.testing.assert_allclose(
        found.acceleration, expected.acceleration, rtol=0.0, atol=1e-10 * scale
    )  # measured 8e-12 of scale
    assert found.rank == expected.rank
    _, J = generalized.constraint_jacobian(tree, q, pairs * copies)
    if found.rank == len(J):  # where rows repeat, the split of the force is not unique
        bound = 1e-10 * (1.0 + np.abs(expected.forces).max())
        np.testing.assert_allclose(
            found.forces, expected.forces, rtol=0.0, atol=bound
        )  # measured 3e-11 relative, rows nearly dependent


def test_states_and_trees_translate_into_each_other(moving):
    _, tree, q, v, _ = moving
    system = maximal.MaximalCoordinates(tree, GRAVITY)
    state = system.state(q, v)
    found_q, found_v = system.generalized(state)
    np.testing.assert_allclose(found_v, v, rtol=0.0, atol=1e-12)  # measured 6e-15
    for link in tree.links:
        turns = link.joint.kind is JointKind.REVOLUTE
        full_turns = 2.0 * np.pi * np.round((q - found_q)[link.q] / (2.0 * np.pi)) if turns else 0.0
        sign = np.sign(found_q[link.q] @ q[link.q]) if link.joint.kind is JointKind.SPHERICAL else 1.0
        np.testing.assert_allclose(sign * found_q[link.q] + full_turns, q[link.q], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(system.residual(state), 0.0, rtol=0.0, atol=1e-13)  # measured 1e-15


def test_joint_rows_forbid_what_the_joints_do_and_nothing_else(moving):
    """The rows of the joints are the left null space of T: A T = 0, one for each freedom that is missing."""
    _, tree, q, v, _ = moving
    system = maximal.MaximalCoordinates(tree, GRAVITY)
    T, Tdot = system.bodies.velocity_map(kinematics(tree, q, v))
    A, gamma = point_pairs.rows(system.joints, system.state(q, v))
    np.testing.assert_allclose(A @ T, 0.0, rtol=0.0, atol=1e-12)  # measured 6e-15
    np.testing.assert_allclose(A @ (Tdot @ v), gamma, rtol=0.0, atol=1e-11)  # measured 2e-14
    assert len(A) == np.linalg.matrix_rank(A) == 6 * len(tree.links) - tree.nv


def test_joint_loads_do_the_work_of_tau(moving):
    _, tree, q, v, tau = moving
    system = maximal.MaximalCoordinates(tree, GRAVITY)
    T, _ = system.bodies.velocity_map(kinematics(tree, q, v))
    loads = system.bodies.joint_loads(system.state(q, v), tau)
    np.testing.assert_allclose(T.T @ loads.ravel(), tau, rtol=0.0, atol=1e-12)  # measured 7e-15


def test_derivative_is_the_newton_euler_equation(free_top):
    rng = np.random.default_rng(0)
    system = maximal.MaximalCoordinates(free_top, GRAVITY)
    q = rotations.normalize(rng.normal(size=4))
    state = system.state(np.concatenate([rng.normal(size=3), q]), rng.normal(size=6))
    tau = rng.normal(size=6)
    rate = system.derivative(state, tau)[0]
    spin, moments = state[0, W], np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(rate[:3], state[0, V])
    np.testing.assert_allclose(rate[Q], rotations.derivative(state[0, Q], spin))
    np.testing.assert_allclose(rate[V], GRAVITY + tau[:3], rtol=1e-14)
    np.testing.assert_allclose(rate[W], (tau[3:] - np.cross(spin, moments * spin)) / moments, rtol=1e-13)


def test_double_pendulum_follows_the_reference(double_pendulum, reference):
    expected = reference("double_pendulum_moderate.csv")[:51]
    system = maximal.MaximalCoordinates(double_pendulum, DOWN)
    states = integrate(system, np.array([0.5, 0.5]), np.zeros(2), expected["t"])
    q = np.array([system.generalized(state)[0] for state in states])
    np.testing.assert_allclose(q[:, 0], expected["theta1"], rtol=0.0, atol=1e-10)  # measured 8e-13
    np.testing.assert_allclose(q.sum(axis=1), expected["theta2"], rtol=0.0, atol=1e-10)  # measured 9e-13
    drift = [np.abs(system.residual(state)).max() for state in states]
    assert max(drift) < 1e-11


def test_heavy_top_follows_the_reference(heavy_top, reference):
    expected = reference("heavy_top_fast.csv")[:41]
    system = maximal.MaximalCoordinates(heavy_top, DOWN)
    states = integrate(system, heavy_top.neutral(), np.array([0.0, 150.0, -4.61538]), expected["t"])
    center = np.stack([expected[name] for name in "xyz"], axis=1)
    np.testing.assert_allclose(states[:, 0, :3], center, rtol=0.0, atol=1e-9)  # measured 2e-13


def test_motion_without_inertia_is_refused():
    """A point mass in free flight has no orientation to speak of; on a hinge it has."""
    bead = Part("bead", point_mass(1.0))
    flying = Tree([bead], [Joint("flight", JointKind.FREE, "world", "bead")])
    with pytest.raises(SimulationError, match="has no inertia"):
        maximal.accelerations(flying, flying.neutral(), np.zeros(6), np.zeros(6), DOWN)
    hanging = Tree(
        [Part("bead", point_mass(1.0, (1.0, 0.0, 0.0)))],
        [Joint("hinge", JointKind.REVOLUTE, "world", "bead", axis=np.array([0.0, 1.0, 0.0]))],
    )
    motion = maximal.accelerations(hanging, np.zeros(1), np.zeros(1), np.zeros(1), DOWN)
    np.testing.assert_allclose(motion.acceleration, [9.81], rtol=1e-13)


def test_states_that_are_not_finite_are_refused(double_pendulum):
    with pytest.raises(SimulationError, match="not finite"):
        maximal.accelerations(double_pendulum, np.zeros(2), np.array([0.0, np.inf]), np.zeros(2), DOWN)
