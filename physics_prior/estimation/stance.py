"""A foot that stands hardly moves: a measurement of velocity that needs no sensor (zero-velocity update: Foxlin 2005).

Without it a light foot under a load is an inverted pendulum: an error of its tilt gives the load a lever, and where no marker
tells the tilt, it doubles within milliseconds. The ground forbids that; the unknown wrench alone does not know it.

The corners of the sole go with the ground but for white noise of velocity: the more of it, the further a corner is from the
ground and the less the foot carries. A heel that rises while the toes stand is free, and so is a foot that has just landed or is
about to leave.
"""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.unknown_forces import Foot
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
    simulator = process.simulator
    simulator.move(state.q, state.v)
    told = [_slip(simulator, foot, max(state.force[foot.span][2], 0.0) / process.scale) for foot in standing]
    rows, y = (np.concatenate(each) for each in zip(*told, strict=True))
    H = np.hstack([np.zeros_like(rows), rows])
    noise = STILL / np.sqrt(seconds) * np.eye(len(y))
    gain = gain_of(np.ascontiguousarray(factor.T), Innovation(y, H, noise, 6))
    there = process.displace(state, gain.correction)
    state.q[:], state.v[:], state.force[:] = there.q, there.v, there.force
    return gain.factor


def _slip(simulator: Simulator, foot: Foot, share: float) -> tuple[np.ndarray, np.ndarray]:
    """(6, nv) and (6,) m/s: what the velocities of a sole's corners tell, in as many rows as the sole has freedoms.

    Of points at a from its middle with weights w, those are the triangular factor of the rows w [-a x, 1] times the middle's
    twist. share: of the weight, that it carries.
    """
    sole = foot.sole
    position, R = simulator.pose(sole.part)
    J = simulator.jacobian(sole.part, sole.center)
    velocity, omega = simulator.velocity(sole.part)
    arms = (sole.corners - sole.center) @ R.T
    middle = R @ sole.center
    heights = np.abs(position[2] + middle[2] + arms[:, 2] - sole.height)
    weights = share / (1.0 + heights / ROLLING)
    corners = [w * np.hstack([-rotations.skew(a), np.eye(3)]) for w, a in zip(weights, arms, strict=True)]
    _, factor = np.linalg.qr(np.concatenate(corners))
    twist = np.concatenate([omega, velocity + np.cross(omega, middle) - sole.velocity])
    return factor @ J, -factor @ twist
