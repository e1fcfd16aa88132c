"""Normal equations of an arrow's shape (Triggs 2000, ch. 6): postures stand in one frame each, constants in all."""

import numpy as np

FLOOR = 1e-6  # of a frame's largest: freedoms that no marker tells are damped by it
TINY = 1e-9  # damping that keeps these invertible


class Normal:
    """J^T W J and J^T W e of rows e ~ J x, x the postures of F frames, (nv,) each, and (c,) constants.

    Attributes:
        cost: e^T W e.
    """

    def __init__(self, count: int, nv: int, constants: int) -> None:
        self.A, self.B = np.zeros((count, nv, nv)), np.zeros((count, nv, constants))
        self.C = np.zeros((constants, constants))
        self.posture, self.constant = np.zeros((count, nv)), np.zeros(constants)
        self.cost = 0.0

    def add(self, error: np.ndarray, by_posture: np.ndarray, by_constants: np.ndarray, weight: np.ndarray) -> None:
        """Add three rows a frame: error (F, 3), derivatives (F, 3, nv) and (F, 3, c), weight (F,)."""
        P, K = by_posture.transpose(0, 2, 1) * weight[:, None, None], by_constants * weight[:, None, None]
        self.A += P @ by_posture
        self.B += P @ by_constants
        self.C += np.tensordot(K, by_constants, axes=((0, 1), (0, 1)))
        self.posture += (P @ error[:, :, None])[:, :, 0]
        self.constant += np.tensordot(K, error, axes=((0, 1), (0, 1)))
        self.cost += float(np.sum(weight[:, None] * error**2))

    def add_prior(self, error: float, row: np.ndarray, deviation: float) -> None:
        """Add a row of the constants alone."""
        self.C += np.outer(row, row) / deviation**2
        self.constant += row * error / deviation**2
        self.cost += (error / deviation) ** 2

    def step(self, damping: float, free: bool) -> tuple[np.ndarray, np.ndarray]:
        """The step (F, nv), (c,) of Levenberg and Marquardt; constants stay unless ``free``."""
        A = self.A + damping * self._diagonal()
        alone = np.linalg.solve(A, self.posture[:, :, None])
        if not free:
            return alone[:, :, 0], np.zeros(len(self.constant))
        shared = np.linalg.solve(A, self.B)
        S = self.C - np.tensordot(self.B, shared, axes=((0, 1), (0, 1)))
        S += damping * np.diag(np.diag(self.C))
        constants = np.linalg.solve(S, self.constant - np.tensordot(self.B, alone[:, :, 0], axes=((0, 1), (0, 1))))
        return alone[:, :, 0] - shared @ constants, constants

    def covariance(self) -> np.ndarray:
        """(c, c) of the constants, postures unknown."""
        shared = np.linalg.solve(self.A + TINY * self._diagonal(), self.B)
        return np.asarray(np.linalg.inv(self.C - np.tensordot(self.B, shared, axes=((0, 1), (0, 1)))))

    def _diagonal(self) -> np.ndarray:
        """(F, nv, nv) the diagonals of A, none of them zero."""
        d = np.diagonal(self.A, axis1=1, axis2=2)
        return np.asarray(np.eye(self.A.shape[1]) * np.maximum(d, FLOOR * d.max(axis=1, keepdims=True))[:, None, :])
