"""Whether what holds can be told from rounding: the rows' rank in the mass metric against their rank as levers.

A M^-1 A^T of parts of very unlike masses or inertias loses directions that A has: a kilogram of 1e-12 kg m^2 held a metre from
its centre turns 1e12 times more easily than it comes along. Rows that are redundant as levers are no fault.
"""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics import constraint, kinematics, row_system

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

HOLDS = 0.03  # of the rows' usual lever: the least singular value of a direction that they hold for certain, well off a fold


def unlike(simulator: "Simulator", q: np.ndarray) -> int | None:
    """The first of the effects that hold something whose rows lose a direction to the masses at q (nq,); None if none does."""
    memory = simulator.memory
    system = (memory.links, memory.work, memory.pairs, memory.rows, memory.known, q)
    rank, levers = constraint.refresh(*system), _levers(simulator)
    if rank >= _rank(levers):
        return None
    constraint.complete(*system)  # what was solved for since has overwritten the rows' scales
    told = _pivots(simulator)
    for index in range(len(simulator.switches.effects)):
        last = simulator.switches.row_span(index).stop
        if np.sum(told[:last]) < _rank(levers[:last]):
            return index
    return None


def _pivots(simulator: "Simulator") -> np.ndarray:
    """(rows,) whether the factor of A M^-1 A^T tells a row from rounding, given those before it."""
    rows, m = simulator.memory.rows, simulator.rows
    inverse, scales = np.diagonal(rows[:m, 2 * row_system.width(rows) + m :]), rows[m + 2, :m]
    return np.asarray(inverse * row_system.DEPENDENT * row_system.REGULARISATION * scales < 1.0)


def _levers(simulator: "Simulator") -> np.ndarray:
    """A (rows, nv) over the usual lever, the root of the mean square of the rows that act (as ``weigh_rows`` has it)."""
    memory, at = simulator.memory, 0
    A, J = np.zeros((simulator.rows, simulator.nv)), np.zeros((6, simulator.nv))
    for pair in memory.pairs:
        d = pair["d"].reshape(3, 3)[: pair["rows"]]
        for sign, link, point in ((1.0, pair["link_b"], pair["b"]), (-1.0, pair["link_a"], pair["hold"])):
            if link >= 0:
                on = memory.work[link]
                own = on["rotation"].reshape(3, 3).T @ (point - on["origin"])
                kinematics.point_jacobian(memory.links, memory.work, int(link), own, J)
                A[at : at + len(d)] += sign * d @ J[3:]
        at += len(d)
    active = max(simulator.switches.rows, 1)
    return np.asarray(A / max(np.linalg.norm(A) / np.sqrt(active), constraint.POSITION_TOLERANCE))


def _rank(levers: np.ndarray) -> int:
    """How many directions rows over their usual lever hold for certain."""
    return int(np.sum(np.linalg.svd(levers, compute_uv=False) > HOLDS))
