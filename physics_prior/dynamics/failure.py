"""Why a step failed, in a sentence."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.memory import OPEN
from physics_prior.errors import SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator


def failure(simulator: "Simulator", rank: int, h: float) -> SimulationError:
    """The error of a step of h seconds that returned a negative rank (step.py)."""
    if rank == -1:
        return SimulationError(
            f"the motion is not finite after a step of {h:g} s: a smaller step size or another integrator may do"
        )
    if rank == -3:
        return SimulationError(
            f"{simulator.switches.furthest()} is open by {simulator.memory.array[OPEN]:.3g} m after a step of {h:g} s, and"
            " cannot be closed from there: a smaller step size may do"
        )
    return SimulationError(
        f"the integrator '{simulator.integrator}' found no solution of a step of {h:g} s: a smaller step size may do"
    )


def require_finite(simulator: "Simulator", vdot: np.ndarray) -> None:
    """Raise SimulationError if an acceleration (nv,) is not finite."""
    finite = np.isfinite(vdot)
    if not finite.all():
        raise SimulationError(
            f"the acceleration of '{simulator.tree.freedom_names[int(np.argmin(finite))]}' is not finite: the state is not,"
            " or a joint carries no inertia in this posture (a straight chain of thin rods)"
        )
