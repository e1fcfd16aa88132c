"""What a measurement would do to a state: the square-root update of one linearisation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from physics_prior.estimation import frame, reflection
from physics_prior.estimation.observation import Innovation

MANY = 24  # rows; fewer are told sooner one by one


@dataclass(eq=False, slots=True)
class Gain:
    """An innovation put to use.

    Attributes:
        nis: normalised innovation squared; log_determinant: of the innovation's covariance.
        change: by how much the errors that were seen differ at most from those that the innovation was found at.
        correction: (n,) error by which the state is corrected.
        factor: returns a factor (n, n) of the covariance afterwards, which only the last pass of an iterated update needs.
    """

    nis: float
    log_determinant: float
    change: float
    correction: np.ndarray
    factor: Callable[[], np.ndarray]


def gain_of(U: np.ndarray, seen: Innovation, about: np.ndarray) -> Gain:
    """The gain of an innovation for a state whose errors have the factor U (n, n), P = U^T U.

    about (h,): the errors of that state at which the innovation was found. Of more rows than freedoms, a frame of markers, U has
    to be triangular in its first h columns.
    """
    if len(seen.y) >= MANY and len(seen.y) > seen.H.shape[1]:
        return _of_frame(U, seen, about)
    m, n = len(seen.y), len(U)
    work, correction, H = np.empty(reflection.work_size(m, n)), np.empty(n), np.ascontiguousarray(seen.H.T)
    figures = reflection.reflect(U, H, seen.first, seen.noise, seen.y, about, work, correction)

    def factor() -> np.ndarray:
        out = np.empty_like(U)
        reflection.apply(work, m, U, out)
        return out.T

    return Gain(*figures, correction, factor)


def _of_frame(U: np.ndarray, seen: Innovation, about: np.ndarray) -> Gain:
    H, y = seen.whitened
    m, h = H.shape
    work, correction = np.empty(frame.work_size(m, h)), np.empty(len(U))
    figures = frame.reflect_frame(U, H, seen.noise, y, about, work, correction)

    def factor() -> np.ndarray:
        out = np.empty_like(U)
        frame.apply_frame(work, m, h, U, out)
        return out.T

    return Gain(*figures, correction, factor)
