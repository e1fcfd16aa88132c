"""Observation models: what a state lets a source see, how that depends on the state, and how noisy it is."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from physics_prior.dynamics.algebra import (
    get3,
    get9,
    minus,
    plus,
    product,
    put3,
    rotation_of,
    scale,
    times,
    transposed,
    transposed_times,
)
from physics_prior.dynamics.arrays import copy
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import point_jacobian, pose
from physics_prior.dynamics.rotation_vector import vector_of
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.types import Array, Records
from physics_prior.errors import MeasurementError
from physics_prior.estimation.frame import block_squares, work_size
from physics_prior.estimation.measurement import (
    ForceMeasurement,
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.estimation.square_root import whiten
from physics_prior.model import JointKind
from physics_prior.scene import (
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    SwitchSource,
)


@dataclass(eq=False)
class Innovation:
    """A measurement against a state: y ~ H dx + noise, dx the tangent of q or other errors in a row.

    Attributes:
        y: (m,) measured less expected.
        H: (m, h) derivative of what is expected by h errors of the state.
        noise: (m, m) lower factor of the measurement's covariance.
        block: how many rows are believed or refused together; the noise of such blocks is independent.
        first: of these errors; that of q where left out.
        links: (m / block,) on which link each block is; None where blocks are no markers.
    """

    y: np.ndarray
    H: np.ndarray
    noise: np.ndarray
    block: int
    first: int = 0
    links: np.ndarray | None = None

    def kept(self, blocks: np.ndarray) -> "Innovation":
        """Only some of its blocks, (m / block,) of bool."""
        rows = np.repeat(blocks, self.block)
        return Innovation(self.y[rows], self.H[rows], self.noise[np.ix_(rows, rows)], self.block, self.first)

    @cached_property
    def whitened(self) -> tuple[np.ndarray, np.ndarray]:
        """H and y in standard deviations of the noise, and independent of each other."""
        H, y = self.H.copy(), self.y.copy()
        whiten(self.noise, self.block, H, y)
        return H, y

    def squares(self, U: np.ndarray) -> np.ndarray:
        """(m / block,) normalised innovation squared of each block alone; U (n, n), P = U^T U, triangular in what is seen."""
        (H, y), k = self.whitened, self.block
        out = np.empty(len(y) // k)
        block_squares(H, y, U, np.empty(work_size(*H.shape)), np.empty((k, k)), np.empty(k), out)
        return out


FITS = {
    PoseSource: PoseMeasurement,
    OrientationSource: OrientationMeasurement,
    PointsSource: PointsMeasurement,
    JointSource: JointsMeasurement,
    SwitchSource: ForceMeasurement,
}
"""Which measurement each kind of source brings."""


def check(source: MeasurementSource, measurement: Measurement) -> None:
    """Raise MeasurementError if a measurement is not of the source's kind or names what the source does not know."""
    if not isinstance(measurement, FITS[type(source)]):
        raise MeasurementError(
            f"topic '{source.topic}' is a {type(source).__name__}: a {type(measurement).__name__} does not fit it"
        )
    if isinstance(source, PointsSource) and isinstance(measurement, PointsMeasurement):
        count, expected = len(measurement.points), len(source.markers)
        if count != expected:
            raise MeasurementError(f"topic '{source.topic}' brought {count} points: the scene names {expected}")
    if isinstance(source, JointSource) and isinstance(measurement, JointsMeasurement):
        for name in measurement.names:
            if name not in source.joints:
                raise MeasurementError(f"joint '{name}' is not one of the source's: {list(source.joints)}")


class Observer(ABC):
    """How a source sees the states of a simulator; what is the same for all measurements is found once."""

    @abstractmethod
    def innovation(self, measurement: Any, q: np.ndarray) -> Innovation:
        """A measurement, which must fit the source (``check``), against a configuration q (nq,).

        Where the simulator's links are is then known for that. Rotations are compared in the tangent space of the expected
        one, log(R_expected^T R_measured), in the measured frame's axes (Sola 2017, ch. 4). m may be 0, where no marker is seen.
        """


class PoseObserver(Observer):
    """Sees a frame of a part."""

    def __init__(self, source: PoseSource, simulator: Simulator) -> None:
        self._frame, self._scale = PartFrame(source, simulator), source.scale
        self._noise = np.diag(np.repeat([source.position_noise, source.orientation_noise], 3))

    def innovation(self, measurement: PoseMeasurement, q: np.ndarray) -> Innovation:
        y, H = self._frame.seen(q, measurement.position, measurement.orientation, self._scale)
        if measurement.covariance is None:
            return Innovation(y, H, self._noise, 6)
        to_metres = np.repeat([self._scale, 1.0], 3)
        return Innovation(y, H, to_metres[:, None] * np.linalg.cholesky(measurement.covariance), 6)


class OrientationObserver(Observer):
    """Sees which way a frame of a part is turned."""

    def __init__(self, source: OrientationSource, simulator: Simulator) -> None:
        self._frame = PartFrame(source, simulator)
        self._noise = source.orientation_noise * np.eye(3)

    def innovation(self, measurement: OrientationMeasurement, q: np.ndarray) -> Innovation:
        y, H = self._frame.seen(q, NOWHERE, measurement.orientation)
        covariance = measurement.covariance
        return Innovation(y[3:], H[3:], self._noise if covariance is None else np.linalg.cholesky(covariance), 3)


class PointsObserver(Observer):
    """Sees markers, some of them."""

    def __init__(self, source: PointsSource, simulator: Simulator) -> None:
        frames = [simulator.frame(marker.part, marker.point) for marker in source.markers]
        self._links = np.array([link for link, _, _ in frames])
        self._places = np.array([place for _, place, _ in frames])
        self._noise = np.diag(np.repeat([marker.noise or source.noise for marker in source.markers], 3))
        self._memory, self._scratch = simulator.memory, np.empty((6, simulator.nv))

    def innovation(self, measurement: PointsMeasurement, q: np.ndarray) -> Innovation:
        seen, points = measurement.seen, measurement.points
        links, places, noise = self._links, self._places, self._noise
        if len(seen) < len(points):
            rows = np.repeat(3 * seen, 3) + np.tile(np.arange(3), len(seen))
            links, places, points, noise = links[seen], places[seen], points[seen], noise[np.ix_(rows, rows)]
        y, H = np.empty(3 * len(seen)), np.empty((3 * len(seen), self._scratch.shape[1]))
        see_points(self._memory.links, self._memory.work, q, links, places, points, y, H, self._scratch)
        return Innovation(y, H, noise, 3, links=links)


class JointsObserver(Observer):
    """Sees coordinates of joints."""

    def __init__(self, source: JointSource, simulator: Simulator) -> None:
        self._links = {name: simulator.tree.link(joint) for name, joint in source.joints.items()}
        self._noise, self._nv = source.noise, simulator.nv

    def innovation(self, measurement: JointsMeasurement, q: np.ndarray) -> Innovation:
        y, H = np.zeros(len(measurement.names)), np.zeros((len(measurement.names), self._nv))
        for row, name in enumerate(measurement.names):
            link = self._links[name]
            y[row] = measurement.positions[row] - q[link.q][0]
            if link.joint.kind is JointKind.REVOLUTE:  # an encoder may wrap where it likes
                y[row] = (y[row] + np.pi) % (2.0 * np.pi) - np.pi
            H[row, link.v] = 1.0
        return Innovation(y, H, self._noise * np.eye(len(y)), max(len(y), 1))


class PartFrame:
    """A frame of a part, and what a measured pose says of it."""

    def __init__(self, source: PoseSource | OrientationSource, simulator: Simulator) -> None:
        self._links, self._work = simulator.memory.links, simulator.memory.work
        link, place, axes = simulator.frame(source.part, source.frame.position, source.frame.orientation)
        self._place = link, place, axes.reshape(-1)
        self._scratch = np.empty((6, simulator.nv))

    def seen(
        self, q: np.ndarray, position: np.ndarray, orientation: np.ndarray, unit: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """The innovation y (6,) and H (6, nv) of a measured position (3,), in units of so many m, and orientation (4,)."""
        y, by_error = np.empty(6), np.empty((self._scratch.shape[1], 6))
        see_frame(self._links, self._work, q, *self._place, position, orientation, unit, y, by_error, self._scratch)
        return y, by_error.T


NOWHERE = np.zeros(3)
OBSERVERS: dict[type[MeasurementSource], Any] = {
    PoseSource: PoseObserver,
    OrientationSource: OrientationObserver,
    PointsSource: PointsObserver,
    JointSource: JointsObserver,
}
"""What sees by each kind of source that is of the configuration."""


@kernel
def see_frame(
    links: Records,
    work: Records,
    q: Array,
    link: int,
    place: Array,
    axes: Array,
    position: Array,
    orientation: Array,
    unit: float,
    y: Array,
    H: Array,
    scratch: Array,
) -> None:
    """Fill y (6,) and H (nv, 6), transposed, with what a measured pose says at q of the frame at place (3,) on a link.

    axes (9,): of the frame; unit: of the position, m; scratch (6, nv).
    """
    pose(links, work, q)
    point_jacobian(links, work, link, place, scratch)
    p, R = get3(place), get9(axes)
    if link >= 0:
        here = work[link]
        p, R = plus(get3(here.origin), times(get9(here.rotation), p)), product(get9(here.rotation), R)
    seen = rotation_of(orientation[0], orientation[1], orientation[2], orientation[3])
    put3(y[:3], minus(scale(unit, get3(position)), p))
    put3(y[3:], vector_of(product(transposed(R), seen)))
    for k in range(H.shape[0]):
        put3(H[k, :3], (scratch[3, k], scratch[4, k], scratch[5, k]))
        put3(H[k, 3:], transposed_times(R, (scratch[0, k], scratch[1, k], scratch[2, k])))


@kernel
def see_points(
    links: Records, work: Records, q: Array, on: Array, places: Array, points: Array, y: Array, H: Array, scratch: Array
) -> None:
    """Fill y (3 k,) and H (3 k, nv) with what measured points (k, 3) say at q of places (k, 3) on links (k,).

    scratch (6, nv).
    """
    pose(links, work, q)
    for i in range(points.shape[0]):
        p, link = get3(places[i]), on[i]
        point_jacobian(links, work, link, places[i], scratch)
        if link >= 0:
            here = work[link]
            p = plus(get3(here.origin), times(get9(here.rotation), p))
        put3(y[3 * i : 3 * i + 3], minus(get3(points[i]), p))
        for c in range(3):
            copy(scratch[3 + c], H[3 * i + c])
