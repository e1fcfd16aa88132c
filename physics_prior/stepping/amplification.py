"""Whether a scene's step is small enough for its stiffness: what it does to errors, beside what the motion does."""

import math

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError

PARTS = 64  # of a step, which stand for the motion
MOST, LEAST = 1.1, 0.25  # times the motion's own that a step may multiply an error by


def stable(simulator: Simulator, q: np.ndarray, v: np.ndarray, h: float) -> bool:
    """Whether a step of h seconds at q and v multiplies no error by more than the motion does.

    A step too large for a stiff spring, damper or muscle multiplies what should decay (Hairer and Wanner 1996, IV.2): the
    spectral radius of its derivative F is far above one, and that of small parts of it, one after the other, is not.
    """
    own, motions = (_amplification(simulator, q, v, h, parts) for parts in (1, PARTS))
    # less than the motion's is no better: then the parts, too, are too large
    return math.isfinite(own) and LEAST * motions <= max(1.0, own) <= MOST * max(1.0, motions)


def _amplification(simulator: Simulator, q: np.ndarray, v: np.ndarray, h: float, parts: int) -> float:
    """The spectral radius of the derivative of a step of h seconds in equal parts; infinite where they are not possible."""
    place, speed, time, total = q.copy(), v.copy(), simulator.time, np.eye(2 * simulator.nv)
    still = np.zeros(simulator.nv)
    try:
        for _ in range(parts):
            with np.errstate(over="ignore", invalid="ignore"):  # said by what is returned
                total = simulator.linearise(place, speed, h / parts, still)[0] @ total
    except SimulationError:
        return math.inf
    finally:
        simulator.time = time
    return float(np.max(np.abs(np.linalg.eigvals(total)), initial=0.0)) if np.isfinite(total).all() else math.inf
