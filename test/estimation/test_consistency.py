"""Consistency: what the estimator says of its own errors is true, over many simulated runs.

Measurements and forces are drawn from the scene's noise, nothing else is. Then the normalised error at the end of each run
(NEES) is chi-square of the freedoms the constraints leave, and the innovations are white with the covariance that the filter
says (NIS); their means must lie in the bands of chi-square. Within a run errors are correlated, so that NEES counts once a
run; innovations are not. The first 0.2 s of innovations are left out: the velocity's deviation at the start is a bound on
what may come, not what these scenes start with.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.square_root import normalised_error
from physics_prior.recording.simulate import EPOCH

SETTLED = 200_000_000  # ns


@pytest.mark.parametrize(
    ("name", "runs", "freedoms"),
    [
        ("double_pendulum", 100, 4),
        ("four_bar", 100, 2),
        ("ball_on_rod", 40, 10),
        ("thrown_cube", 40, 12),
        ("free_body", 40, 12),
    ],
)
def test_errors_are_as_large_as_said(shipped, filter_of, moments_of, name, runs, freedoms):
    scene = shipped(name)
    process = filter_of(scene).process
    nees, nis, dimension = [], 0.0, 0
    for seed in range(runs):
        nodes = []
        estimator = Estimator(scene)
        estimator.on_settled = nodes.append
        moments = moments_of(scene, seed=1000 + seed, duration=1.5)
        for moment in moments:
            for measurement in moment.measurements:
                estimator.add(measurement)
        estimator.finish()
        for node in nodes:
            if node.measurement.stamp - EPOCH >= SETTLED:
                nis += node.posterior.nis
                dimension += node.posterior.dimension
        last = nodes[-1].posterior
        error = process.difference(last.state, process.start(moments[-1].q, moments[-1].v))
        value, rank = normalised_error(last.factor, error)
        assert rank == freedoms
        nees.append(value)
    low, high = chi2.ppf([0.025, 0.975], runs * freedoms) / runs
    print(f"{name}: mean NEES {np.mean(nees):.3f} in [{low:.3f}, {high:.3f}]", end="; ")
    assert low < np.mean(nees) < high
    low, high = chi2.ppf([0.025, 0.975], dimension) / dimension
    print(f"mean NIS a dimension {nis / dimension:.4f} in [{low:.4f}, {high:.4f}] of {dimension}")
    assert low < nis / dimension < high
