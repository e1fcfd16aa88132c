"""Smoothing: estimates told by measurements after them too, of a window or a whole recording.

Rauch, Tung and Striebel's backward pass in the error state, in square-root form (Sarkka 2013, ch. 8): with the gain
C = P F^T P_predicted^+, the smoothed covariance is (I - C F) P (I - C F)^T + C (G G^T + P_later) C^T, a sum of squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from physics_prior.dynamics.switches import Hold
from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.history import Node
from physics_prior.estimation.process import State, steps
from physics_prior.estimation.square_root import deviations, lower_factor
from physics_prior.estimation.switching import Grip, switch, take_hold

NANOSECONDS = 1e9
INVERTIBLE = 1e-9  # of the largest singular value: smaller ones belong to directions that the constraints forbid


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the prediction: where it began, how it went and where it was to end; or how something took hold."""

    stamp: int
    holds: tuple[Hold, ...]
    state: State
    factor: np.ndarray
    carried: np.ndarray
    noise: np.ndarray
    predicted: State
    predicted_factor: np.ndarray

    @cached_property
    def gain(self) -> np.ndarray:
        """(n, n) C."""
        scale = deviations(self.predicted_factor)
        inverse = np.linalg.pinv(self.predicted_factor / scale[:, None], rcond=INVERTIBLE) / scale
        return np.asarray(self.factor @ self.carried.T @ inverse.T @ inverse)

    @cached_property
    def untold(self) -> np.ndarray:
        """(n, n + g) the columns of the smoothed covariance that nothing later changes, (1 - C F) S and C G."""
        return np.concatenate([self.factor - self.gain @ self.carried, self.gain @ self.noise], axis=1)


Known = dict[tuple[Posterior, int], list[Step]]
"""The steps from a posterior to a later stamp, ns."""


def smooth(filter: Filter, nodes: Sequence[Node], period: float, known: Known | None = None) -> list[Posterior]:
    """Smoothed posteriors, oldest first: one a stamp, and one every ``period`` seconds where nothing was measured.

    nodes: the nodes of a window or a recording in order, as the history rolled them. The chain is cut where the filter started
    anew. known: steps that windows share; it is added to.
    """
    known = {} if known is None else known
    last: dict[int, Posterior] = {}  # the last posterior at a stamp knows all that was measured then
    grips: dict[int, list[Step]] = {}  # of commands and measured forces at a stamp
    restarts = set()
    for node in nodes:
        last[node.measurement.stamp] = node.posterior
        taken = _taken(node)
        if taken is not None:
            grips.setdefault(node.measurement.stamp, []).append(_gripped(filter, node.prior, taken))
        if node.posterior.start:
            restarts.add(node.measurement.stamp)
    stamps = list(last)
    if not stamps:
        return []
    later = last[stamps[-1]]
    out = [later]
    for own, after in zip(reversed(stamps[:-1]), reversed(stamps[1:]), strict=True):
        if after in restarts:
            later = last[own]
            out.append(later)
            continue
        state, factor = later.state, later.factor
        if (last[own], after) not in known:
            known[last[own], after] = _steps(filter, last[own], after)
        for step in reversed([*known[last[own], after], *grips.get(after, [])]):
            state, factor, holds = _back(filter, step, last[own].begun, state, factor)
            later = replace(last[own], stamp=step.stamp, state=state, factor=factor, holds=holds)
            if step.stamp == own or out[-1].stamp - step.stamp >= period * NANOSECONDS:
                out.append(later)
    return out[::-1]


def _taken(node: Node) -> int | None:
    """Which effect took hold at a node, by a command or a measured force; None if none did."""
    for index, (before, after) in enumerate(zip(node.prior.holds, node.posterior.holds, strict=True)):
        if after.active and not before.active:
            return index
    return None


def _steps(filter: Filter, posterior: Posterior, stamp: int) -> list[Step]:
    """The steps by which the filter carried a posterior to a later stamp, scheduled switching included."""
    out, begun = [], posterior.begun
    for stretch in filter.simulator.switches.stretches(posterior.stamp - begun, stamp - begun):
        filter.enter(posterior)
        count, h = steps((stretch.end - stretch.begin) / NANOSECONDS, filter.scene.step.size)
        state, factor = posterior.state, posterior.factor
        for index in range(count):
            predicted, n = state.copy(), len(factor)
            W = filter.process.carry(predicted, factor, h)
            carried, noise, expected = W[:, :n], W[:, n:], lower_factor(W)
            began = posterior.stamp + round(index * h * NANOSECONDS)
            out.append(Step(began, posterior.holds, state, factor, carried, noise, predicted, expected))
            state, factor = predicted, expected
        posterior = replace(posterior, stamp=begun + stretch.end, state=state, factor=factor)
        for event in stretch.events:
            switched = switch(filter, posterior, event.index, event.on)
            if event.on and switched.holds != posterior.holds:
                out.append(_gripped(filter, posterior, event.index))
            posterior = switched
    return out


def _gripped(filter: Filter, posterior: Posterior, index: int) -> Step:
    """How an effect took hold, as a step of no duration and without noise."""
    grip: Grip = take_hold(filter, posterior, index)
    carried, noise = grip.F @ grip.factor, np.zeros_like(grip.F)
    return Step(
        posterior.stamp, posterior.holds, grip.state, grip.factor, carried, noise, grip.after, grip.factor_after
    )


def _back(
    filter: Filter, step: Step, begun: int, state: State, factor: np.ndarray
) -> tuple[State, np.ndarray, tuple[Hold, ...]]:
    """The smoothed state and factor at a step's beginning from those at its end, and what held there."""
    W = np.concatenate([step.untold, step.gain @ factor], axis=1)
    smoothed = filter.process.displace(step.state, step.gain @ filter.process.difference(step.predicted, state))
    out = lower_factor(W)
    filter.simulator.switches.holds = step.holds
    filter.simulator.time = (step.stamp - begun) / NANOSECONDS
    filter.constrain(smoothed, out)
    return smoothed, out, filter.simulator.switches.holds
