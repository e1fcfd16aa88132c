"""Newton's method within bounds, for a cost that a replay computes: few evaluations, and no derivatives but differences.

Differences are central and as wide as a deviation (curvature to the power -1/2): narrower, they would meet the roughness of the
gate, and of one side only, they would shift the minimum by half their width. Second derivatives of each number alone cost nothing
beside the gradient and are kept up; those across are made anew only where the widths have changed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from physics_prior.errors import SimulationError

IMPOSSIBLE = 1e12  # a cost that stands for none: a motion that leaves the numbers
FIRST_WIDTH, NARROWEST = 0.03, 1e-4  # of the differences: at first and at least
FLATTEST = 1e-3  # least curvature that counts, of unit diagonals
STALE = 2.0  # how many times a width may change before derivatives across are made anew
SHARE = 0.01  # of what a smaller scene is worse by: as well as that need be known
GAIN, PASSES = 0.01, 15  # of the cost, below which a search ends, and how many steps it may take

Cost = Callable[[np.ndarray], float]


@dataclass(frozen=True, eq=False)
class Box:
    """What the search may do: lowest and highest (k,) coordinates, longest step and widest difference (k,) of each."""

    lowest: np.ndarray
    highest: np.ndarray
    farthest: np.ndarray
    widest: np.ndarray

    def subset(self, chosen: np.ndarray) -> "Box":
        """Of some of the coordinates, by index."""
        return Box(self.lowest[chosen], self.highest[chosen], self.farthest[chosen], self.widest[chosen])


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a cost is least.

    Attributes:
        x: (k,) there; cost: what it is there.
        widths: (k,) a deviation of each number.
        gradient, curvature: (k,) and (k, k) there.
    """

    x: np.ndarray
    cost: float
    widths: np.ndarray
    gradient: np.ndarray
    curvature: np.ndarray

    def subset(self, chosen: np.ndarray) -> "Minimum":
        """Where to begin with fewer numbers, by index."""
        return Minimum(
            self.x[chosen],
            self.cost,
            self.widths[chosen],
            self.gradient[chosen],
            self.curvature[np.ix_(chosen, chosen)],
        )


def descend(cost: Cost, box: Box, begin: Minimum | None = None, x: np.ndarray | None = None) -> Minimum:
    """Search the minimum of a cost from x, or from that of a lower one like it, whose curvature is then taken over.

    In the second case the search ends where the cost is known to a hundredth of what it is higher by.

    Raises:
        SimulationError: there is no cost where the search begins, nor near it.
    """
    if begin is not None:
        x, widths, curvature = begin.x, begin.widths, begin.curvature
    else:
        assert x is not None
        widths, curvature = np.full(len(x), FIRST_WIDTH), None
    made = widths  # for which derivatives across were made
    here = cost(x)
    gradient = np.zeros(len(x))
    for _ in range(PASSES if len(x) else 0):
        if curvature is None or np.any(np.maximum(widths / made, made / widths) > STALE):
            curvature, made = None, widths
        used = widths
        gradient, curvature, widths = slopes(cost, box, x, here, used, curvature)
        far_too_wide = bool(np.any(used > STALE * widths))
        step = _newton(gradient, curvature, box.lowest - x, box.highest - x)
        step *= min(1.0, 1.0 / max(float(np.max(np.abs(step) / box.farthest)), 1e-300))
        enough = max(GAIN, 0.0 if begin is None else SHARE * (here - begin.cost))
        if -0.5 * float(gradient @ step) < enough and not far_too_wide:
            break
        there = cost(x + step)
        while there >= here and not far_too_wide and np.any(np.abs(step) > NARROWEST):
            step *= 0.5
            there = cost(x + step)
        if there < here:
            x, here = x + step, there
        elif not far_too_wide:
            break
    if here >= IMPOSSIBLE:
        raise SimulationError("no values were found with which the scene follows the recording")
    return Minimum(x, here, widths, gradient, np.zeros((0, 0)) if curvature is None else curvature)


def slopes(
    cost: Cost, box: Box, x: np.ndarray, here: float, widths: np.ndarray, like: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gradient (k,) and curvature (k, k) of a cost at x, and the widths (k,) that differences had best have there.

    like: a curvature whose correlations hold still; where it is None they are made anew.
    """
    k = len(x)
    gradient, curved, ahead = np.zeros(k), np.zeros(k), np.zeros(k)
    widths = widths.copy()
    for i in range(k):
        gradient[i], curved[i], ahead[i], widths[i] = _along(cost, x, here, i, float(widths[i]), float(box.lowest[i]))
    if like is None:
        curvature = np.diag(curved)
        for i in range(k):
            for j in range(i):
                both = x.copy()
                both[[i, j]] += widths[[i, j]]
                mixed = cost(both) - ahead[i] - ahead[j] + here
                curvature[i, j] = curvature[j, i] = mixed / (widths[i] * widths[j])
    else:
        scale = np.sqrt(np.maximum(np.abs(np.diag(like)), 1e-12))
        correlation = like / np.outer(scale, scale)
        scale = np.sqrt(np.abs(curved))
        curvature = correlation * np.outer(scale, scale)
        np.fill_diagonal(curvature, curved)
    best = np.where(curved > 0.0, 1.0 / np.sqrt(np.maximum(curved, 1.0 / box.widest**2)), widths)
    return gradient, curvature, np.maximum(best, NARROWEST)


def _along(
    cost: Cost, x: np.ndarray, here: float, i: int, width: float, lowest: float
) -> tuple[float, float, float, float]:
    """First and second derivative by x_i, the cost a width ahead, and that width: less where there is no cost so far away."""

    def at(shift: float) -> float:
        moved = x.copy()
        moved[i] += shift
        return cost(moved)

    while True:
        ahead = at(width)
        if x[i] - width >= lowest:
            behind = at(-width)
            first, second = (ahead - behind) / (2.0 * width), (ahead + behind - 2.0 * here) / width**2
        else:  # at the bound: the parabola through three points on this side of it
            behind = at(2.0 * width)
            first = (4.0 * ahead - behind - 3.0 * here) / (2.0 * width)
            second = (here + behind - 2.0 * ahead) / width**2
        if max(ahead, behind) < IMPOSSIBLE or width <= NARROWEST:
            return first, second, ahead, width
        width *= 0.25


def _newton(gradient: np.ndarray, curvature: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step (k,) to the minimum of the parabola, each number within low and high: those that would leave stay at the end.

    Directions of negative curvature are taken downhill by its size, flat ones by no more than FLATTEST allows.
    """
    step, free = np.zeros(len(gradient)), np.ones(len(gradient), dtype=bool)
    while free.any():
        G = gradient[free] + curvature[np.ix_(free, ~free)] @ step[~free]
        C = curvature[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.abs(np.diag(C)), 1e-6))
        values, vectors = np.linalg.eigh(C / np.outer(scale, scale))
        part = -(vectors @ ((vectors.T @ (G / scale)) / np.maximum(np.abs(values), FLATTEST))) / scale
        kept = np.clip(part, low[free], high[free])
        step[free] = kept
        if np.array_equal(kept, part):
            break
        free[np.flatnonzero(free)[kept != part]] = False
    return step
