"""The covariance stays one: symmetric, positive semi-definite and finite, whatever is measured, however long.

Every posterior of every test is looked at by ``covariances_are_looked_at`` (test/conftest.py); these drive it hard.
"""

from dataclasses import replace

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import PhysicsPriorError
from physics_prior.estimation.filter import Filter
from physics_prior.estimation.measurement import PoseMeasurement
from physics_prior.estimation.processes import PROCESSES
from physics_prior.estimation.start import posterior_at

PERIOD = 10_000_000  # ns between measurements
SMALLEST, LARGEST = -12, 12  # variances, powers of ten


def run(scene, process, updates, seed=0):
    """Measure poses in turn, each variance anything between the smallest and the largest, each gap up to two periods.

    What is measured is the estimate and as much noise as its variance says, so that most of it is believed; now and then it
    is wild. Return how many were believed and the last posterior.
    """
    rng = np.random.default_rng(seed)
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    filter = Filter(scene, simulator, PROCESSES[process](scene, simulator))
    start = posterior_at(filter, scene.initial.q.copy(), 0.1 * np.eye(simulator.nv), 0)
    posterior, believed = start, 0
    sources = scene.measurements
    for k in range(updates):
        stamp = posterior.stamp + int(rng.integers(0, 2 * PERIOD))
        source = sources[k % len(sources)]
        try:
            posterior = filter.predict(posterior, stamp)
        except PhysicsPriorError:  # a wild measurement that was believed may spin the body out of the numbers
            posterior = replace(start, stamp=stamp)
            continue
        variances = 10.0 ** rng.uniform(SMALLEST, LARGEST, size=6)
        deviations = np.sqrt(variances) * (100.0 if rng.random() < 1e-2 else 1.0) * rng.normal(size=6)
        simulator.move(posterior.state.q, posterior.state.v)
        position, R = simulator.pose(source.part)
        orientation = rotations.multiply(rotations.quaternion_from_matrix(R), rotations.exp(deviations[3:]))
        seen = PoseMeasurement(stamp, source.topic, position + deviations[:3], orientation, np.diag(variances))
        posterior = filter.update(posterior, seen)
        believed += posterior.used is True
    return believed, posterior


@pytest.mark.parametrize(
    ("name", "process"), [("pendulum", "physics"), ("four_bar", "physics"), ("ball_on_rod", "kinematic")]
)
def test_variances_of_any_size(shipped, name, process):
    """1e-12 to 1e12 m^2 and rad^2, with gaps from none to 20 ms."""
    believed, posterior = run(shipped(name), process, 300)
    assert believed > 200
    assert 0.0 < np.max(np.abs(posterior.factor)) < 1e3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "process", "updates"),
    [
        ("pendulum", "physics", 1_000_000),
        ("pendulum", "kinematic", 200_000),
        ("four_bar", "physics", 100_000),
        ("ball_on_rod", "physics", 100_000),
        ("free_body", "physics", 100_000),
    ],
)
def test_for_ever(shipped, name, process, updates):
    """A million updates leave the covariance as sound as the first."""
    believed, posterior = run(shipped(name), process, updates)
    assert believed > 0.7 * updates
    assert 0.0 < np.max(np.abs(posterior.factor)) < 1e3
