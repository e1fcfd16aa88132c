"""Feet on the ground: which of them stand.

A foot comes to stand where the lowest corner of its sole is low and slow, and is off the ground where that is high or fast; in
between it stays as it was, unless it carries nothing; the last that stands is not off before its load is gone. The states
forget nothing of a foot that is lifted: that its force has come to zero is an exact measurement, which tells how the load went
over to the other foot. One that comes to stand begins at zero.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.algebra import dot, fma, get3, get9, minus, plus, put3
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import point_jacobian
from physics_prior.dynamics.point_force import end_of_freedoms, world_velocity
from physics_prior.dynamics.sole import corner_arm, sole_pose
from physics_prior.dynamics.types import Array, Records
from physics_prior.dynamics.unknown_forces import Foot
from physics_prior.estimation.process import State
from physics_prior.estimation.square_root import lower_factor

if TYPE_CHECKING:
    from physics_prior.estimation.forced_process import ForcedProcess

INFORMED = 1e-9  # of the largest deviation of a foot's forces: below it, they are known already
SURE = 2.0  # standard deviations
CLEARLY = 2.0  # times as high or fast as what may be off the ground: whatever it seems to carry


def stands(
    process: "ForcedProcess", index: int, state: State, stood: bool, others: bool, factor: np.ndarray, unsure: float
) -> bool:
    """Whether a foot stands, given whether it did and whether others do; needs ``simulator.move``.

    factor (n, k): of the state's covariance; unsure: standard deviation of the foot's vertical force, N.
    """
    memory, foot = process.simulator.memory, process.unknown.feet[index]
    sole, J, place = foot.sole, np.empty((6, process.nv)), np.empty(3)
    system = (memory.links, memory.work, process.unknown.soles, index)
    height, speed, doubt = lowest_corner(*system, np.ascontiguousarray(factor.T), J, place)
    least_speed = speed - SURE * doubt
    still = height < sole.touch[0] and (speed if others else least_speed) < sole.touch[1]
    if still or not stood:
        return bool(still)
    load, doubt = float(state.force[foot.span][2]), SURE * unsure
    if not others:
        return load > sole.least
    if height > CLEARLY * sole.release[0] or least_speed > CLEARLY * sole.release[1]:
        return False
    if height > sole.release[0] or speed > sole.release[1]:
        return load - doubt > sole.least
    return load + doubt > sole.least


@kernel
def lowest_corner(
    links: Records, work: Records, soles: Records, index: int, U: Array, J: Array, place: Array
) -> tuple[float, float, float]:
    """Height of a sole's lowest corner, m, its speed over the ground, m/s, and the standard deviation of that.

    U (n, m): a factor of the covariance, P = U^T U. J (6, nv), place (3,); needs ``move``.
    """
    sole, nv, lowest = soles[index], J.shape[1], 0
    middle, R = sole_pose(work, sole)
    for corner in range(1, 4):
        if corner_arm(sole, R, corner)[2] < corner_arm(sole, R, lowest)[2]:
            lowest = corner
    p = plus(middle, corner_arm(sole, R, lowest))
    slip = minus(world_velocity(work, sole.link, p), get3(sole.velocity))
    put3(place, plus(get3(sole.center), corner_arm(sole, get9(sole.axes), lowest)))
    point_jacobian(links, work, sole.link, place, J)
    square = 0.0
    for i in range(U.shape[0]):
        x, y, z, link = 0.0, 0.0, 0.0, sole.link
        while link >= 0:
            for k in range(links[link].v, end_of_freedoms(links, link, nv)):
                share = U[i, nv + k]
                x, y, z = fma(J[3, k], share, x), fma(J[4, k], share, y), fma(J[5, k], share, z)
            link = links[link].parent
        square += x * x + y * y + z * z
    return p[2] - sole.height, math.sqrt(dot(slip, slip)), math.sqrt(square)


def settle(process: "ForcedProcess", state: State, factor: np.ndarray) -> tuple[State, np.ndarray]:
    """State and factor after it was decided which feet stand."""
    feet, nv = process.unknown.feet, process.nv
    process.simulator.move(state.q, state.v)
    unsure = np.linalg.norm(factor[2 * nv :], axis=1)
    now = state.grounded.copy()
    for index, foot in enumerate(feet):
        if index in process.told:
            now[index] = process.told[index]
            continue
        others = bool(np.delete(now, index).any())
        deviation = float(unsure[foot.span][2])
        now[index] = stands(process, index, state, bool(now[index]), others, factor, deviation)
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
