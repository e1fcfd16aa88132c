"""What a measurement would do to a state: the square-root update of one linearisation."""

from dataclasses import dataclass

import numpy as np

from physics_prior.estimation.observation import Innovation
from physics_prior.estimation.square_root import compressed, innovate

MANY = 24  # rows; fewer are told sooner than compressed


@dataclass(frozen=True, eq=False)
class Gain:
    """An innovation put to use.

    Attributes:
        nis: normalised innovation squared; log_determinant: of the innovation's covariance.
        correction: (n,) error by which the state is corrected; largest: of those of the configuration.
        factor: (n, n) lower factor of the covariance afterwards.
    """

    nis: float
    log_determinant: float
    correction: np.ndarray
    largest: float
    factor: np.ndarray


def gain_of(U: np.ndarray, seen: Innovation) -> Gain:
    """The gain of an innovation for a state whose errors have the factor U (n, n), P = U^T U.

    Where there are many more rows than freedoms, a frame of markers, they are first brought to as many as there are freedoms.
    """
    H, noise, y, rest, log_noise = seen.H, seen.noise, seen.y, 0.0, 0.0
    if len(y) >= MANY and len(y) > H.shape[1]:
        H, y, rest = compressed(*seen.whitened)
        noise, log_noise = np.eye(len(y)), 2.0 * float(np.sum(np.log(np.diag(seen.noise))))
    m, n = len(y), len(U)
    T, scratch, correction = np.empty((m + n, m + n)), np.empty(2 * (m + n)), np.empty(n)
    nis, determinant, largest = innovate(U, H, noise, y, T, scratch, correction)
    return Gain(nis + rest, determinant + log_noise, correction, largest, np.array(T[m:, m:]).T)
