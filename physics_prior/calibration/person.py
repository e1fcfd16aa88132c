"""Segment lengths, joint centres and marker places of a person, from a trial in which markers were seen.

Batch nonlinear least squares over chosen frames (as Reinbolt 2005 and Andersen 2010 do it): the postures of all frames, the
lengths and the places of the markers together explain where the markers were seen. Published proportions and anatomical
places are priors with standard deviations, so that what the motion does not tell stays as they say. Each posture appears in
its own frame only: the normal equations have an arrow's shape, and Schur's complement leaves those of the constants.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from physics_prior import rotations
from physics_prior.calibration.frames import Frames
from physics_prior.calibration.normal_equations import Normal
from physics_prior.errors import MeasurementError
from physics_prior.estimation.start import nearest_rigid_motion
from physics_prior.model.human import HEEL_TO_ANKLE, LENGTHS, SIDED, SIDES, Human
from physics_prior.scene import MarkerSet, NominalMarker

MARKER = 0.006  # m, by which markers leave their places on the bones: skin and cloth
TAIL = 3.0  # standard deviations beyond which a marker counts by its distance and not its square (Huber 1964)
PROPORTION = {
    "pelvis": 0.15,
    "abdomen": 0.15,
    "thorax": 0.1,
    "shoulder_drop": 0.2,
    "hip_width": 0.12,
    "ankle_height": 0.15,
}
LIMB = 0.06  # standard deviation of other lengths over their share of stature; above: of those that people vary more in
STATURE = {"female": (1.63, 0.08), "male": (1.76, 0.08)}  # m: mean and deviation of adults, where none is given
MEASURED_STATURE = 0.01  # m
SOLE = 0.005  # m: how level the sole of a foot that stands is
STILL = 0.1  # m/s: a foot stands whose markers are slower
BALL = 0.45  # of the foot's length, before the ankle
ITERATIONS, ROUGHLY, CONVERGED, LARGEST_DAMPING = 60, 2e-2, 1e-5, 1e8
ENOUGH = 0.45  # of a frame's markers: with fewer it is not chosen
TOLD = 0.8  # of the prior's deviation: a length that is known better than that was told by the trial


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was found.

    Attributes:
        human: the person.
        deviations: length -> m, standard deviation; ``height`` too.
        informed: lengths that the trial tells more of than proportions do.
        places, place_deviations: marker -> (3,) m in its part's frame, and standard deviations.
        noise: marker -> m, root mean square per axis of what is left of it in the trial's frames.
        q: (F, nq) postures; rms: m, of all markers, per axis; frames: how many were used.
    """

    human: Human
    deviations: dict[str, float]
    informed: tuple[str, ...]
    places: dict[str, np.ndarray]
    place_deviations: dict[str, np.ndarray]
    noise: dict[str, float]
    q: np.ndarray
    rms: float
    frames: int


def calibrate(
    stamps: np.ndarray,
    points: np.ndarray,
    markers: MarkerSet,
    human: Human,
    known_height: bool,
    most_frames: int = 60,
    progress: Callable[[float], None] = lambda share: None,
) -> Calibration:
    """Fit a person to a trial.

    Args:
        stamps: (n,) s.
        points: (n, k, 3) m, world axes, z up from the ground, NaN where a marker was not seen.
        markers: the set, k markers in that order.
        human: what is known of the person.
        known_height: whether its height was measured; otherwise it is found too.
        most_frames: how many frames are chosen, evenly.
        progress: told the share that is done.

    Raises:
        MeasurementError: too few frames show enough markers, or no posture explains them.
    """
    return _Fit(stamps, points, markers, human, known_height, most_frames).run(progress)


class _Fit:
    def __init__(
        self, stamps: np.ndarray, points: np.ndarray, markers: MarkerSet, human: Human, known: bool, most: int
    ) -> None:
        if points.shape[1:] != (len(markers.markers), 3):
            raise MeasurementError(
                f"frames have {points.shape[1]} markers: the set '{markers.name}' names {len(markers.markers)}"
            )
        seen = ~np.isnan(points).any(axis=2)
        good = np.flatnonzero(seen.mean(axis=1) > ENOUGH)
        if len(good) < 2:
            raise MeasurementError(f"{len(good)} frames show enough of the markers of '{markers.name}': two are needed")
        chosen = good[np.unique(np.linspace(0, len(good) - 1, most).astype(int))]
        self.points, self.seen, self.markers = points[chosen], seen[chosen], markers
        self.names = list(markers.markers)
        self.standing = {side: self._still(stamps, points, side)[chosen] for side in SIDES}
        self.lengths = [name for name in LENGTHS if name not in SIDED]
        self.lengths += [f"{side}_{name}" for side in SIDES for name in SIDED if name != "foot_width"]
        self.constants = [*self.lengths, "height"]
        self.base = replace(human, lengths={}, rigid=markers.rigid)
        mean, spread = (human.height, MEASURED_STATURE) if known else STATURE[human.sex]
        self.base, self.stature = replace(self.base, height=mean), (mean, spread)
        self.size = len(self.constants) + 3 * len(self.names)
        self.constant = np.array([self._share(name) * mean for name in self.lengths] + [mean])
        self.places = np.array([each.nominal(self.human()) for each in markers.markers.values()])
        self.slopes = self._slopes()

    def _still(self, stamps: np.ndarray, points: np.ndarray, side: str) -> np.ndarray:
        """(n,) whether all markers of a foot are slower than ``STILL``."""
        on = [index for index, each in enumerate(self.markers.markers.values()) if each.part == f"{side}_foot"]
        if not on:
            return np.zeros(len(stamps), dtype=bool)
        speed = np.linalg.norm(np.gradient(points[:, on], stamps, axis=0), axis=2).max(axis=1)
        return np.asarray(np.nan_to_num(speed, nan=np.inf) < STILL)

    def _share(self, name: str) -> float:
        """A length over stature, by the table."""
        side, _, own = name.partition("_") if name.startswith(tuple(SIDES)) else ("", "", name)
        return float(self.base.length(own, side) / self.base.height)

    def human(self) -> Human:
        """The person as now believed."""
        return replace(
            self.base,
            height=float(self.constant[-1]),
            lengths=dict(zip(self.lengths, self.constant.tolist(), strict=False)),
        )

    def _slopes(self) -> dict[str, np.ndarray]:
        """Joint -> (3, size): how its place in its parent goes with the constants; it is linear in each."""
        here, size = self.human(), 0.1
        out = {name: np.zeros((3, self.size)) for name in here.joint_centers()}
        for column, name in enumerate(self.lengths):
            longer = replace(here, lengths={**here.lengths, name: here.lengths[name] + size})
            for joint, (_, place) in longer.joint_centers().items():
                out[joint][:, column] = (place - here.joint_centers()[joint][1]) / size
        return out

    def run(self, progress: Callable[[float], None]) -> Calibration:
        """Postures with published proportions first, then everything."""
        self.q = self._registered()
        self._descend(False, ROUGHLY, lambda share: progress(0.3 * share))
        self._descend(True, CONVERGED, lambda share: progress(0.3 + 0.7 * share))
        progress(1.0)
        return self._result()

    def _registered(self) -> np.ndarray:
        """(F, nq) upright postures, each put where its frame's markers are."""
        tree = self.human().tree()
        neutral = tree.neutral()
        frames = Frames(tree, neutral[None], {}, self.size)
        upright = np.array([frames.points(each.part, place)[0] for each, place in self._each()])
        out = np.tile(neutral, (len(self.points), 1))
        for q, points, seen in zip(out, self.points, self.seen, strict=True):
            R, t = nearest_rigid_motion(upright[seen], points[seen])
            q[:3], q[3:7] = t, rotations.quaternion_from_matrix(R)
        return out

    def _descend(self, free: bool, tolerance: float, progress: Callable[[float], None]) -> None:
        """Levenberg and Marquardt's method down to a relative gain; constants are held unless ``free``."""
        damping, normal = 1e-3, self._normal()
        for iteration in range(ITERATIONS):
            before, worse = (self.q, self.constant, self.places), normal.cost
            self._move(*normal.step(damping, free))
            after = self._normal()
            if after.cost < worse:
                normal, damping = after, damping / 5.0
                if worse - after.cost < tolerance * worse:
                    break
            else:
                self.q, self.constant, self.places = before
                damping *= 10.0
                if damping > LARGEST_DAMPING:
                    break
            progress(iteration / ITERATIONS)

    def _each(self) -> list[tuple[NominalMarker, np.ndarray]]:
        return list(zip(self.markers.markers.values(), self.places, strict=True))

    def _move(self, by_posture: np.ndarray, by_constants: np.ndarray) -> None:
        """Take a step: tangents (F, nv) of the postures, and (size,) of the constants."""
        tree, count = self.human().tree(), len(self.constants)
        self.q = np.array([tree.integrate(q, step) for q, step in zip(self.q, by_posture, strict=True)])
        self.constant = self.constant + by_constants[:count]
        self.places = self.places + by_constants[count:].reshape(-1, 3)

    def _normal(self) -> Normal:
        """The normal equations of all rows, at the present estimate."""
        human = self.human()
        tree, count = human.tree(), len(self.constants)
        frames = Frames(tree, self.q, self.slopes, self.size)
        normal = Normal(len(self.q), tree.nv, self.size)
        self.left = np.full(self.points.shape, np.nan)
        for index, (marker, place) in enumerate(self._each()):
            at = frames.points(marker.part, place)
            by_constants = frames.by_constants[marker.part].copy()
            by_constants[:, :, count + 3 * index : count + 3 * index + 3] += frames.rotation[marker.part]
            error = self.points[:, index] - at
            self.left[:, index] = error
            distance = np.linalg.norm(error, axis=1) / MARKER
            weight = np.where(self.seen[:, index], np.minimum(1.0, TAIL / np.maximum(distance, 1e-9)), 0.0) / MARKER**2
            normal.add(np.nan_to_num(error), frames.by_posture(marker.part, at), by_constants, weight)
        for side in SIDES:
            self._add_sole(normal, frames, human, side)
        self._add_priors(normal, human)
        return normal

    def _add_sole(self, normal: Normal, frames: Frames, human: Human, side: str) -> None:
        """Of a foot that stands, heel and ball of the sole are on the ground."""
        length, height = self.lengths.index(f"{side}_foot"), self.lengths.index(f"{side}_ankle_height")
        for along in (-HEEL_TO_ANKLE, BALL):
            for across in (-0.15, 0.15):
                place = np.array([along, across, 0.0]) * human.length("foot", side)
                place[2] = -human.length("ankle_height", side)
                at = frames.points(f"{side}_foot", place)
                own = np.zeros((3, self.size))
                own[:, length], own[2, height] = [along, across, 0.0], -1.0
                by_constants = frames.by_constants[f"{side}_foot"] + frames.rotation[f"{side}_foot"] @ own
                down = np.array([0.0, 0.0, 1.0])  # only heights count
                weight = np.where(self.standing[side], 1.0 / SOLE**2, 0.0)
                normal.add(
                    -at * down,
                    frames.by_posture(f"{side}_foot", at) * down[:, None],
                    by_constants * down[:, None],
                    weight,
                )

    def _add_priors(self, normal: Normal, human: Human) -> None:
        """Stature; lengths in proportion to it; markers at their anatomical places, in lengths of the segment."""
        count, height = len(self.constants), len(self.lengths)
        row = np.zeros(self.size)
        row[height] = 1.0
        normal.add_prior(self.stature[0] - self.constant[height], row, self.stature[1])
        for index, name in enumerate(self.lengths):
            row = np.zeros(self.size)
            share = self._share(name)
            row[index], row[height] = 1.0, -share
            own = name.removeprefix("left_").removeprefix("right_")
            deviation = PROPORTION.get(own, LIMB) * share * self.stature[0]
            normal.add_prior(share * self.constant[height] - self.constant[index], row, deviation)
        for index, (marker, place) in enumerate(self._each()):
            unit, side = marker.unit()
            length = self.lengths.index(f"{side}_{unit}" if side else unit)
            for axis in range(3):
                row = np.zeros(self.size)
                row[count + 3 * index + axis], row[length] = 1.0, -marker.point[axis]
                normal.add_prior(marker.point[axis] * self.constant[length] - place[axis], row, marker.spread)

    def _result(self) -> Calibration:
        normal = self._normal()
        count = len(self.constants)
        deviation = np.sqrt(np.diag(normal.covariance()))
        of = dict(zip(self.constants, deviation[:count].tolist(), strict=True))
        alone = {
            name: PROPORTION.get(name.split("_", 1)[-1] if name.startswith(tuple(SIDES)) else name, LIMB)
            for name in self.lengths
        }
        informed = tuple(
            name for name in self.lengths if of[name] < TOLD * alone[name] * self._share(name) * self.stature[0]
        )
        squares = np.nansum(self.left**2, axis=(0, 2)) / np.maximum(3 * self.seen.sum(axis=0), 1)
        everything = float(np.sqrt(np.nansum(self.left**2) / max(3 * self.seen.sum(), 1)))
        return Calibration(
            self.human(),
            of,
            informed,
            dict(zip(self.names, self.places, strict=True)),
            dict(zip(self.names, deviation[count:].reshape(-1, 3), strict=True)),
            dict(zip(self.names, np.sqrt(squares).tolist(), strict=True)),
            self.q,
            everything,
            len(self.q),
        )
