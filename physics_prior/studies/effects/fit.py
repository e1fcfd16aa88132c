"""Parameters of a scene by maximum likelihood of a recording, with what the recording tells of them.

Each is fitted as a factor on what the scene file says, in the logarithm, so that it keeps its sign. Intervals come from the
curvature of the likelihood at its maximum (the observed information): they hold as far as the model does.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import norm

from physics_prior.errors import SimulationError
from physics_prior.estimation.measurement import Measurement
from physics_prior.studies.effects.likelihood import likelihood
from physics_prior.studies.effects.variant import SceneText

WIDEST = math.log(1e3)  # a factor is sought between 1/1000 and 1000
FIRST_WIDTH, NARROWEST, WIDTH = 0.03, 1e-4, 0.3  # of the logarithm: differences at first, at least and at most
FARTHEST, FLATTEST = 0.5, 1e-3  # steps of the logarithm at most; least curvature that counts, of unit diagonals
GAIN, PASSES = 0.01, 15  # of log-likelihood, below which a search ends, and how many steps it may take
CONFIDENCE = 0.95
FAR, MOST_REFUSED = 1.5, 50  # NIS, and rows a refused measurement, beyond which a start is too far off for a search
WIDENINGS = (16.0, 4.0, 1.0)  # of all noise, from such a start: what fits nowhere has no slope to follow
IMPOSSIBLE = 1e12  # minus the log-likelihood of a motion that leaves the numbers


@dataclass(frozen=True)
class Fitted:
    """A parameter: its path in the scene file, the file's value, the estimate and the ends of its 95 % interval.

    All in the unit of the file. The ends are NaN where the recording does not determine it.
    """

    path: str
    start: float
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Fit:
    """Fitted parameters, the scene that they make and the log-likelihoods before (NaN if there was none) and after."""

    parameters: list[Fitted]
    scene: SceneText
    before: float
    after: float


def fit(
    scene: SceneText,
    paths: Sequence[str],
    measurements: Sequence[Measurement],
    told: Callable[[int], None] = lambda count: None,
) -> Fit:
    """Fit the numbers at some paths of a scene to measurements; told is told how many replays were made.

    Raises:
        SceneError: a path leads to no number that can be scaled; SimulationError: no values follow the recording.
    """
    start = np.array([scene.number(path) for path in paths])
    replays = 0

    def cost(logarithms: np.ndarray, widening: float = 1.0) -> float:
        nonlocal replays
        replays += 1
        told(replays)
        found = likelihood(_changed(scene, paths, logarithms).noisier(widening).build(), measurements)
        return IMPOSSIBLE if found is None else -found.log

    best = np.zeros(len(paths))
    first = likelihood(scene.build(), measurements)
    before = math.nan if first is None else first.log
    near = first is not None and first.nis < FAR and first.refused * MOST_REFUSED <= first.rows
    widths = np.full(len(paths), FIRST_WIDTH)
    for widening in (1.0,) if near else WIDENINGS:
        best, widths, curvature = _climb(partial(cost, widening=widening), best, widths)
    lowest = cost(best)
    if lowest == IMPOSSIBLE:
        raise SimulationError(
            f"{scene.path}: no values of {list(paths)} were found with which it follows the recording"
        )
    deviations = _deviations(curvature)
    z = float(norm.ppf(0.5 + 0.5 * CONFIDENCE))
    parameters = []
    for path, number, logarithm, deviation in zip(paths, start, best, deviations, strict=True):
        value = float(number * math.exp(logarithm))
        wide = not deviation * z < WIDEST
        ends = (
            sorted((value * math.exp(-z * deviation), value * math.exp(z * deviation))) if not wide else [math.nan] * 2
        )
        parameters.append(Fitted(path, float(number), value, ends[0], ends[1]))
    return Fit(parameters, _changed(scene, paths, best), before, -lowest)


def _changed(scene: SceneText, paths: Sequence[str], logarithms: np.ndarray) -> SceneText:
    return scene.scaled({path: math.exp(each) for path, each in zip(paths, logarithms, strict=True)})


def _climb(
    cost: Callable[[np.ndarray], float], x: np.ndarray, widths: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method from x (k,): where the cost is least, a deviation of each number there, and the curvature (k, k).

    Differences are central and as wide as a deviation (widths, from the pass before): narrower, they would meet the
    roughness of the gate, and of one side only, they would shift the minimum by half their width.
    """
    here = cost(x)
    for _ in range(PASSES):
        gradient, curvature = _slopes(cost, x, here, widths)
        curved = np.diag(curvature)
        widths = np.clip(1.0 / np.sqrt(np.maximum(curved, 1e-6)), NARROWEST, WIDTH)
        scale = np.sqrt(np.maximum(np.abs(curved), 1e-6))  # of a unit curvature, in which directions are alike
        values, vectors = np.linalg.eigh(curvature / np.outer(scale, scale))
        downhill = vectors.T @ (gradient / scale) / np.maximum(np.abs(values), FLATTEST)
        step = -(vectors @ downhill) / scale
        step *= min(1.0, FARTHEST / max(float(np.max(np.abs(step))), 1e-300))
        if -0.5 * float(gradient @ step) < GAIN:
            break
        there = cost(x + step)
        while there >= here and float(np.max(np.abs(step))) > NARROWEST:
            step *= 0.5
            there = cost(x + step)
        if there >= here:
            break
        x, here = np.clip(x + step, -WIDEST, WIDEST), there
    return x, widths, curvature


def _slopes(
    cost: Callable[[np.ndarray], float], x: np.ndarray, here: float, widths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (k,) and curvature (k, k) of the cost at x by central differences."""
    steps = np.diag(widths)
    ends = [(cost(x + step), cost(x - step)) for step in steps]
    gradient = np.array([ahead - behind for ahead, behind in ends]) / (2.0 * widths)
    curvature = np.diag([ahead + behind - 2.0 * here for ahead, behind in ends] / widths**2)
    for i in range(len(x)):
        for j in range(i):
            both = steps[i] + steps[j]
            mixed = cost(x + both) + cost(x - both) + 2.0 * here - sum(ends[i]) - sum(ends[j])
            curvature[i, j] = curvature[j, i] = 0.5 * mixed / (widths[i] * widths[j])
    return gradient, curvature


def _deviations(curvature: np.ndarray) -> np.ndarray:
    """(k,) standard deviations that a curvature (k, k) means; infinite where it is not that of a minimum."""
    if not np.isfinite(curvature).all() or np.min(np.linalg.eigvalsh(curvature)) <= 0.0:
        return np.full(len(curvature), math.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(curvature))))
