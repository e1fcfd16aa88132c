"""What a measurement would do to a state: the square-root update of one linearisation."""

from dataclasses import dataclass

import numpy as np

from physics_prior.estimation.observation import Innovation
from physics_prior.estimation.reflection import apply, reflect, work_size
from physics_prior.estimation.square_root import compressed

MANY = 24  # rows; fewer are told sooner than compressed


@dataclass(eq=False, slots=True)
class Gain:
    """An innovation put to use.

    Attributes:
        nis: normalised innovation squared; log_determinant: of the innovation's covariance.
        change: by how much the errors that were seen differ at most from those that the innovation was found at.
        correction: (n,) error by which the state is corrected.
        U, work: the factor of the state's errors, and how it is reflected (reflection.py) by so many rows.
    """

    nis: float
    log_determinant: float
    change: float
    correction: np.ndarray
    U: np.ndarray
    work: np.ndarray
    rows: int

    def factor(self) -> np.ndarray:
        """A factor (n, n) of the covariance afterwards, which only the last pass of an iterated update needs."""
        out = np.empty_like(self.U)
        apply(self.work, self.rows, self.U, out)
        return out.T


def gain_of(U: np.ndarray, seen: Innovation, about: np.ndarray) -> Gain:
    """The gain of an innovation for a state whose errors have the factor U (n, n), P = U^T U.

    about (h,): the errors of that state at which the innovation was found. Where there are many more rows than freedoms, a frame
    of markers, they are first brought to as many as there are freedoms.
    """
    y, H, noise, rest, of_noise = seen.y, seen.H, seen.noise, 0.0, 0.0
    if len(y) >= MANY and len(y) > H.shape[1]:
        H, y, rest = compressed(*seen.whitened)
        of_noise = 2.0 * float(np.sum(np.log(np.diag(noise))))
        noise = np.eye(len(y))
    m, n = len(y), len(U)
    work, correction = np.empty(work_size(m, n)), np.empty(n)
    H = np.ascontiguousarray(H.T)
    nis, determinant, change = reflect(U, H, seen.first, noise, y, about, work, correction)
    return Gain(nis + rest, determinant + of_noise, change, correction, U, work, m)
