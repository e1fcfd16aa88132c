"""Scoring forces of the ground against force plates: how far each component is off, as gait laboratories say it.

Components are vertical (against gravity), anterior-posterior (the way that is walked) and medio-lateral (to the walker's left).
The relative error is the root mean square error over the mean of both peak-to-peak ranges (Ren et al. 2008; Fluit et al. 2014).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.center_of_mass import center_of_mass
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.wrench import Wrench
from physics_prior.effects.touching import Footing
from physics_prior.errors import RecordingError
from physics_prior.scene import Scene

TOTAL = "total"
COMPONENTS = ("vertical", "anterior_posterior", "medio_lateral")
LOADED = 0.02  # of the weight: what carries less is not stood on
WALKED = 0.1  # m: who goes less far is not walking, and faces where the first part does
NEAR, USUALLY = 0.05, 0.9  # m that a plate's centre of pressure may be off a sole, for this share of the time
LEVEL = 1e-6  # of the weight: a range that rounding makes


@dataclass(frozen=True, eq=False)
class Plate:
    """A recorded force plate.

    Attributes:
        topic: where it was recorded.
        stamps: (k,) ns, ascending.
        wrenches: (k, 6) force ON the body and moment about the frame's origin, world axes, N and N m; NaN where unknown.
        force: the scene's force that it is known to measure; None where that is to be found.
    """

    topic: str
    stamps: np.ndarray
    wrenches: np.ndarray
    force: str | None = None

    def at(self, stamps: np.ndarray) -> np.ndarray:
        """(len(stamps), 6) wrenches at stamps, ns, interpolated; NaN outside the recording."""
        since, known = stamps - self.stamps[0], self.stamps - self.stamps[0]  # whole ns are too long for a double
        columns = [np.interp(since, known, column, left=np.nan, right=np.nan) for column in self.wrenches.T]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Stamps (k,) ns, and forces (k, 3) N of an estimate and of what was measured, by component."""

    stamps: np.ndarray
    estimated: np.ndarray
    measured: np.ndarray

    def figures(self, weight: float) -> dict[str, dict[str, float | None]]:
        """Of each component: error over the mean range [%], over the weight [%], correlation; and s that were compared."""
        return {name: self._figures(index, weight) for index, name in enumerate(COMPONENTS)}

    def _figures(self, index: int, weight: float) -> dict[str, float | None]:
        ours, theirs = self.estimated[:, index], self.measured[:, index]
        rmse = float(np.sqrt(np.mean((ours - theirs) ** 2)))
        ranges = np.ptp(ours), np.ptp(theirs)
        moving = min(ranges) > LEVEL * weight
        return {
            "rrmse_percent": 100.0 * rmse / float(np.mean(ranges)) if max(ranges) > LEVEL * weight else None,
            "percent_weight": 100.0 * rmse / weight,
            "r": float(np.corrcoef(ours, theirs)[0, 1]) if moving else None,
            "seconds": float(np.median(np.diff(self.stamps)) * len(self.stamps) * 1e-9) if len(ours) > 1 else 0.0,
        }


class ForceScore:
    """Collects what the ground does to an estimate, and compares it with plates.

    Raises:
        RecordingError: nothing of the scene stands on the ground, or nothing weighs.
    """

    def __init__(self, scene: Scene, simulator: Simulator, plates: Sequence[Plate]) -> None:
        self._simulator, self._plates = simulator, tuple(plates)
        self._feet: dict[str, Footing] = {}
        for effect in scene.effects:
            self._feet |= effect.footings(scene.tree)
        if not self._feet:
            raise RecordingError(
                f"nothing of scene '{scene.name}' stands on the ground: {plates[0].topic} needs an effect such as contact"
            )
        field = np.sum([np.zeros(3), *(effect.field() for effect in scene.effects)], axis=0)
        self.weight = float(scene.tree.mass * np.linalg.norm(field))
        if self.weight == 0.0:
            raise RecordingError(f"scene '{scene.name}' has no gravity: forces cannot be told in its weight")
        self._up = -field / np.linalg.norm(field)
        self._stamps: list[int] = []
        self._forces: list[list[np.ndarray]] = []
        self._soles: list[list[tuple[np.ndarray, np.ndarray]]] = []
        self._centers: list[np.ndarray] = []
        self._ahead = np.zeros(3)

    def add(self, stamp: int, q: np.ndarray, v: np.ndarray, wrenches: Mapping[str, Wrench]) -> None:
        """Note an estimate's state and its forces, by name, at a stamp, ns."""
        simulator = self._simulator
        simulator.move(q, v)
        if not self._stamps:
            self._ahead = simulator.pose(simulator.tree.parts[0].name)[1][:, 0]
        self._stamps.append(stamp)
        self._forces.append([wrenches[name].force for name in self._feet])
        self._soles.append([simulator.pose(foot.surface.part) for foot in self._feet.values()])
        self._centers.append(center_of_mass(simulator))

    def comparisons(self) -> dict[str, Comparison]:
        """The sum of what carries, and each plate that one foot alone stands on, while it does."""
        if not self._stamps:
            return {}
        order = np.argsort(self._stamps, kind="stable")
        stamps, forces = np.array(self._stamps)[order], np.array(self._forces)[order]
        plates = [plate.at(stamps) for plate in self._plates]
        known = [np.isfinite(plate[:, :3]).all(axis=1) for plate in plates]
        loaded = [
            ok & (plate[:, :3] @ self._up > LOADED * self.weight) for ok, plate in zip(known, plates, strict=True)
        ]
        owners = [self._owner(*each, order) for each in zip(self._plates, plates, loaded, strict=True)]
        axes = self._axes(stamps, np.array(self._centers)[order])
        all_known = np.all(known, axis=0)
        standing = forces @ self._up > LOADED * self.weight
        everything = all_known & ~self._beside(standing, loaded, owners)
        total = np.sum([plate[:, :3] for plate in plates], axis=0)
        out = {}
        if everything.any():
            out[TOTAL] = Comparison(
                stamps[everything], forces.sum(axis=1)[everything] @ axes.T, total[everything] @ axes.T
            )
        for plate, wrench, own, owner in zip(self._plates, plates, loaded, owners, strict=True):
            if owner is not None and own.any():
                out[plate.topic] = Comparison(stamps[own], forces[own, owner] @ axes.T, wrench[own, :3] @ axes.T)
        return out

    def _owner(self, plate: Plate, wrenches: np.ndarray, loaded: np.ndarray, order: np.ndarray) -> int | None:
        """The index of the one foot that stands on a plate: at its centre of pressure; None if it is not one alone."""
        names = list(self._feet)
        if plate.force in names:
            return names.index(plate.force)
        seen = loaded & np.isfinite(wrenches).all(axis=1)
        if not seen.any():
            return None
        near = np.array([list(self._distances(order[k], wrenches[k])) for k in np.flatnonzero(seen)])
        best = int(np.argmin(near.mean(axis=0)))
        alone = (near[:, best] < NEAR) & (np.argmin(near, axis=1) == best)
        return best if np.mean(alone) > USUALLY else None

    def _distances(self, index: int, wrench: np.ndarray) -> Iterator[float]:
        """How far a force's line passes by each sole, in its plane, m."""
        force, moment = wrench[:3], wrench[3:]
        pressure = np.cross(self._up, moment) / (self._up @ force)  # in the level plane through the origin
        for foot, (origin, R) in zip(self._feet.values(), self._soles[index], strict=True):
            surface = foot.surface
            center = origin + R @ surface.position
            at = pressure + force * (self._up @ (center - pressure)) / (self._up @ force)
            own = rotations.matrix_from_quaternion(surface.orientation).T @ R.T @ (at - center)
            yield float(np.linalg.norm(np.maximum(np.abs(own) - surface.halves, 0.0)))

    def _beside(self, standing: np.ndarray, loaded: Sequence[np.ndarray], owners: Sequence[int | None]) -> np.ndarray:
        """(k,) whether a foot stands that no plate bears in all the time from its landing to its leaving."""
        beside = np.zeros(len(standing), dtype=bool)
        for foot, own in enumerate(standing.T):
            bearing = np.zeros(len(own), dtype=bool)
            for load, owner in zip(loaded, owners, strict=True):
                if owner is None or owner == foot:
                    bearing |= load
            for begin, end in _spans(own):
                if not bearing[begin:end].any():
                    beside[begin:end] = True
        return beside

    def _axes(self, stamps: np.ndarray, centers: np.ndarray) -> np.ndarray:
        """(3, 3) rows: up, ahead, left. Ahead is where the centre of mass goes over the ground, which may move (a treadmill)."""
        ground = np.mean([foot.velocity for foot in self._feet.values()], axis=0)
        way = centers[-1] - centers[0] - ground * (stamps[-1] - stamps[0]) * 1e-9
        level = np.eye(3) - np.outer(self._up, self._up)
        ahead = level @ way
        if np.linalg.norm(ahead) < WALKED:
            ahead = level @ self._ahead
        if np.linalg.norm(ahead) < WALKED:  # it lies on its face
            ahead = level[:, int(np.argmin(np.abs(self._up)))]
        ahead /= np.linalg.norm(ahead)
        return np.array([self._up, ahead, np.cross(self._up, ahead)])


def _spans(own: np.ndarray) -> Iterator[tuple[int, int]]:
    """Beginning and end of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], own, [False]]).astype(int)))
    return zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
