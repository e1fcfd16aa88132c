"""Quantiles of the chi-squared distribution: what a normalised square of so many dimensions may be.

Those of scipy.stats, without what else that holds, which takes longer to load than all of this program.
"""

import numpy as np
from numpy.typing import ArrayLike


def quantile(probability: float, dimension: ArrayLike) -> np.ndarray:
    """What a square of this dimension, or of each of several, is below with this probability."""
    from scipy.special import gammaincinv  # here: it takes longer to load than NumPy, and few commands ask

    return np.asarray(2.0 * gammaincinv(0.5 * np.asarray(dimension), probability))


def interval(probability: float, dimension: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """The lower and upper end of what it is within with this probability, as often below as above."""
    tail = 0.5 * (1.0 - probability)
    return quantile(tail, dimension), quantile(1.0 - tail, dimension)
