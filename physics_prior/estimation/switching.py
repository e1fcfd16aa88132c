"""What takes hold or lets go inside the estimate, and what a taking hold does to a state and its covariance (eq. 9).

Where the effect holds a point at a place that it was told, e(q) = 0 is an exact measurement of the configuration: state and
covariance are conditioned on it. Where it holds wherever the part is, e says nothing: the anchor is as far off as the
state. The velocity then changes by the impulse, v+ = v - M^-1 A^T (A M^-1 A^T)^-1 (A v), a map of the state before, so that
its covariance changes by that map's derivative. Letting go changes neither: the noise of forces opens what was closed.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.assembly import ASSEMBLED, assemble, turned_over
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.switches import Hold
from physics_prior.errors import SimulationError
from physics_prior.estimation.measurement import ForceMeasurement, Measurement, SwitchCommand
from physics_prior.estimation.process import State
from physics_prior.estimation.square_root import lower_factor
from physics_prior.scene import SwitchSource

if TYPE_CHECKING:
    from physics_prior.estimation.filter import Filter, Posterior

ITERATIONS = 8  # of conditioning on a place, by Gauss-Newton
INFORMED = 1e-9  # of the largest standard deviation that rows have: below it, the state knows them already
DIFFERENCE = 1e-6  # rad or m: half the step of the impulse's derivatives


@dataclass(frozen=True, eq=False)
class Grip:
    """How something took hold.

    Attributes:
        holds: what holds afterwards.
        state, factor: just before, conditioned on where it took hold.
        F: (n, n) derivative of the error after by the error before.
        after, factor_after: state and factor just after.
    """

    holds: tuple[Hold, ...]
    state: State
    factor: np.ndarray
    F: np.ndarray
    after: State
    factor_after: np.ndarray


def decision(filter: "Filter", measurement: Measurement, active: Sequence[bool]) -> tuple[int, bool]:
    """Which effect a command or a measured force is about, and whether it says that it holds; active: what holds so far."""
    switches = filter.simulator.switches
    if isinstance(measurement, SwitchCommand):
        return switches.index(measurement.effect), measurement.on
    source = filter.sources[measurement.topic]
    assert isinstance(source, SwitchSource)
    assert isinstance(measurement, ForceMeasurement)
    index, size = switches.index(source.effect), float(np.linalg.norm(measurement.force))
    return index, size > source.above or (active[index] and size >= source.below)


def active_at_start(filter: "Filter", begun: int, stamp: int, known: Iterable[Measurement]) -> list[bool]:
    """What holds at a stamp by schedule and by the commands and forces known until then, all stamps in ns."""
    switches = filter.simulator.switches
    active = [effect.active_at(0.0) for effect in switches.effects]
    happened: list[tuple[int, int, Measurement | None, int, bool]] = [
        (begun + event.time, -len(active) - 1, None, event.index, event.on) for event in switches.events
    ]
    happened += [(*filter.key(each), each, 0, False) for each in known if not filter.observes(each)]
    for when, _, measurement, index, on in sorted(happened, key=lambda each: each[:2]):
        if when <= stamp:
            index, on = (index, on) if measurement is None else decision(filter, measurement, active)
            active[index] = on
    return active


def switch(filter: "Filter", posterior: "Posterior", index: int, on: bool) -> "Posterior":
    """The posterior after an effect was switched; one that cannot take hold stays off, and ``trouble`` tells why."""
    if posterior.holds[index].active == on:
        return posterior
    filter.enter(posterior)
    if not on:
        return replace(posterior, holds=filter.simulator.switches.switched(index, False, posterior.state.q), trouble="")
    try:
        grip = take_hold(filter, posterior, index)
    except SimulationError as problem:
        return replace(posterior, trouble=str(problem))
    return replace(posterior, state=grip.after, factor=grip.factor_after, holds=grip.holds, trouble="")


def take_hold(filter: "Filter", posterior: "Posterior", index: int) -> Grip:
    """Have an effect take hold.

    Raises:
        SimulationError: it cannot.
    """
    filter.enter(posterior)
    simulator, process = filter.simulator, filter.process
    switches, nv = simulator.switches, simulator.nv
    state, factor = posterior.state.copy(), posterior.factor.copy()
    switches.holds = switches.switched(index, True, state.q)
    if not (filter.constrained and switches.grips(index)):
        return Grip(switches.holds, state, factor, np.eye(process.n), state, factor)
    if not switches.holds[index].caught:
        state, factor = _condition(filter, state, factor, index)
    left = assemble(simulator, state.q, state.v.copy())
    if not left <= ASSEMBLED or turned_over(simulator):
        raise SimulationError(f"'{switches.labels[index]}' could not take hold: {left:.3g} m were left, or half a turn")
    switches.require_alike(state.q)
    F = np.zeros((2 * nv, 2 * nv))
    F[:nv, :nv] = np.eye(nv)
    F[nv:] = _impulse_derivative(simulator, state)
    after, factor_after = state.copy(), lower_factor(F @ factor)
    simulator.project_velocity(after.q, after.v)
    simulator.constrain(after.q, after.v, factor_after)
    return Grip(switches.holds, state, factor, F, after, factor_after)


def _condition(filter: "Filter", state: State, factor: np.ndarray, index: int) -> tuple[State, np.ndarray]:
    """State and factor told that an effect's points are together: the oblique projection by the covariance."""
    simulator, process = filter.simulator, filter.process
    span = simulator.switches.row_span(index)
    prior, z = state, np.zeros(process.n)
    for _ in range(ITERATIONS):
        error = simulator.constraint_error(state.q, state.v)[span]
        HS = simulator.tangent_rows(state.q, state.v)[0][span] @ factor[: simulator.nv]
        U, s, V = np.linalg.svd(HS, full_matrices=False)
        told = s > INFORMED * float(np.linalg.norm(factor[: simulator.nv]))
        U, s, V = U[:, told], s[told], V[told]
        if not len(s):
            return state, factor
        # the correction is S z, z the shortest for which error + H S (z - z before) = 0
        before, z = z, V.T @ ((U.T @ (HS @ z - error)) / s)
        state = process.displace(prior, factor @ z)
        if np.max(np.abs(factor @ (z - before))) < ASSEMBLED:
            break
    return state, lower_factor(factor - (factor @ V.T) @ V)


def _impulse_derivative(simulator: Simulator, state: State) -> np.ndarray:
    """(nv, 2 nv) derivative of the velocity after an impulse by the tangent of q and by v before."""
    nv = simulator.nv

    def after(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        out = v.copy()
        simulator.project_velocity(q, out)
        return out

    out, reference = np.zeros((nv, 2 * nv)), after(state.q, state.v)
    for k, one in enumerate(np.eye(nv)):
        ahead, behind = (simulator.displaced(state.q, sign * DIFFERENCE * one) for sign in (1.0, -1.0))
        out[:, k] = (after(ahead, state.v) - after(behind, state.v)) / (2.0 * DIFFERENCE)
        out[:, nv + k] = after(state.q, state.v + one) - reference  # it is linear in v
    return out
