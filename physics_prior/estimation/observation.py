"""Observation models: what a state lets a source see, how that depends on the state, and how noisy it is."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from physics_prior.dynamics.algebra import (
    get3,
    get9,
    minus,
    plus,
    product,
    put3,
    rotation_of,
    times,
    transposed,
    transposed_times,
)
from physics_prior.dynamics.arrays import copy
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import point_jacobian
from physics_prior.dynamics.rotation_vector import vector_of
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.types import Array, Records
from physics_prior.errors import MeasurementError
from physics_prior.estimation.measurement import (
    ForceMeasurement,
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.estimation.square_root import block_squares, whiten
from physics_prior.model import JointKind
from physics_prior.scene import (
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    SwitchSource,
)


@dataclass(frozen=True, eq=False)
class Innovation:
    """A measurement against a state: y ~ H dx + noise, dx the tangent of q.

    Attributes:
        y: (m,) measured less expected.
        H: (m, nv) derivative of what is expected by the tangent of q.
        noise: (m, m) lower factor of the measurement's covariance.
        block: how many rows are believed or refused together; the noise of such blocks is independent.
    """

    y: np.ndarray
    H: np.ndarray
    noise: np.ndarray
    block: int

    def kept(self, blocks: np.ndarray) -> "Innovation":
        """Only some of its blocks, (m / block,) of bool."""
        rows = np.repeat(blocks, self.block)
        return Innovation(self.y[rows], self.H[rows], self.noise[np.ix_(rows, rows)], self.block)

    @cached_property
    def whitened(self) -> tuple[np.ndarray, np.ndarray]:
        """H and y in standard deviations of the noise, and independent of each other."""
        H, y = self.H.copy(), self.y.copy()
        whiten(self.noise, self.block, H, y)
        return H, y

    def squares(self, U: np.ndarray) -> np.ndarray:
        """(m / block,) normalised innovation squared of each block alone; the state's covariance is U^T U, U (n, n)."""
        out, n = np.empty(len(self.y) // self.block), len(U)
        T, scratch = np.empty((self.block + n, self.block)), np.empty(n + 2 * self.block)
        block_squares(*self.whitened, U, self.block, T, scratch, out)
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


def innovation(source: MeasurementSource, measurement: Measurement, simulator: Simulator, q: np.ndarray) -> Innovation:
    """The innovation of a measurement at a configuration q (nq,); its kinematics must be up to date (``move``).

    Rotations are compared in the tangent space of the expected one, log(R_expected^T R_measured), in the measured frame's
    axes (Sola 2017, ch. 4). m may be 0, where no marker is seen. The measurement must fit its source (``check``).
    """
    if isinstance(source, PoseSource) and isinstance(measurement, PoseMeasurement):
        y, H = _frame_seen(simulator, source, source.scale * measurement.position, measurement.orientation)
        if measurement.covariance is not None:
            to_metres = np.repeat([source.scale, 1.0], 3)
            return Innovation(y, H, to_metres[:, None] * np.linalg.cholesky(measurement.covariance), 6)
        return Innovation(y, H, _alike(3, source.position_noise, source.orientation_noise), 6)
    if isinstance(source, OrientationSource) and isinstance(measurement, OrientationMeasurement):
        y, H = _frame_seen(simulator, source, NOWHERE, measurement.orientation)
        if measurement.covariance is not None:
            return Innovation(y[3:], H[3:], np.linalg.cholesky(measurement.covariance), 3)
        return Innovation(y[3:], H[3:], _alike(3, source.orientation_noise), 3)
    if isinstance(source, PointsSource) and isinstance(measurement, PointsMeasurement):
        seen = measurement.seen
        y, H = np.empty(3 * len(seen)), np.empty((3 * len(seen), simulator.nv))
        links, places = _markers(simulator, source)
        scratch = np.empty((6, simulator.nv))
        memory = simulator.memory
        see_points(memory.links, memory.work, links[seen], places[seen], measurement.points[seen], y, H, scratch)
        noise = tuple(source.markers[index].noise or source.noise for index in seen)
        return Innovation(y, H, _alike(3, *noise), 3)
    assert isinstance(source, JointSource)
    assert isinstance(measurement, JointsMeasurement)
    y, H = np.zeros(len(measurement.names)), np.zeros((len(measurement.names), simulator.nv))
    for row, name in enumerate(measurement.names):
        link = simulator.tree.link(source.joints[name])
        y[row] = measurement.positions[row] - q[link.q][0]
        if link.joint.kind is JointKind.REVOLUTE:  # an encoder may wrap where it likes
            y[row] = (y[row] + np.pi) % (2.0 * np.pi) - np.pi
        H[row, link.v] = 1.0
    return Innovation(y, H, _alike(len(y), source.noise), max(len(y), 1))


@kernel
def see_frame(
    links: Records,
    work: Records,
    link: int,
    place: Array,
    axes: Array,
    position: Array,
    orientation: Array,
    y: Array,
    H: Array,
) -> None:
    """Fill y (6,) and H (6, nv) with what a measured pose says of the frame at place (3,) with axes (3, 3) on a link."""
    point_jacobian(links, work, link, place, H)
    p, R = get3(place), get9(axes.reshape(-1))
    if link >= 0:
        here = work[link]
        p, R = plus(get3(here.origin), times(get9(here.rotation), p)), product(get9(here.rotation), R)
    seen = rotation_of(orientation[0], orientation[1], orientation[2], orientation[3])
    put3(y[:3], minus(get3(position), p))
    put3(y[3:], vector_of(product(transposed(R), seen)))
    for k in range(H.shape[1]):
        turn, shift = (H[0, k], H[1, k], H[2, k]), (H[3, k], H[4, k], H[5, k])
        put3(H[:3, k], shift)
        put3(H[3:, k], transposed_times(R, turn))


@kernel
def see_points(
    links: Records, work: Records, on: Array, places: Array, points: Array, y: Array, H: Array, scratch: Array
) -> None:
    """Fill y (3 k,) and H (3 k, nv) with what measured points (k, 3) say of places (k, 3) on links (k,); scratch (6, nv)."""
    for i in range(points.shape[0]):
        p, link = get3(places[i]), on[i]
        point_jacobian(links, work, link, places[i], scratch)
        if link >= 0:
            here = work[link]
            p = plus(get3(here.origin), times(get9(here.rotation), p))
        put3(y[3 * i : 3 * i + 3], minus(get3(points[i]), p))
        for c in range(3):
            copy(scratch[3 + c], H[3 * i + c])


NOWHERE = np.zeros(3)


def _frame_seen(
    simulator: Simulator, source: PoseSource | OrientationSource, position: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The innovation y (6,) and H (6, nv) of a measured pose of the source's frame."""
    y, H = np.empty(6), np.empty((6, simulator.nv))
    frame = simulator.frame(source.part, source.frame.position, source.frame.orientation)
    see_frame(simulator.memory.links, simulator.memory.work, *frame, position, orientation, y, H)
    return y, H


def _markers(simulator: Simulator, source: PointsSource) -> tuple[np.ndarray, np.ndarray]:
    """(k,) link and (k, 3) place on it of each marker."""
    frames = [simulator.frame(marker.part, marker.point) for marker in source.markers]
    return np.array([link for link, _, _ in frames]), np.array([place for _, place, _ in frames])


@lru_cache(maxsize=64)  # which markers are seen changes from frame to frame
def _alike(count: int, *deviations: float) -> np.ndarray:
    """The lower factor of independent noise, ``count`` numbers of each deviation."""
    return np.diag(np.repeat(deviations, count))
