"""Readouts: the named scalars that a scene asks for, at a state, with their rates and uncertainties."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from physics_prior.dynamics.contact.admissible import admissible_errors
from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.filter import Posterior
from physics_prior.estimation.process import Process
from physics_prior.scene import AngleReadout, EnergyReadout, ForceReadout, JointReadout, PointReadout, Readout

DIFFERENCE = 1e-3  # of a standard deviation (or of a second, for rates)
UNITS = {"joint": "rad", "angle": "rad", "point": "m", "energy": "J", "force": "N"}
COORDINATES = (JointReadout, AngleReadout, PointReadout)
"""Readouts of the configuration alone: these have rates and can be compared with a reference."""

Values = dict[str, np.ndarray]
"""Readout name -> () or (3,)."""


def evaluate(
    readouts: Sequence[Readout], simulator: Simulator, q: np.ndarray, v: np.ndarray, vdot: np.ndarray | None = None
) -> Values:
    """The readouts' values at a state; vdot only where it was measured and not predicted (see Simulator.wrench_array).

    Angles lie in (-pi, pi]; forces act ON the held or carried part, in world axes.
    """
    out: Values = {}
    forces: dict[str, np.ndarray] = {}
    if any(isinstance(readout, ForceReadout) for readout in readouts):
        forces = dict(zip(simulator.wrench_names, simulator.wrench_array(q, v, vdot)[:, :3], strict=True))
    else:
        simulator.move(q, v)
    for readout in readouts:
        if isinstance(readout, JointReadout):
            out[readout.name] = np.array(q[simulator.tree.link(readout.joint).q][0])
        elif isinstance(readout, AngleReadout):
            out[readout.name] = np.array(_angle(readout, simulator.pose(readout.part)[1]))
        elif isinstance(readout, PointReadout):
            position, R = simulator.pose(readout.part)
            out[readout.name] = np.array((position + R @ np.array(readout.point)) @ np.array(readout.axis))
        elif isinstance(readout, EnergyReadout):
            out[readout.name] = np.array(simulator.energy())
        elif isinstance(readout, ForceReadout):
            force = forces[readout.constraint]
            if readout.component == "norm":
                force = np.array(np.linalg.norm(force))
            elif readout.component != "vector":
                force = np.array(force["xyz".index(readout.component)])
            out[readout.name] = force
    return out


def unit(readout: Readout, simulator: Simulator) -> str:
    """The unit of a readout's value."""
    if isinstance(readout, JointReadout):
        return "m" if simulator.tree.joint(readout.joint).kind.name == "PRISMATIC" else "rad"
    return UNITS[readout.kind]


def rates(readouts: Sequence[Readout], simulator: Simulator, q: np.ndarray, v: np.ndarray) -> Values:
    """The time derivatives of readouts of the configuration, by a central difference along v."""
    speed = max(float(np.max(np.abs(v), initial=0.0)), 1.0)
    delta = 1e-5 / speed
    ahead = evaluate(readouts, simulator, simulator.displaced(q, delta * v), v)
    behind = evaluate(readouts, simulator, simulator.displaced(q, -delta * v), v)
    return {name: difference(ahead[name], behind[name], _is_angle(readouts, name)) / (2.0 * delta) for name in ahead}


def jacobian(readouts: Sequence[Readout], simulator: Simulator, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(readouts, nv) derivatives of readouts of the configuration by the tangent of q, by central differences."""
    columns = []
    for direction in np.eye(simulator.nv):
        ahead = evaluate(readouts, simulator, simulator.displaced(q, 1e-6 * direction), v)
        behind = evaluate(readouts, simulator, simulator.displaced(q, -1e-6 * direction), v)
        columns.append([difference(ahead[n], behind[n], _is_angle(readouts, n)) / 2e-6 for n in ahead])
    return np.array(columns, dtype=float).T


def deviations(readouts: Sequence[Readout], simulator: Simulator, process: Process, posterior: Posterior) -> Values:
    """Standard deviations of the readouts: by differences along the columns of the covariance's factor.

    Those of forces are given that what touches goes on touching.
    """
    forces = [readout for readout in readouts if isinstance(readout, ForceReadout)]
    errors = force_errors(simulator, posterior) if forces else posterior.factor
    if errors is posterior.factor:
        return _deviations(readouts, simulator, process, posterior, errors)
    others = [readout for readout in readouts if readout not in forces]
    return {
        **_deviations(others, simulator, process, posterior, posterior.factor),
        **_deviations(forces, simulator, process, posterior, errors),
    }


def force_errors(simulator: Simulator, posterior: Posterior) -> np.ndarray:
    """(n, k) the columns of a posterior's factor as far as they leave be what touches (dynamics/contact/admissible.py)."""
    state = posterior.state
    if len(state.acceleration):
        return posterior.factor
    return admissible_errors(simulator, state.q, state.v, posterior.factor)


def _deviations(
    readouts: Sequence[Readout], simulator: Simulator, process: Process, posterior: Posterior, errors: np.ndarray
) -> Values:
    here = posterior.state
    values = evaluate(readouts, simulator, here.q, here.v, measured_acceleration(here.acceleration))
    total = {name: np.zeros_like(value) for name, value in values.items()}
    for column in errors.T:
        if not column.any():
            continue
        pair = []
        for sign in (DIFFERENCE, -DIFFERENCE):
            state = process.displace(here, sign * column)
            process.enter(state)
            pair.append(evaluate(readouts, simulator, state.q, state.v, measured_acceleration(state.acceleration)))
        for name in pair[0]:
            slope = difference(pair[0][name], pair[1][name], _is_angle(readouts, name)) / (2.0 * DIFFERENCE)
            total[name] = total[name] + slope**2
    process.enter(here)
    return {name: np.sqrt(square) for name, square in total.items()}


def measured_acceleration(acceleration: np.ndarray) -> np.ndarray | None:
    """The acceleration of a process that keeps one, None for one whose dynamics tell it."""
    return acceleration if len(acceleration) else None


def difference(end: np.ndarray, start: np.ndarray, angle: bool) -> np.ndarray:
    """End - start, the shorter way round for angles."""
    delta: np.ndarray = np.asarray(end) - np.asarray(start)
    return np.mod(delta + np.pi, 2.0 * np.pi) - np.pi if angle else delta


def _is_angle(readouts: Sequence[Readout], name: str) -> bool:
    return any(isinstance(readout, AngleReadout | JointReadout) and readout.name == name for readout in readouts)


def _angle(readout: AngleReadout, R: np.ndarray) -> float:
    """The angle about the world axis from the world's direction zero to the part's, both seen along the axis."""
    zero, first, side = _angle_axes(readout)
    turned = R @ zero
    return math.atan2(side @ turned, first @ turned)


@cache
def _angle_axes(readout: AngleReadout) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The direction zero, its part across the axis, and the direction a quarter turn further."""
    axis, zero = np.array(readout.axis), np.array(readout.zero)
    first = zero - axis * (axis @ zero)
    return zero, first, np.cross(axis, first)
