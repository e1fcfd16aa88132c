"""What the implicit midpoint rule keeps: quadratic invariants at any step, and energy without a trend."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity

GRAVITY = Gravity(acceleration=(0.0, 0.0, -9.81))


@pytest.mark.parametrize("h", [1e-3, 1e-2, 0.1, 0.5])
def test_free_top_keeps_energy_and_momentum_at_any_step(h, free_top):
    simulator, inertia = Simulator(free_top, [], "implicit_midpoint"), np.array([1.0, 2.0, 3.0])
    q, v = free_top.neutral(), np.array([0.3, -0.2, 0.1, 0.4, 2.0, -0.7])
    energy, momentum = v[3:] @ (inertia * v[3:]), np.linalg.norm(inertia * v[3:])
    for _ in range(100):
        simulator.advance(q, v, h, 10)
        assert v[3:] @ (inertia * v[3:]) == pytest.approx(energy, rel=1e-12)  # measured 7e-14
        assert np.linalg.norm(inertia * v[3:]) == pytest.approx(momentum, rel=1e-12)
        assert np.allclose(v[:3], [0.3, -0.2, 0.1], rtol=0.0, atol=1e-14)


def test_energy_of_a_pendulum_has_no_trend(double_pendulum):
    """1e5 steps of 10 ms: the error swings within its first range."""
    simulator = Simulator(double_pendulum, [GRAVITY], "implicit_midpoint")
    q, v = np.array([0.5, 0.5]), np.zeros(2)
    simulator.move(q, v)
    start, errors = simulator.energy(), []
    for _ in range(20_000):
        simulator.advance(q, v, 0.01, 5)
        simulator.move(q, v)
        errors.append(simulator.energy() - start)
    size = np.abs(errors).reshape(10, -1).max(axis=1)
    middle = np.mean(np.reshape(errors, (10, -1)), axis=1)
    assert size[0] < 1e-3  # J; measured 1.2e-4
    assert size.max() < 1.05 * size[0]  # measured 1.01
    assert np.ptp(middle) < 0.01 * size[0]  # measured 8e-4
