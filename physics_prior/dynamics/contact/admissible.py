"""Errors of a state that leave be what touches: what may be asked of its forces is only how they go with these.

A force of contact is defined as far as the contact lasts. Across its kink, a body that is lifted by a hair loses its whole
weight, and one that is pressed down needs an impulse over the step: slopes of the step size, not of the state.
"""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics import kinematics
from physics_prior.dynamics.contact.memory import solved_system

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

RESTING = 1e-9  # m/s or rad/s: slower is at rest
REDUNDANT = 1e-10  # of the largest eigenvalue of A M^-1 A^T: rows below it add nothing


def admissible_errors(simulator: "Simulator", q: np.ndarray, v: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Errors (2 nv, k) of q and v less what would press, lift or slide what rests there; in the mass metric.

    Rows of contact and limits that hold at q and v count as equalities: normal rows for positions, those and rows of
    friction and rolling that stick for velocities. The scene's equality rows stay fulfilled.

    Raises:
        SimulationError: as ``Simulator.acceleration``.
    """
    if not simulator.touching:
        return errors
    simulator.acceleration(q, v)
    normal, sticking = _holding_rows(simulator)
    if not len(normal):
        return errors
    nv = simulator.nv
    A, A_q = simulator.tangent_rows(q, v)
    inverse = np.linalg.inv(simulator.mass_matrix(q))
    out = errors.copy()
    _correct(np.vstack([A, normal]), inverse, out[:nv], np.zeros((len(A) + len(normal), errors.shape[1])))
    held = np.vstack([A, normal, sticking])
    rates = np.zeros((len(held), errors.shape[1]))
    rates[: len(A)] = -A_q @ out[:nv]
    _correct(held, inverse, out[nv:], rates)
    return out


def _correct(rows: np.ndarray, inverse: np.ndarray, errors: np.ndarray, right: np.ndarray) -> None:
    """Move errors (nv, k) in place to rows @ errors = right, least in the mass metric."""
    response = inverse @ rows.T
    errors += response @ np.linalg.pinv(rows @ response, REDUNDANT, hermitian=True) @ (right - rows @ errors)


def _holding_rows(simulator: "Simulator") -> tuple[np.ndarray, np.ndarray]:
    """Jacobians (., nv) of the normal rows that hold, and of the rows of friction and rolling that stick there."""
    memory, candidates = simulator.memory, simulator.candidates
    contacts, impulses, velocities = solved_system(memory.contact_part)
    normal: list[np.ndarray] = []
    sticking: list[np.ndarray] = []
    for contact in contacts:
        candidate, first = candidates[contact["candidate"]], int(contact["first"])
        if impulses[first] == 0.0 and velocities[first] > RESTING:
            continue
        if candidate["is_limit"]:
            normal.append(np.eye(simulator.nv)[memory.links[candidate["link_b"]]["v"]])
            continue
        frame = contact["frame"].reshape(3, 3)
        J = _point_jacobian(simulator, candidate["link_b"], contact["point"])
        J -= _point_jacobian(simulator, candidate["link_a"], contact["point"])
        normal.append(frame[0] @ J[3:])
        r = first + 1
        for moving, bound in ((J[3:], candidate["friction"]), (J[:3], candidate["rolling"])):
            if bound > 0.0:
                if np.linalg.norm(velocities[r : r + 2]) <= RESTING:
                    sticking.extend(frame[1:] @ moving)
                r += 2
    return np.reshape(normal, (-1, simulator.nv)), np.reshape(sticking, (-1, simulator.nv))


def _point_jacobian(simulator: "Simulator", link: int, point: np.ndarray) -> np.ndarray:
    """(6, nv) angular velocity of a link and velocity of a world point on it, per v."""
    links, work = simulator.memory.links, simulator.memory.work
    out = np.zeros((6, simulator.nv))
    if link >= 0:
        own = work[link]["rotation"].reshape(3, 3).T @ (point - work[link]["origin"])
        kinematics.point_jacobian(links, work, link, own, out)
    return out
