"""What a measurement would do to a state: the square-root update of one linearisation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from physics_prior.estimation.observation import Innovation
from physics_prior.estimation.square_root import compressed, correct, innovate

MANY = 24  # rows; fewer are told sooner than compressed


@dataclass(frozen=True, eq=False)
class Gain:
    """An innovation put to use.

    Attributes:
        nis: normalised innovation squared; log_determinant: of the innovation's covariance.
        correction: (n,) error by which the state is corrected; largest: of those that were seen.
        factor: returns the (n, n) lower factor of the covariance afterwards.
    """

    nis: float
    log_determinant: float
    correction: np.ndarray
    largest: float
    factor: Callable[[], np.ndarray]


def gain_of(U: np.ndarray, seen: Innovation) -> Gain:
    """The gain of an innovation for a state whose errors have the factor U (n, n), P = U^T U.

    Where there are many more rows than freedoms, a frame of markers, they are first brought to as many as there are freedoms,
    and the factor, which only the last of the passes of an iterated update needs, is found when it is asked for.
    """
    if len(seen.y) >= MANY and len(seen.y) > seen.H.shape[1]:
        return _of_many(U, seen)
    m, n = len(seen.y), len(U)
    T, scratch, correction = np.empty((m + n, m + n)), np.empty(2 * (m + n)), np.empty(n)
    H = np.ascontiguousarray(seen.H.T)
    nis, determinant, largest = innovate(U, H, seen.first, seen.noise, seen.y, T, scratch, correction)
    return Gain(nis, determinant, correction, largest, lambda: np.array(T[m:, m:]).T)


def _of_many(U: np.ndarray, seen: Innovation) -> Gain:
    H, y, rest = compressed(*seen.whitened)
    H, m, n = np.ascontiguousarray(H.T), len(y), len(U)
    scratch, correction, one = np.empty(2 * (m + n)), np.empty(n), np.eye(m)
    nis, determinant, largest = correct(U, H, seen.first, y, np.empty((m + n, m)), scratch, correction)

    def factor() -> np.ndarray:
        T = np.empty((m + n, m + n))
        innovate(U, H, seen.first, one, y, T, scratch, np.empty(n))
        return np.array(T[m:, m:]).T

    of_noise = 2.0 * float(np.sum(np.log(np.diag(seen.noise))))
    return Gain(nis + rest, determinant + of_noise, correction, largest, factor)
