"""Feet on the ground: which of them stand, and which forces they can bear.

A foot comes to stand where the lowest corner of its sole is low and slow, and is off the ground where that is high or fast; in
between it stays as it was, unless it carries nothing; the last that stands is not off before its load is gone. The states
forget nothing of a foot that is lifted: that its force has come to zero is an exact measurement, which tells how the load went
over to the other foot. One that comes to stand begins at zero. Inequalities (never a pull, friction, pressure within the sole)
are linear in the wrench; what is beyond one is moved onto it by the covariance, the state nearest in its metric (Simon 2010).
"""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.unknown_forces import Foot
from physics_prior.estimation.process import State
from physics_prior.estimation.square_root import lower_factor

if TYPE_CHECKING:
    from physics_prior.estimation.forced_process import ForcedProcess

INFORMED = 1e-9  # of the largest deviation of a foot's forces: below it, they are known already
SURE = 2.0  # standard deviations
CLEARLY = 2.0  # times as high or fast as what may be off the ground: whatever it seems to carry
SWEEPS = 10  # over the inequalities that are not kept
LEAST_TILT = 0.1  # cosine: a sole that is more upright stands on an edge of this share of its shorter side


def stands(
    simulator: Simulator, foot: Foot, state: State, stood: bool, others: bool, spread: np.ndarray, unsure: float
) -> bool:
    """Whether a foot stands, given whether it did and whether others do; needs ``simulator.move``.

    spread (nv, k): a factor of the velocity's covariance; unsure: standard deviation of its vertical force, N.
    """
    sole = foot.sole
    position, R = simulator.pose(sole.part)
    velocity, omega = simulator.velocity(sole.part)
    arms = sole.corners @ R.T
    lowest = int(np.argmin(arms[:, 2]))
    height = float(position[2] + arms[lowest, 2]) - sole.height
    speed = float(np.linalg.norm(velocity + np.cross(omega, arms[lowest]) - sole.velocity))
    least_speed = speed - SURE * float(np.linalg.norm(simulator.jacobian(sole.part, sole.corners[lowest])[3:] @ spread))
    still = height < sole.touch[0] and (speed if others else least_speed) < sole.touch[1]
    if still or not stood:
        return still
    load, doubt = float(state.force[foot.span][2]), SURE * unsure
    if not others:
        return load > sole.least
    if height > CLEARLY * sole.release[0] or least_speed > CLEARLY * sole.release[1]:
        return False
    if height > sole.release[0] or speed > sole.release[1]:
        return load - doubt > sole.least
    return load + doubt > sole.least


def settle(process: "ForcedProcess", state: State, factor: np.ndarray) -> tuple[State, np.ndarray]:
    """State and factor after it was decided which feet stand."""
    simulator, feet, nv = process.simulator, process.unknown.feet, process.nv
    simulator.move(state.q, state.v)
    unsure = np.linalg.norm(factor[2 * nv :], axis=1)
    now = state.grounded.copy()
    for index, foot in enumerate(feet):
        others = bool(np.delete(now, index).any())
        deviation = float(unsure[foot.span][2])
        now[index] = stands(simulator, foot, state, bool(now[index]), others, factor[nv : 2 * nv], deviation)
    lifted = [foot for foot, old, new in zip(feet, state.grounded, now, strict=True) if old and not new]
    if (now != state.grounded).any():
        state = state.copy()
        state.grounded = now
    for foot in lifted:
        state, factor = _unload(process, state, factor, foot)
    return state, factor


def _unload(process: "ForcedProcess", state: State, factor: np.ndarray, foot: Foot) -> tuple[State, np.ndarray]:
    """State and factor told that a foot carries nothing."""
    own = slice(2 * process.nv + foot.span.start, 2 * process.nv + foot.span.stop)
    U, s, V = np.linalg.svd(factor[own], full_matrices=False)
    told = s > INFORMED * s[0]
    if told.any():
        U, s, V = U[:, told], s[told], V[told]
        state = process.displace(state, -factor @ (V.T @ ((U.T @ state.force[foot.span]) / s)))
        factor = lower_factor(factor - (factor @ V.T) @ V)
    state.force[foot.span] = 0.0
    factor[own] = 0.0
    return state, factor


def bounds(simulator: Simulator, foot: Foot, wrench: np.ndarray) -> np.ndarray:
    """(6, 6) rows a with a . wrench >= 0 for what a foot can bear; needs ``simulator.move``.

    Vertical force; friction along the present horizontal force; pressure between the edges of the sole as it stands on
    the ground, at the point where the wrench has no horizontal moment.
    """
    sole = foot.sole
    position, R = simulator.pose(sole.part)
    middle = position + R @ sole.center
    drop = sole.height - middle[2]
    rows = np.zeros((6, 6))
    rows[0, 2] = 1.0
    along = wrench[:2] / max(float(np.linalg.norm(wrench[:2])), 1e-300)
    rows[1, :3] = -along[0], -along[1], sole.friction
    # vertical force times the centre of pressure less the point under the middle
    lever = np.array([[drop, 0.0, 0.0, 0.0, -1.0, 0.0], [0.0, drop, 0.0, 1.0, 0.0, 0.0]])
    U, s, Vt = np.linalg.svd(R[:2, :2] * sole.half)  # the sole seen from above
    across = (Vt.T / np.maximum(s, LEAST_TILT * np.min(sole.half))) @ U.T @ lever
    for axis in range(2):
        for sign in (1.0, -1.0):
            row = rows[2 + 2 * axis + (sign < 0.0)]
            row[:] = sign * across[axis]
            row[2] += 1.0
    return rows


def admit(process: "ForcedProcess", state: State, factor: np.ndarray) -> bool:
    """Move a state in place, as its factor lets it, to where its feet can bear their forces; return whether it had to be."""
    simulator, nv = process.simulator, process.nv
    simulator.move(state.q, state.v)
    moved = False
    for _ in range(SWEEPS):
        kept = True
        for foot, grounded in zip(process.unknown.feet, state.grounded, strict=True):
            if not grounded:
                continue
            own = slice(2 * nv + foot.span.start, 2 * nv + foot.span.stop)
            rows = bounds(simulator, foot, state.force[foot.span])
            for index in range(6):
                excess = -float(rows[index] @ state.force[foot.span])
                spread = rows[index] @ factor[own]
                if excess <= 1e-9 * process.scale or not spread.any():
                    continue
                kept, moved = False, True
                there = process.displace(state, factor @ spread * (excess / float(spread @ spread)))
                state.q[:], state.v[:], state.force[:] = there.q, there.v, there.force
                simulator.move(state.q, state.v)
                rows = bounds(simulator, foot, state.force[foot.span])
        if kept:
            break
    for foot, grounded in zip(process.unknown.feet, state.grounded, strict=True):
        if grounded:
            state.force[foot.span] = borne(simulator, foot, state.force[foot.span])
    return moved


def borne(simulator: Simulator, foot: Foot, wrench: np.ndarray) -> np.ndarray:
    """The wrench (6,) put within the bounds by itself: what the sweeps have left."""
    out, sole = wrench.copy(), foot.sole
    out[2] = max(out[2], 0.0)
    size = float(np.linalg.norm(out[:2]))
    if size > sole.friction * out[2]:
        out[:2] *= sole.friction * out[2] / size
    rows = bounds(simulator, foot, out)
    lever = np.array([0.5 * (rows[2 + 2 * axis] - rows[3 + 2 * axis]) for axis in range(2)])
    share = lever @ out
    over = share - np.clip(share, -out[2], out[2])
    if over.any():
        out[3:5] -= np.linalg.solve(lever[:, 3:5], over)
    return out
