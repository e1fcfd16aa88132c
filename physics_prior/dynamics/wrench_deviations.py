"""How sure the wrenches are that go with an uncertain state."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.errors import SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator


def wrench_deviations(
    simulator: "Simulator", q: np.ndarray, v: np.ndarray, factor: np.ndarray, share: float
) -> np.ndarray:
    """(len(wrench_names), 6) standard deviations of ``Simulator.wrench_array`` at q (nq,) and v (nv,): P_w = (dw/dx) P (dw/dx)^T.

    By central differences along the columns of P's factor (2 nv + unknown forces, k), so much of each to either side; not of what
    touches, which takes a step. Wrenches of feet are among the unknown forces themselves.

    Raises:
        SimulationError: not finite, as of ``Simulator.acceleration``.
    """
    if not simulator.held:
        return np.zeros((len(simulator.wrench_names), 6))
    unknown, nv = simulator.unknown, simulator.nv
    count = len(simulator.wrench_names) - len(unknown.feet)
    total, pair = np.zeros((count + len(unknown.feet), 6)), np.empty((2, count, 6))
    errors, scratch = np.ascontiguousarray(factor.T), np.zeros(4 * nv + unknown.count + simulator.nq)
    step, array, firsts = simulator.step, simulator.memory.array, simulator.firsts
    step.spread_wrenches(array, q, v, errors, share, unknown.places, firsts, pair, total, scratch)
    for row, foot in enumerate(unknown.feet, start=count):
        total[row] = np.sum(factor[2 * nv :][foot.span] ** 2, axis=1)
    if not np.isfinite(total).all():
        raise SimulationError(
            "forces are not finite near the state: it is too uncertain, or a joint carries no inertia there"
        )
    return np.sqrt(total)
