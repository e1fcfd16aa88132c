"""A foot that stands hardly moves: a measurement of velocity that needs no sensor (zero-velocity update: Foxlin 2005).

Without it a light foot under a load is an inverted pendulum: an error of its tilt gives the load a lever, and where no marker
tells the tilt, it doubles within milliseconds. The ground forbids that; the unknown wrench alone does not know it.

The corners of the sole go with the ground but for white noise of velocity: the more of it, the further a corner is from the
ground and the less the foot carries. A heel that rises while the toes stand is free, and so is a foot that has just landed or is
about to leave.
"""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.algebra import ZERO, get3, minus, put3
from physics_prior.dynamics.arrays import clear
from physics_prior.dynamics.covariance import triangularise
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import point_jacobian
from physics_prior.dynamics.point_force import world_velocity
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.sole import corner_arm, sole_pose
from physics_prior.dynamics.types import Array, Records
from physics_prior.estimation.gain import gain_of
from physics_prior.estimation.observation import Innovation
from physics_prior.estimation.process import State

if TYPE_CHECKING:
    from physics_prior.estimation.forced_process import ForcedProcess

STILL = 0.055  # m/s sqrt(s): of a corner on the ground under the whole weight; 0.17 m/s over 0.1 s
ROLLING = 0.02  # m: a corner so far from the ground has twice that


def keep_still(process: "ForcedProcess", state: State, factor: np.ndarray, seconds: float) -> np.ndarray:
    """Tell a state, in place, that for so many seconds its feet that stand hardly moved; return its factor (n, n) then."""
    standing = [foot for foot, grounded in zip(process.unknown.feet, state.grounded, strict=True) if grounded]
    if not standing:
        return factor
    nv, memory = process.nv, process.simulator.memory
    process.simulator.move(state.q, state.v)
    y, H = np.empty(6 * len(standing)), np.empty((6 * len(standing), nv))
    corners, J, scratch = np.empty((12, 6)), np.empty((6, nv)), np.empty(18)
    for row, foot in enumerate(standing):
        share, own = max(state.force[foot.span][2], 0.0) / process.scale, slice(6 * row, 6 * row + 6)
        system = (memory.links, memory.work, process.unknown.soles, process.unknown.feet.index(foot))
        tell_slip(*system, share, y[own], H[own], corners, J, scratch)
    noise = STILL / np.sqrt(seconds) * np.eye(len(y))
    gain = gain_of(np.ascontiguousarray(factor.T), Innovation(y, H, noise, 6, nv), np.zeros(nv))
    there = process.displace(state, gain.correction)
    state.q[:], state.v[:], state.force[:] = there.q, there.v, there.force
    return gain.factor()


@kernel
def tell_slip(
    links: Records,
    work: Records,
    soles: Records,
    index: int,
    share: float,
    y: Array,
    H: Array,
    corners: Array,
    J: Array,
    scratch: Array,
) -> None:
    """Fill y (6,) m/s and H (6, nv): what the velocities of a sole's corners tell, in as many rows as the sole has freedoms.

    Of points at a from its middle with weights w, those are the triangular factor of the rows w [-a x, 1] times the middle's
    twist. share: of the weight, that it carries. corners (12, 6), J (6, nv) and scratch (18,) are scratch; needs ``move``.
    """
    sole = soles[index]
    middle, R = sole_pose(work, sole)
    clear(corners)
    for corner in range(4):
        arm, row = corner_arm(sole, R, corner), 3 * corner
        weight = share / (1.0 + abs(middle[2] + arm[2] - sole.height) / ROLLING)
        for c in range(3):
            corners[row + c, 3 + c] = weight
        corners[row, 1], corners[row, 2] = weight * arm[2], -weight * arm[1]
        corners[row + 1, 2], corners[row + 1, 0] = weight * arm[0], -weight * arm[2]
        corners[row + 2, 0], corners[row + 2, 1] = weight * arm[1], -weight * arm[0]
    triangularise(corners, 6, scratch)
    put3(scratch[:3], get3(sole.center))
    point_jacobian(links, work, sole.link, scratch[:3], J)
    omega = ZERO if sole.link < 0 else get3(work[sole.link].omega)
    put3(scratch[:3], omega)
    put3(scratch[3:6], minus(world_velocity(work, sole.link, middle), get3(sole.velocity)))
    clear(H)
    add_product(corners[:6], 0, J, H)
    for row in range(6):
        y[row] = 0.0
        for c in range(6):
            y[row] -= corners[row, c] * scratch[c]
