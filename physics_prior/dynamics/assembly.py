"""Putting a body that is off its constraints together: what Newton's method from nearby cannot reach, this does."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.effects.holding import Holding
from physics_prior.errors import SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

ASSEMBLED = 1e-10  # m: what may be left
NEAR = 1e-6  # m: from here on, projection does the rest
STEPS = 100
SHORTEST = 1e-6  # of a Newton step
LONGEST = 1e3  # rad or m of a freedom in one step: further out rounding closes whatever is open
GAIN = 0.1  # share of what a step promises that it must keep
LARGEST_TURN = 0.5  # rad in one step


def assemble(simulator: "Simulator", q: np.ndarray, v: np.ndarray) -> float:
    """Put q and v in place onto all that holds, the shortest way in the mass metric; return the position error left, m.

    By projection; where that fails, by Newton's method with a line search before it. What is held turned by half a turn,
    where the rows of hinges and welds vanish too, is turned back first.

    Raises:
        SimulationError: a joint that moves no inertia in a posture on the way.
    """
    start, speed = q.copy(), v.copy()
    left = simulator.project(q, v)
    if left <= ASSEMBLED and not turned_over(simulator):
        return left
    q[:], v[:] = start, speed
    _descend(simulator, q)
    for index in turned_over(simulator):
        _turn_back(simulator, q, index)
    left = _descend(simulator, q)
    return simulator.project(q, v) if left < NEAR else left


def turned_over(simulator: "Simulator") -> list[int]:
    """Which effects hold a part that points backwards, though their rows are satisfied; needs ``place``."""
    out, pairs = [], simulator.memory.pairs
    for index, (effect, (first, last)) in enumerate(
        zip(simulator.switches.effects, simulator.switches.spans, strict=True)
    ):
        if isinstance(effect, Holding) and pairs["active"][first]:
            a, b = (pairs[name][first + 1 : last] - pairs[name][first] for name in ("a", "b"))
            if np.any(np.sum(a * b, axis=1) < 0.0):
                out.append(index)
    return out


def _descend(simulator: "Simulator", q: np.ndarray) -> float:
    """Move q in place towards the constraints by Newton steps in the mass metric, each as long as it keeps its promise.

    Returns the largest error left, m.
    """
    still = np.zeros(simulator.nv)
    error = simulator.constraint_error(q, still)
    for _ in range(STEPS):
        size = float(np.linalg.norm(error))
        if size < NEAR:
            break
        A, _ = simulator.tangent_rows(q, still)
        responses = _responses(simulator, q, A)
        step = -responses @ _pseudo_solve(A @ responses, error)
        tried, length = _search(simulator, q, step, size)
        if length == 0.0:
            break
        q[:] = tried
        error = simulator.constraint_error(q, still)
    return float(np.max(np.abs(simulator.constraint_error(q, still))))


def _search(simulator: "Simulator", q: np.ndarray, step: np.ndarray, size: float) -> tuple[np.ndarray, float]:
    """The configuration that much of a step leads to which makes the error, of that size, smaller; and how much of it."""
    length, longest = 1.0, LONGEST / max(float(np.max(np.abs(step))), 1.0)
    while length > SHORTEST:
        if length <= longest:
            tried = simulator.displaced(q, length * step)
            left = np.linalg.norm(simulator.constraint_error(tried, np.zeros(simulator.nv)))
            if left <= (1.0 - GAIN * length) * size:
                return tried, length
        length *= 0.5
    return q, 0.0


def _turn_back(simulator: "Simulator", q: np.ndarray, index: int) -> None:
    """Turn what an effect holds, in the mass metric, until its levers point where they should."""
    effect, (first, last) = simulator.switches.effects[index], simulator.switches.spans[index]
    assert isinstance(effect, Holding)
    from scipy.spatial.transform import Rotation  # here: few need it, and it takes long to load

    still, origin, pairs = np.zeros(simulator.nv), np.zeros(3), simulator.memory.pairs
    for _ in range(STEPS):
        simulator.constraint_error(q, still)
        a, b = (pairs[name][first + 1 : last] - pairs[name][first] for name in ("a", "b"))
        turn = Rotation.align_vectors(a, b)[0].as_rotvec()
        angle = float(np.linalg.norm(turn))
        if angle < NEAR:
            return
        J = simulator.jacobian(effect.part, origin)[:3] - simulator.jacobian(effect.to, origin)[:3]
        responses = _responses(simulator, q, J)
        step = responses @ _pseudo_solve(J @ responses, turn * min(1.0, LARGEST_TURN / angle))
        q[:] = simulator.displaced(q, step)


def _responses(simulator: "Simulator", q: np.ndarray, A: np.ndarray) -> np.ndarray:
    """M^-1 A^T (nv, rows) at q; SimulationError where a joint carries no inertia in this posture."""
    M = simulator.mass_matrix(q)
    try:
        responses = np.linalg.solve(M, A.T)
    except np.linalg.LinAlgError:
        freedom = simulator.tree.freedom_names[int(np.argmax(np.abs(np.linalg.eigh(M)[1][:, 0])))]
        raise SimulationError(
            f"what holds cannot be put together: '{freedom}' moves no inertia in this posture (a straight chain, say)"
        ) from None
    return np.asarray(responses)


def _pseudo_solve(S: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The shortest solution of S x = right, redundant rows allowed."""
    out: np.ndarray = np.linalg.lstsq(S, right, rcond=1e-9)[0]
    return out
