"""Parameters of a scene by maximum likelihood of recordings, with what the recordings tell of them.

Two deviations are reckoned with. What chance leaves open is the curvature of the likelihood at its maximum, H (the observed
information). That holds as far as the model does: where the model is wrong, parts of the recording pull the numbers farther apart
than chance would, and the deviation is that of the sandwich (Huber 1967, White 1982)

    H^-1 J H^-1,        J: sum of g g^T over parts of the recording, g the slopes of each part's own likelihood,

which says how far the estimate would move if it were made from other such parts. An interval has the larger of the two.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from physics_prior.errors import SceneError, SimulationError
from physics_prior.studies.effects.likelihood import Likelihood, Recordings, likelihood
from physics_prior.studies.effects.parameter import FARTHEST, WIDEST, Parameter, parameters
from physics_prior.studies.effects.search import IMPOSSIBLE, Box, Minimum, descend, slopes
from physics_prior.studies.effects.variant import SceneText

CONFIDENCE = 0.95
FAR, MOST_REFUSED = 1.5, 300  # NIS, and rows a refused measurement, beyond which a start is too far off for a search
WIDER = (
    1.0,
    2.0,
    4.0,
)  # differences, in deviations: through impacts a likelihood is rough, and may have no curvature at less
WIDENINGS = (16.0, 4.0)  # of all noise, from such a start: what fits nowhere has no slope to follow

Told = Callable[[int], None]


@dataclass(frozen=True)
class Fitted:
    """A parameter: its path in the scene file, the file's value, the estimate and the ends of its 95 % interval.

    All in the unit of the file. The ends are NaN where the recording does not determine it. model_error: how many
    times what chance would the parts of the recording pull it apart; the interval is so much wider where that is above 1.
    """

    path: str
    start: float
    value: float
    low: float
    high: float
    model_error: float


class Fit:
    """A scene with its free numbers at their best.

    Attributes:
        found: what the likelihood makes of it.
        minimum: where the search ended.
    """

    def __init__(self, problem: "Problem", minimum: Minimum) -> None:
        self.problem, self.minimum = problem, minimum
        found = problem.likelihood(minimum.x)
        assert found is not None
        self.found = found

    @property
    def scene(self) -> SceneText:
        """The scene that the fitted numbers make."""
        return self.problem.scene_at(self.minimum.x)

    @property
    def numbers(self) -> dict[str, float]:
        """The fitted numbers by path."""
        return self.problem.numbers(self.minimum.x)

    def parameters(self) -> list[Fitted]:
        """The fitted numbers with their intervals; takes some replays more."""
        problem, x = self.problem, self.minimum.x
        if not len(x):
            return []
        z = float(ndtri(0.5 + 0.5 * CONFIDENCE))
        halves, errors = np.full(len(x), math.inf), np.full(len(x), math.nan)
        for wider in WIDER:
            widths = wider * self.minimum.widths
            gradient, curvature, _ = slopes(problem.cost, problem.box, x, self.minimum.cost, widths, None)
            inside = (x > problem.box.lowest) | (gradient <= 0.0)
            told = inside & (np.diag(curvature) > 1.0 / problem.box.highest**2)  # what moves nothing has no interval
            chance = _covariance(curvature[np.ix_(told, told)])
            if np.isfinite(chance).all():
                break
        if np.isfinite(chance).all():
            scores = problem.scores(x, widths)[:, told]
            J = scores.T @ scores * (len(scores) / (len(scores) - 1.0))
            deviations = np.sqrt(np.diag(chance))
            errors[told] = np.sqrt(np.diag(chance @ J @ chance)) / deviations
            halves[told] = z * deviations * np.maximum(1.0, errors[told])
        for i in np.flatnonzero(~inside):  # at zero: up to where the cost has risen by z^2 / 2
            slope, curved = gradient[i], max(curvature[i, i], 0.0)
            halves[i] = z**2 / (slope + math.sqrt(slope**2 + z**2 * curved))
        return [
            Fitted(each.path, each.start, each.number(float(at)), *each.interval(float(at), float(half)), float(error))
            for each, at, half, error in zip(problem.parameters, x, halves, errors, strict=True)
        ]


class Problem:
    """Numbers of a scene that are free, and recordings that are to tell them.

    Attributes:
        scene: the scene as it stands, from which all coordinates count.
        parameters: the free numbers; box: what the search may do with them.
        replays: how many replays of all recordings were made.
    """

    def __init__(
        self,
        scene: SceneText,
        free: Sequence[Parameter],
        recordings: Recordings,
        told: Told = lambda count: None,
    ) -> None:
        self.scene, self.parameters, self.recordings, self.told = scene, list(free), recordings, told
        self.replays, self.widening = 0, 1.0
        self._known: dict[tuple[float, bytes], Likelihood | None] = {}
        self.box = Box(
            np.array([each.lowest for each in free]),
            np.array([each.highest for each in free]),
            np.array([FARTHEST[each.kind] for each in free]),
            np.array([WIDEST[each.kind] for each in free]),
        )

    def numbers(self, x: np.ndarray) -> dict[str, float]:
        """The numbers by path at coordinates x (k,)."""
        return {each.path: each.number(float(value)) for each, value in zip(self.parameters, x, strict=True)}

    def scene_at(self, x: np.ndarray) -> SceneText:
        """The scene at coordinates x (k,)."""
        return self.scene.changed(self.numbers(x))

    def likelihood(self, x: np.ndarray) -> Likelihood | None:
        """The likelihood at coordinates x (k,); None where the scene cannot be or cannot follow the recordings."""
        key = (self.widening, x.tobytes())
        if key not in self._known:
            self.replays += 1
            self.told(self.replays)
            try:
                scene = self.scene_at(x).noisier(self.widening).build()
                self._known[key] = likelihood(scene, self.recordings)
            except SceneError:  # an inertia that is none, a restitution above 1
                self._known[key] = None
        return self._known[key]

    def cost(self, x: np.ndarray) -> float:
        """Minus the log-likelihood at coordinates x (k,)."""
        found = self.likelihood(x)
        return IMPOSSIBLE if found is None else -found.log

    def scores(self, x: np.ndarray, widths: np.ndarray) -> np.ndarray:
        """(parts, k) slopes of each part's own log-likelihood at x, about their mean."""
        columns = []
        for i, width in enumerate(widths):
            ends = [x.copy(), x.copy()]
            ends[0][i] += width
            ends[1][i] = max(x[i] - width, self.box.lowest[i])
            ahead, behind = (self.likelihood(end) for end in ends)
            if ahead is None or behind is None:
                return np.full((2, len(x)), math.nan)
            columns.append((ahead.parts - behind.parts) / (ends[0][i] - ends[1][i]))
        scores = np.array(columns).T
        return np.asarray(scores - scores.mean(axis=0))

    def solve(self, begin: Minimum | None = None) -> Fit:
        """The fit, searched from the scene as it stands or from that of a larger one, less well where it is far worse.

        Where the beginning is far off, noises are widened first and narrowed again on the way.

        Raises:
            SceneError: the scene as it stands is not valid; SimulationError: no values follow the recordings.
        """
        x = np.zeros(len(self.parameters)) if begin is None else begin.x
        try:
            if self.parameters and not self._near(x):
                begin = None
                for self.widening in WIDENINGS:
                    x = descend(self.cost, self.box, x=x).x
            self.widening = 1.0
            minimum = descend(self.cost, self.box, begin, x)
        except SimulationError:
            paths = [each.path for each in self.parameters]
            values = f"no values of {paths} were found with which it follows" if paths else "it does not follow"
            raise SimulationError(f"{self.scene.path}: {values} the recording") from None
        finally:
            self.widening = 1.0
        return Fit(self, minimum)

    def _near(self, x: np.ndarray) -> bool:
        found = self.likelihood(x)
        return found is not None and found.nis < FAR and found.refused * MOST_REFUSED <= found.rows

    def reduced(self, scene: SceneText, chosen: Sequence[int], minimum: Minimum) -> tuple["Problem", Minimum]:
        """The same for another scene with some of the numbers, by index, and where to begin with it."""
        places = np.array(chosen, dtype=int)
        smaller = Problem(scene, [self.parameters[place] for place in chosen], self.recordings, self.told)
        return smaller, minimum.subset(places)


def fit(scene: SceneText, paths: Sequence[str], recordings: Recordings, told: Told = lambda count: None) -> Fit:
    """Fit the numbers at some paths of a scene, and nothing else.

    Raises:
        SceneError: a path leads to no number that can be moved; SimulationError: no values follow the recordings.
    """
    strengths = [f"effects.{label}.{side}" for label in scene.labels for side in scene.strengths(label)]
    return Problem(scene, parameters(scene, paths, strengths), recordings, told).solve()


def _covariance(curvature: np.ndarray) -> np.ndarray:
    """(k, k) covariance that a curvature means; infinite variances where it is not that of a minimum."""
    if not np.isfinite(curvature).all() or np.min(np.linalg.eigvalsh(curvature), initial=1.0) <= 0.0:
        return np.diag(np.full(len(curvature), math.inf))
    return np.asarray(np.linalg.inv(curvature))
