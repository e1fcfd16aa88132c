"""Cold start: a state from measurements alone."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.measurement import Measurement
from physics_prior.estimation.square_root import lower_factor
from physics_prior.estimation.switching import switch
from physics_prior.model import JointKind, Tree

ITERATIONS = 30
CONVERGED = 1e-9  # rad or m, or of the largest coordinate
LARGEST_TURN = 1.0  # rad in one iteration: beyond it a linearisation says nothing; lengths may go any way
OBSERVABLE = 1e-6  # least relative singular value of the whitened measurements by a freedom
TRIES = 6  # starting configurations: the scene's own, then random ones (always the same)
SPREAD = 1.0  # rad or m


def start(
    filter: Filter,
    measurements: Sequence[Measurement],
    stamp: int,
    begun: int | None = None,
    active: Sequence[bool] | None = None,
) -> Posterior | None:
    """A posterior at a stamp (ns) from measurements taken as simultaneous; None if they do not fix the configuration.

    Gauss-Newton from several configurations; the best must fit all measurements within the gate's probability. The
    velocity is zero with the scene's standard deviation. begun (ns): the scene's time zero, the stamp where left out;
    active: what holds, as scheduled where left out.
    """
    simulator, measurements = filter.simulator, [each for each in measurements if filter.observes(each)]
    begun = stamp if begun is None else begun
    if active is None:
        active = [effect.active_at((stamp - begun) * 1e-9) for effect in simulator.switches.effects]
    _enter_start(filter, stamp, begun, active)
    rng = np.random.default_rng(0)
    best: tuple[float, np.ndarray, np.ndarray, int] | None = None
    for trial in range(TRIES):
        q = filter.scene.initial.q.copy()
        if trial > 0:
            q = simulator.tree.integrate(q, SPREAD * rng.normal(size=simulator.nv))
        fit = _gauss_newton(filter, measurements, q)
        if fit is not None and (best is None or fit[0] < best[0]):
            best = fit
            if _plausible(filter, fit[0], fit[3]):
                break
    if best is None or not _plausible(filter, best[0], best[3]):
        return None
    _, q, factor_q, _ = best
    return posterior_at(filter, q, factor_q, stamp, begun, active)


def posterior_at(
    filter: Filter,
    q: np.ndarray,
    factor_q: np.ndarray,
    stamp: int,
    begun: int | None = None,
    active: Sequence[bool] | None = None,
) -> Posterior:
    """A starting posterior: configuration q with factor (nv, nv), at rest with the scene's velocity deviation.

    Arguments else as of ``start``. What holds its part wherever it is takes hold last.
    """
    begun = stamp if begun is None else begun
    if active is None:
        active = [effect.active_at((stamp - begun) * 1e-9) for effect in filter.simulator.switches.effects]
    _enter_start(filter, stamp, begun, active)
    nv, n = filter.simulator.nv, filter.process.n
    state = filter.process.start(q, np.zeros(nv))
    factor = np.zeros((n, n))
    factor[:nv, :nv] = factor_q
    deviations = np.concatenate([filter.scene.noise.velocity, filter.process.start_factor()])
    factor[nv:, nv:] = np.diag(deviations)
    filter.constrain(state, factor)
    holds = filter.simulator.switches.holds
    posterior = Posterior(stamp, state, factor, accepted=stamp, used=True, start=True, begun=begun, holds=holds)
    for index, on in enumerate(active):
        posterior = switch(filter, posterior, index, on)
    return posterior


def _enter_start(filter: Filter, stamp: int, begun: int, active: Sequence[bool]) -> None:
    """Have the simulator hold, at the time of a start, what holds at places that it was told."""
    simulator = filter.simulator
    simulator.time = (stamp - begun) * 1e-9
    simulator.switches.holds = simulator.switches.told(active)


def _plausible(filter: Filter, cost: float, freedom: int) -> bool:
    """Whether residuals of this squared length fit that many redundant rows."""
    return freedom <= 0 or cost <= float(chi2.ppf(filter.scene.gate.probability, freedom))


def _gauss_newton(
    filter: Filter, measurements: Sequence[Measurement], q: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, int] | None:
    """Cost, configuration, covariance factor and redundancy of the best fit from q; None if not observable or not found."""
    simulator, v = filter.simulator, np.zeros(filter.simulator.nv)
    turning = _turning(simulator.tree)
    state = filter.process.start(q, v)
    for _ in range(ITERATIONS):
        rows, errors = [np.zeros((0, simulator.nv))], [np.zeros(0)]
        for measurement in measurements:
            seen = filter.innovation(measurement, state)
            rows.append(np.linalg.solve(seen.noise, seen.H))
            errors.append(np.linalg.solve(seen.noise, seen.y))
        H, y = np.concatenate(rows), np.concatenate(errors)
        basis = _free_directions(filter, state.q)
        if len(H) == 0:
            return None
        U, s, V = np.linalg.svd(H @ basis, full_matrices=False)
        if len(s) < basis.shape[1] or s[-1] <= OBSERVABLE * s[0]:
            return None
        step = basis @ (V.T @ ((U.T @ y) / s))
        turn = float(np.max(np.abs(step[turning]), initial=0.0))
        state.q[:] = simulator.displaced(state.q, step * min(1.0, LARGEST_TURN / max(turn, LARGEST_TURN)))
        simulator.project(state.q, v)
        if np.max(np.abs(step)) < CONVERGED * max(1.0, float(np.max(np.abs(state.q)))):
            break
    else:
        return None
    factor = np.zeros((simulator.nv, simulator.nv))
    factor[:, : basis.shape[1]] = basis @ V.T / s
    return float(y @ y - np.sum((U.T @ y) ** 2)), state.q, lower_factor(factor), len(y) - basis.shape[1]


def _turning(tree: Tree) -> np.ndarray:
    """(nv,) which degrees of freedom turn."""
    turning = np.zeros(tree.nv, dtype=bool)
    for link in tree.links:
        if link.joint.kind is not JointKind.PRISMATIC:
            turning[link.v][-3:] = True
    return turning


def _free_directions(filter: Filter, q: np.ndarray) -> np.ndarray:
    """(nv, k) orthonormal directions of motion that the constraints leave."""
    nv = filter.simulator.nv
    if filter.simulator.rows == 0:
        return np.eye(nv)
    A, _ = filter.simulator.tangent_rows(q, np.zeros(nv))
    _, s, V = np.linalg.svd(A)
    rank = int(np.sum(s > 1e-9 * max(s[0], 1e-300)))
    return V[rank:].T
