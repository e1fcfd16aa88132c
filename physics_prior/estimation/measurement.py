"""Measurements: what was seen, when, and how surely. Odd ones are refused where they are made."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_prior import rotations
from physics_prior.errors import MeasurementError, ModelError

LARGEST = 1e9  # m: beyond it, a position is no measurement
SYMMETRY = 1e-6  # of the largest entry
SINGULAR = 1e-12  # least eigenvalue of the correlations, in which units do not count


@dataclass(frozen=True, eq=False)
class Measurement:
    """Base of all measurements: the stamp in ns and the topic that brought it (its source in the scene)."""

    stamp: int
    topic: str


@dataclass(frozen=True, eq=False)
class PoseMeasurement(Measurement):
    """The pose of a frame: position (3,) m, orientation (4,) quaternion w, x, y, z.

    covariance: (6, 6) of position (world axes) and rotation vector (axes of the measured frame), or None for the scene's.

    Raises:
        MeasurementError: not finite, a zero quaternion, a wrong shape, or a covariance that is none.
    """

    position: np.ndarray
    orientation: np.ndarray
    covariance: np.ndarray | None = None

    def __post_init__(self) -> None:
        _set(self, "position", _finite("position", self.position, (3,)))
        _set(self, "orientation", _orientation(self.orientation))
        _set(self, "covariance", _covariance(self.covariance, 6))


@dataclass(frozen=True, eq=False)
class OrientationMeasurement(Measurement):
    """The orientation (4,) of a frame; covariance (3, 3) of its rotation vector in its own axes, or None."""

    orientation: np.ndarray
    covariance: np.ndarray | None = None

    def __post_init__(self) -> None:
        _set(self, "orientation", _orientation(self.orientation))
        _set(self, "covariance", _covariance(self.covariance, 3))


@dataclass(frozen=True, eq=False)
class PointsMeasurement(Measurement):
    """Positions of markers, (n, 3) m, in the order of the scene; a row of NaN was not seen."""

    points: np.ndarray

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3:
            raise MeasurementError(f"points have shape {points.shape}: give (n, 3) metres")
        _set(self, "points", points)
        _finite("points", points[self.seen], None)

    @cached_property
    def seen(self) -> np.ndarray:
        """Indices of the markers that were seen."""
        return np.flatnonzero(~np.isnan(self.points).any(axis=1))


@dataclass(frozen=True, eq=False)
class JointsMeasurement(Measurement):
    """Coordinates of joints by name, rad or m."""

    names: tuple[str, ...]
    positions: np.ndarray

    def __post_init__(self) -> None:
        if len(set(self.names)) < len(self.names):
            raise MeasurementError(f"names {list(self.names)} are not valid: give each joint once")
        _set(self, "positions", _finite("positions", self.positions, (len(self.names),)))


@dataclass(frozen=True, eq=False)
class ForceMeasurement(Measurement):
    """A force (3,) N by which what holds something is felt, in any axes: its size tells whether it does."""

    force: np.ndarray

    def __post_init__(self) -> None:
        _set(self, "force", _finite("force", self.force, (3,)))


@dataclass(frozen=True, eq=False)
class SwitchCommand(Measurement):
    """An effect that holds something is told to take hold or to let go; its topic is ``command_topic`` of the effect."""

    effect: str
    on: bool


def command_topic(effect: str) -> str:
    """The topic under which commands to an effect stand among measurements."""
    return f"effects/{effect}"


def _set(target: object, name: str, value: object) -> None:
    object.__setattr__(target, name, value)


def _finite(name: str, value: np.ndarray, shape: tuple[int, ...] | None, largest: float = LARGEST) -> np.ndarray:
    array = np.array(value, dtype=float)
    if shape is not None and array.shape != shape:
        raise MeasurementError(f"{name} has shape {array.shape}: give {shape}")
    if not np.all(np.abs(array) <= largest):
        raise MeasurementError(f"{name} {array.tolist()} is not valid: give finite numbers up to {largest:g}")
    return array


def _orientation(value: np.ndarray) -> np.ndarray:
    quaternion = np.array(value, dtype=float)
    try:
        if quaternion.shape != (4,):
            raise ModelError
        return rotations.normalize(quaternion)
    except ModelError:
        raise MeasurementError(
            f"orientation {quaternion.tolist()} is not valid: give a finite quaternion that is not zero"
        ) from None


def _covariance(value: np.ndarray | None, size: int) -> np.ndarray | None:
    if value is None:
        return None
    array = _finite("covariance", value, (size, size), LARGEST**2)
    worst = np.max(np.abs(array))
    if np.max(np.abs(array - array.T)) > SYMMETRY * worst:
        raise MeasurementError("covariance is not symmetric: give one with equal entries across the diagonal")
    deviations = np.sqrt(np.maximum(np.diag(array), 0.0))
    if not deviations.all():
        raise MeasurementError(f"covariance has the diagonal {np.diag(array).tolist()}: give variances above 0")
    least = np.linalg.eigvalsh(array / np.outer(deviations, deviations))[0]
    if least < SINGULAR:
        raise MeasurementError(
            f"covariance has correlations with the eigenvalue {least:g}: give a positive definite one"
        )
    return array
