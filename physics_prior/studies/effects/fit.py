"""Parameters of a scene by maximum likelihood of a recording, with what the recording tells of them.

Each is fitted as a factor on what the scene file says, in the logarithm, so that it keeps its sign. Intervals come from the
curvature of the likelihood at its maximum (the observed information): they hold as far as the model does.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import norm

from physics_prior.errors import SimulationError
from physics_prior.estimation.measurement import Measurement
from physics_prior.studies.effects.likelihood import likelihood
from physics_prior.studies.effects.variant import SceneText

WIDEST = math.log(1e3)  # a factor is sought between 1/1000 and 1000
GAIN, ITERATIONS = 0.01, 30  # of log-likelihood by an iteration, below which a search ends, and how many it may take
PROBE, FIRST_PROBE = 1e-3, 1e-2  # of the logarithm: steps of the gradient and of the first curvature
CONFIDENCE = 0.95
FAR, MOST_REFUSED = 1.5, 50  # NIS, and rows a refused measurement, beyond which a start is too far off for a search
WIDENINGS = (16.0, 4.0, 1.0, 1.0)  # of all noise, from such a start: what fits nowhere has no slope to follow
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
    intervals: bool = True,
) -> Fit:
    """Fit the numbers at some paths of a scene to measurements; told is told how many replays were made.

    Without intervals, which take some replays more, their ends are NaN.

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
    for widening in (1.0, 1.0) if near else WIDENINGS:
        here = cost(best, widening)
        found = minimize(
            cost,
            best,
            (widening,),
            method="L-BFGS-B",
            bounds=[(-WIDEST, WIDEST)] * len(paths),
            options={"eps": PROBE, "ftol": GAIN * widening / abs(here), "maxiter": ITERATIONS},
        )
        if found.fun < here:
            best = found.x
    lowest = cost(best)
    if lowest == IMPOSSIBLE:
        raise SimulationError(
            f"{scene.path}: no values of {list(paths)} were found with which it follows the recording"
        )
    deviations = _deviations(cost, best, lowest) if intervals else np.full(len(best), math.inf)
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


def _deviations(cost: Callable[[np.ndarray], float], x: np.ndarray, lowest: float) -> np.ndarray:
    """(k,) standard deviations from the curvature at x (k,); infinite where it has no minimum there.

    Central differences, the second time as wide as the first says that a deviation is: below that a likelihood has the
    roughness of its gate.
    """
    k, widths = len(x), np.full(len(x), FIRST_PROBE)
    for last in (False, True):
        curvature = np.zeros((k, k))
        ends = [(cost(x + step), cost(x - step)) for step in np.diag(widths)]
        for i in range(k):
            curvature[i, i] = (sum(ends[i]) - 2.0 * lowest) / widths[i] ** 2
            for j in range(i if last else 0):
                step = np.zeros(k)
                step[[i, j]] = widths[[i, j]]
                mixed = cost(x + step) + cost(x - step) + 2.0 * lowest - sum(ends[i]) - sum(ends[j])
                curvature[i, j] = curvature[j, i] = 0.5 * mixed / (widths[i] * widths[j])
        diagonal = np.diag(curvature)
        widths = np.clip(1.0 / np.sqrt(np.maximum(diagonal, 1e-6)), PROBE, 0.5)
    if not np.isfinite(curvature).all() or np.min(np.linalg.eigvalsh(curvature)) <= 0.0:
        return np.full(k, math.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(curvature))))
