"""Quantiles are those of scipy.stats."""

import numpy as np
import pytest
from scipy.stats import chi2

from physics_prior.estimation import chi_squared


@pytest.mark.parametrize("probability", [1e-6, 0.025, 0.5, 0.95, 0.999999])
def test_quantiles_and_intervals_are_scipys(probability):
    dimension = np.array([1.0, 2.0, 3.0, 6.0, 135.0, 1e5])
    np.testing.assert_array_equal(chi_squared.quantile(probability, dimension), chi2.ppf(probability, dimension))
    for own, theirs in zip(
        chi_squared.interval(probability, dimension), chi2.interval(probability, dimension), strict=True
    ):
        np.testing.assert_allclose(own, theirs, rtol=1e-12)  # 1e-14
