"""Quaternion equations of motion: agreement with generalized coordinates, the norm constraint, references."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from physics_prior import rotations
from physics_prior.dynamics.formulations import generalized, quaternion
from physics_prior.dynamics.formulations.newton_euler import Q
from physics_prior.dynamics.formulations.quaternion import RATE
from physics_prior.errors import SimulationError

GRAVITY = np.array([0.3, -0.2, -9.81])
DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(params=range(20))
def moving(request, random_tree, random_state):
    """A random tree, a state and joint forces; some with massless links."""
    rng = np.random.default_rng(200 + request.param)
    tree = random_tree(rng, massless=request.param % 2 == 0)
    q, v = random_state(rng, tree)
    return rng, tree, q, v, rng.normal(size=tree.nv)


@pytest.fixture(params=range(5))
def spinning(request):
    """Moments, attitude, angular velocity and torque, both in body axes, of one body."""
    rng = np.random.default_rng(request.param)
    return (
        np.array([1.0, 2.0, 2.5]),
        rotations.normalize(rng.normal(size=4)),
        rng.normal(size=3),
        rng.normal(size=3),
    )


def integrate(system, q, v, times):
    """States (times, n, 14) from q, v by DOP853 at 1e-12, no forces but gravity: equation 5 as it stands."""
    start = system.state(q, v)
    tau = np.zeros(len(v))
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


def test_body_turns_as_euler_says(spinning):
    moments, q, spin, torque = spinning
    qdot = rotations.derivative(q, spin)
    qddot, _ = quaternion.rotational_motion(q, qdot, moments, torque)
    euler = (torque - np.cross(spin, moments * spin)) / moments
    np.testing.assert_allclose(rotations.angular_velocity_body(q, qddot), euler, rtol=0.0, atol=1e-13)  # measured 3e-15
    assert q @ qddot == pytest.approx(-qdot @ qdot, abs=1e-14)


def test_multiplier_is_twice_the_kinetic_energy_torque_or_not(spinning):
    moments, q, spin, torque = spinning
    for load in (np.zeros(3), torque):
        _, multiplier = quaternion.rotational_motion(q, rotations.derivative(q, spin), moments, load)
        assert multiplier == pytest.approx(spin @ (moments * spin), rel=1e-13)


def test_mass_has_rank_three(spinning):
    moments, q, _, _ = spinning
    mass = quaternion.rotational_mass(q, moments)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(mass), [0.0, *(4.0 * moments)], rtol=0.0, atol=1e-13
    )  # measured 9e-15
    np.testing.assert_allclose(mass @ q, 0.0, rtol=0.0, atol=1e-14)  # measured 6e-16


def test_tree_moves_as_in_generalized_coordinates(moving):
    _, tree, q, v, tau = moving
    expected = generalized.accelerations(tree, q, v, tau, GRAVITY)
    found = quaternion.accelerations(tree, q, v, tau, GRAVITY)
    np.testing.assert_allclose(
        found.acceleration, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max()
    )  # measured 9e-14 relative
    assert found.rank == 0
    assert found.forces.shape == (0, 3)


@pytest.mark.parametrize("copies", [1, 2])
def test_constrained_tree_moves_as_in_generalized_coordinates(copies, moving, random_pairs, consistent_velocity):
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 2)
    v = consistent_velocity(tree, q, v, pairs)
    expected = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs * copies)
    found = quaternion.accelerations(tree, q, v, tau, GRAVITY, pairs * copies)
    scale = 1.0 + np.abs(expected.acceleration).max()
    np.testing.assert_allclose(
        found.acceleration, expected.acceleration, rtol=0.0, atol=1e-10 * scale
    )  # measured 2e-14 of scale
    assert found.rank == expected.rank
    _, J = generalized.constraint_jacobian(tree, q, pairs * copies)
    if found.rank == len(J):  # where rows repeat, the split of the force is not unique
        bound = 1e-10 * (1.0 + np.abs(expected.forces).max())
        np.testing.assert_allclose(found.forces, expected.forces, rtol=0.0, atol=bound)  # measured 2e-14 relative


def test_states_and_trees_translate_into_each_other(moving):
    _, tree, q, v, _ = moving
    system = quaternion.QuaternionCoordinates(tree, GRAVITY)
    state = system.state(q, v)
    found_q, found_v = system.generalized(state)
    np.testing.assert_allclose(found_v, v, rtol=0.0, atol=1e-12)  # measured 9e-15
    np.testing.assert_allclose(
        system.state(found_q, found_v)[:, :3], state[:, :3], rtol=0.0, atol=1e-12
    )  # measured 9e-15
    np.testing.assert_allclose(
        np.sum(state[:, Q] * state[:, RATE], axis=1), 0.0, rtol=0.0, atol=1e-14
    )  # measured 2e-16


def test_torque_free_top_follows_the_reference(free_top, reference):
    """Spinning about the middle axis, through its first flip."""
    expected = reference("torque_free_asymmetric_top.csv")[:601:20]
    system = quaternion.QuaternionCoordinates(free_top, np.zeros(3))
    spin = np.array([1e-3, 5.0, 1e-3])
    states = integrate(system, free_top.neutral(), np.concatenate([np.zeros(3), spin]), expected["t"])
    attitude = np.stack([expected[name] for name in ("qw", "qx", "qy", "qz")], axis=1)
    turn = rotations.log(rotations.multiply(rotations.conjugate(attitude), states[:, 0, Q]))
    np.testing.assert_allclose(turn, 0.0, rtol=0.0, atol=1e-7)  # measured 8e-10
    spins = rotations.angular_velocity_body(states[:, 0, Q], states[:, 0, RATE])
    np.testing.assert_allclose(spins[:, 1], expected["wy_body"], rtol=0.0, atol=1e-7)  # measured 5e-10


def test_heavy_top_follows_the_reference(heavy_top, reference):
    expected = reference("heavy_top_fast.csv")[:41]
    system = quaternion.QuaternionCoordinates(heavy_top, DOWN)
    states = integrate(system, heavy_top.neutral(), np.array([0.0, 150.0, -4.61538]), expected["t"])
    center = np.stack([expected[name] for name in "xyz"], axis=1)
    np.testing.assert_allclose(states[:, 0, :3], center, rtol=0.0, atol=1e-9)  # measured 2e-13
    np.testing.assert_allclose(np.linalg.norm(states[:, 0, Q], axis=1), 1.0, rtol=0.0, atol=1e-10)  # measured 1e-12


def test_states_that_are_not_finite_are_refused(double_pendulum):
    with pytest.raises(SimulationError, match="not finite"):
        quaternion.accelerations(double_pendulum, np.array([np.nan, 0.0]), *np.zeros((2, 2)), DOWN)
