"""Consistency: what the estimator says of its own errors is true, over many simulated runs.

Measurements and forces are drawn from the scene's noise, nothing else is. Then the normalised error at the end of each run
(NEES) is chi-square of the freedoms the constraints leave, and the innovations are white with the covariance that the filter
says (NIS); their means must lie in the bands of chi-square. Within a run errors are correlated, so that NEES counts once a
run; innovations are not. The first 0.2 s of innovations are left out: the velocity's deviation at the start is a bound on
what may come, not what these scenes start with.

The bands are narrow enough: were the filter's force noise 0.7 or 1.4 times its size, the two rods' NEES would be 5.08 or 2.74.
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
    [  # mean NEES in its band; mean NIS a dimension in its band, as measured
        ("double_pendulum", 100, 4),  # 3.632 in [3.465, 4.573]; 0.9971 in [0.9902, 1.0099]
        ("four_bar", 100, 2),  # 2.009 in [1.627, 2.411]; 0.9978 in [0.9920, 1.0081]
        ("ball_on_rod", 40, 10),  # 10.751 in [8.662, 11.433]; 0.9944 in [0.9781, 1.0221]
        ("thrown_cube", 40, 12),  # 12.122 in [10.530, 13.565]; 0.9931 in [0.9781, 1.0221]
        ("free_body", 40, 12),  # 11.980 in [10.530, 13.565]; 0.9932 in [0.9781, 1.0221]
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
        estimator.reset()
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
    assert low < np.mean(nees) < high
    low, high = chi2.ppf([0.025, 0.975], dimension) / dimension
    assert low < nis / dimension < high
