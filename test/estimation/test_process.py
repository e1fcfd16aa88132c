"""Process models: their derivatives and their noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.process import KinematicProcess, PhysicsProcess, State, steps
from physics_prior.estimation.processes import PROCESSES

seeds = st.integers(0, 2**32 - 1)


def _process(scene, name):
    return PROCESSES[name](scene, Simulator(scene.tree, scene.effects, scene.step.integrator))


def _random_state(scene, process, seed):
    rng = np.random.default_rng(seed)
    start = process.start(scene.initial.q, scene.initial.v)
    return process.displace(start, rng.normal(size=process.n))


@given(st.floats(1e-9, 10.0), st.floats(1e-5, 1.0))
def test_steps_fill_the_time(seconds, size):
    count, h = steps(seconds, size)
    assert count * h == pytest.approx(seconds, rel=1e-12)
    assert h <= size * (1.0 + 1e-8)
    assert count == 1 or seconds / (count - 1) > size


def test_a_whole_number_of_steps_is_not_one_more_by_rounding():
    assert steps(0.03, 0.01)[0] == 3
    assert steps(0.1 + 0.2, 0.1)[0] == 3


@pytest.mark.parametrize("name", PROCESSES)
@given(seed=seeds)
def test_displace_and_difference_are_inverse(every_source, name, seed):
    process = _process(every_source, name)
    start = _random_state(every_source, process, seed)
    error = 0.5 * np.random.default_rng(seed).normal(size=process.n)
    turn = np.linalg.norm(error[3:6]), np.linalg.norm(error[6:9])
    if max(turn) < 3.0:  # beyond pi the shorter way round is another
        found = process.difference(start, process.displace(start, error))
        np.testing.assert_allclose(found, error, atol=1e-13)


@pytest.mark.parametrize("name", ["double_pendulum", "free_body", "ball_on_rod", "four_bar"])
def test_physics_derivative_is_that_of_the_step(shipped, name):
    """Along the constraints: F by central differences of the step, worst 7e-9."""
    scene = shipped(name)
    process = _process(scene, "physics")
    rng = np.random.default_rng(0)
    state = process.start(scene.initial.q.copy(), scene.initial.v + rng.normal(size=scene.tree.nv))
    process.simulator.project(state.q, state.v)
    forward = state.copy()
    F, _ = process.advance(forward, 5e-3)
    basis = np.eye(process.n)
    process.simulator.constrain(state.q, state.v, basis)
    for column in basis.T:
        ends = []
        for sign in (1e-6, -1e-6):
            moved = process.displace(state, sign * column)
            process.simulator.project(moved.q, moved.v)
            process.simulator.advance(moved.q, moved.v, 5e-3)
            ends.append(moved)
        np.testing.assert_allclose(process.difference(ends[1], ends[0]) / 2e-6, F @ column, atol=5e-8)


@pytest.mark.parametrize("name", ["double_pendulum", "ball_on_rod", "four_bar"])
def test_physics_noise_is_that_of_white_forces(shipped, name):
    """G G^T against the covariance of motions under random forces that change a hundred times a step."""
    scene = shipped(name)
    process = _process(scene, "physics")
    simulator, h, fine, count = process.simulator, 5e-3, 100, 400
    q, v = scene.initial.q.copy(), scene.initial.v.copy()
    simulator.project(q, v)
    end = State(q.copy(), v.copy(), np.zeros(0))
    _, G = process.advance(end, h)
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(count):
        moved = State(q.copy(), v.copy(), np.zeros(0))
        for _ in range(fine):
            tau = scene.noise.force * rng.normal(size=simulator.nv) / np.sqrt(h / fine)
            simulator.advance(moved.q, moved.v, h / fine, tau=tau)
        errors.append(process.difference(end, moved))
    sampled, P = np.cov(np.array(errors).T, bias=True), G @ G.T
    deviations = np.sqrt(np.maximum(np.diag(P), 1e-300))
    scale = np.outer(deviations, deviations)
    assert np.max(np.abs(sampled - P) / scale) < 0.3  # 400 samples: 4 deviations of a variance
    assert np.all(np.diag(P) > 0.0)


def test_kinematic_process_is_constant_acceleration_with_white_jerk(every_source):
    """F and G G^T against the matrix exponential of the continuous model (Van Loan 1978)."""
    process = _process(every_source, "kinematic")
    assert isinstance(process, KinematicProcess)
    nv, h = every_source.tree.nv, 0.02
    F, G = process.advance(_random_state(every_source, process, 0), h)
    zero, one = np.zeros((nv, nv)), np.eye(nv)
    A = np.block([[zero, one, zero], [zero, zero, one], [zero, zero, zero]])
    Q = np.zeros((3 * nv, 3 * nv))
    Q[2 * nv :, 2 * nv :] = np.diag(every_source.noise.jerk**2)
    block = expm(h * np.block([[-A, Q], [np.zeros_like(A), A.T]]))
    np.testing.assert_allclose(F, block[3 * nv :, 3 * nv :].T, atol=1e-15)
    np.testing.assert_allclose(G @ G.T, block[3 * nv :, 3 * nv :].T @ block[: 3 * nv, 3 * nv :], rtol=1e-9, atol=1e-15)


def test_kinematic_process_moves_by_its_acceleration(shipped):
    process = _process(shipped("double_pendulum"), "kinematic")
    state = State(np.array([0.1, 0.2]), np.array([1.0, -1.0]), np.array([2.0, 3.0]))
    process.advance(state, 0.1)
    np.testing.assert_allclose(state.q, [0.1 + 0.1 + 0.01, 0.2 - 0.1 + 0.015])
    np.testing.assert_allclose(state.v, [1.2, -0.7])
    assert len(process.start_factor(state)) == 2
    assert isinstance(_process(shipped("double_pendulum"), "physics"), PhysicsProcess)


def test_frozen_derivatives_move_the_state_as_it_is_and_the_covariance_nearly_so(shipped):
    """Four steps of 2.5 ms: the state bit for bit; the covariance by one derivative of 10 ms, worst 6.3e-5 of its largest."""
    scene = shipped("double_pendulum")
    factors, states = [], []
    for name in ("physics", "frozen"):
        process = _process(scene, name)
        state = process.start(scene.initial.q.copy(), scene.initial.v.copy())
        factors.append(process.predict(state, 1e-2 * np.eye(process.n), 2.5e-3, 4))
        states.append(state)
        assert process.simulator.time == pytest.approx(0.01)
    assert np.array_equal(states[0].q, states[1].q)
    assert np.array_equal(states[0].v, states[1].v)
    exact, frozen = (factor @ factor.T for factor in factors)
    assert 0.0 < np.max(np.abs(frozen - exact)) < 2e-4 * np.max(np.abs(exact))
