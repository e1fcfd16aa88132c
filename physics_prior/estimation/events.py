"""Prediction through events: state and covariance across impacts, contacts that hold and contacts that let go.

A derivative tells nothing of a step that some of the states within the covariance end with an impact and others without. So
the differences of the step are taken over the width of the covariance itself, along the columns of its factor (divided
differences of second order: Norgaard, Poulsen and Ravn 2000). Of a covariance that is small against the distance to the next
event they are the saltation matrix times the smooth motion about it; second differences tell what is not known otherwise.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from physics_prior.dynamics.manifold import difference
from physics_prior.dynamics.simulator import Simulator

WIDTH = math.sqrt(3.0)  # of a difference, in standard deviations: that of the fourth moment of a normal distribution
FIRST, SECOND = 0.5 / WIDTH, 0.5 * math.sqrt(WIDTH**2 - 1.0) / WIDTH**2


def carry(
    simulator: Simulator, q: np.ndarray, v: np.ndarray, factor: np.ndarray, forces: np.ndarray, h: float
) -> np.ndarray:
    """Move q (nq,) and v (nv,) in place by one step of h seconds; return (2 nv, 2 nv + g), the factor carried and noise.

    Noise are white forces, the columns of forces (nv, f) [N sqrt(s) or N m sqrt(s)], one value a step, what is uncertain
    about the contacts, and second differences.
    """
    nv, time, still, here = simulator.nv, simulator.time, np.zeros(simulator.nv), np.zeros(2 * simulator.nv)
    q_start, v_start = q.copy(), v.copy()
    simulator.advance(q, v, h)

    def end(error: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """(2 nv,) how the step from a varied state under extra forces ends, against the end of the unvaried one."""
        simulator.time = time
        q_end, v_end = simulator.displaced(q_start, error[:nv]), v_start + error[nv:]
        simulator.advance(q_end, v_end, h, tau=tau)
        out = np.empty(2 * nv)
        difference(simulator.memory.links, q, q_end, out[:nv])
        out[nv:] = v_end - v
        return out

    pairs = [
        (end(WIDTH * column, still), end(-WIDTH * column, still)) if column.any() else (here, here)
        for column in factor.T
    ]
    for column in forces.T[forces.any(axis=0)]:
        tau = WIDTH * column / math.sqrt(h)
        pairs.append((end(here, tau), end(here, -tau)))
    for vary in _uncertain(simulator.candidates):
        vary(WIDTH)
        ahead = end(here, still)
        vary(-WIDTH)
        pairs.append((ahead, end(here, still)))
        vary(0.0)
    first = [FIRST * (ahead - behind) for ahead, behind in pairs]
    second = [SECOND * (ahead + behind) for ahead, behind in pairs]
    # the state is not moved to the mean of all these: so its covariance is about where it is
    mean = sum(second, start=here) / (2.0 * SECOND * WIDTH**2)
    return np.stack([*first, *second, mean], axis=1)


def _uncertain(candidates: np.ndarray) -> list[Callable[[float], None]]:
    """What is uncertain about contacts; each is a function that varies it by so many standard deviations, 0 to put it back."""

    def vary(name: str, highest: float, nominal: np.ndarray, deviations: float) -> None:
        candidates[name] = np.clip(nominal + deviations * candidates[f"{name}_deviation"], 0.0, highest)

    def lead_astray(axis: int, deviations: float) -> None:
        candidates["astray"][:, axis] = deviations * candidates["impulse_deviation"]

    out: list[Callable[[float], None]] = []
    for name, highest in (("friction", math.inf), ("restitution", 1.0)):
        if candidates[f"{name}_deviation"].any():
            out.append(partial(vary, name, highest, candidates[name].copy()))
    if candidates["impulse_deviation"].any():
        out.extend(partial(lead_astray, axis) for axis in range(3))
    return out
