"""Why a step failed, in a sentence."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.memory import OPEN
from physics_prior.errors import SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

REVOLUTION, FAR = 2.0 * np.pi, 1e4  # rad and m that a step may turn and slide


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


def require_followed(simulator: "Simulator", v: np.ndarray, h: float) -> None:
    """Raise SimulationError if a motion v (nv,) is too fast for steps of h seconds to have followed it.

    No integrator follows more than a turn a step. One whose step is too large for its stiffness may come through all numbers
    up to 1e94 and back, the covariance with it, so that measurements seem to fit.
    """
    if np.max(np.abs(v), initial=0.0) * h <= REVOLUTION:  # nearly always
        return
    turning = simulator.tree.turning
    share = np.abs(v) * h / np.where(turning, REVOLUTION, FAR)
    worst = int(np.argmax(share))
    if share[worst] > 1.0:
        does, unit, most = ("turns", "rad", "one revolution") if turning[worst] else ("slides", "m", f"{FAR:g} m")
        raise SimulationError(
            f"'{simulator.tree.freedom_names[worst]}' {does} by {abs(v[worst]) * h:.3g} {unit} in a step of {h:g} s, more than"
            f" {most}: a smaller step size or another integrator may do"
        )
