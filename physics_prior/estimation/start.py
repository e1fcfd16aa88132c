"""Cold start: a state from measurements alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_prior import rotations
from physics_prior.estimation.filter import QUORUM, Filter, Posterior
from physics_prior.estimation.measurement import Measurement, PointsMeasurement
from physics_prior.estimation.process import State
from physics_prior.estimation.square_root import lower_factor
from physics_prior.estimation.switching import switch
from physics_prior.model import JointKind, Tree
from physics_prior.scene import PointsSource

ITERATIONS = 30
CONVERGED = 1e-9  # rad or m, or of the largest coordinate
SETTLED = 1e-3  # of the estimate's own standard deviations: as good, where large residuals let iterations creep
LARGEST_TURN = 1.0  # rad in one iteration: beyond it a linearisation says nothing; lengths may go any way
OBSERVABLE = 1e-6  # least relative singular value of the whitened measurements by a freedom
TRIES = 6  # starting configurations: the scene's own, then random ones (always the same)
SPREAD = 1.0  # rad or m
NEARLY = 0.25  # of the square of the furthest marker's distance


def start(
    filter: Filter,
    measurements: Sequence[Measurement],
    stamp: int,
    begun: int | None = None,
    active: Sequence[bool] | None = None,
) -> Posterior | None:
    """A posterior at a stamp (ns) from measurements taken as simultaneous; None if they do not fix the configuration.

    Gauss-Newton from several configurations; the best must fit all measurements within the gate's probability, of a frame of
    markers at least half of them, each by itself; the others are not believed. The
    velocity is zero with the scene's standard deviation. begun (ns): the scene's time zero, the stamp where left out;
    active: what holds, as scheduled where left out.
    """
    simulator, measurements = filter.simulator, [each for each in measurements if filter.observes(each)]
    begun = stamp if begun is None else begun
    if active is None:
        active = [effect.active_at((stamp - begun) * 1e-9) for effect in simulator.switches.effects]
    _enter_start(filter, stamp, begun, active)
    rng = np.random.default_rng(0)
    best: Fit | None = None
    for trial in range(TRIES):
        q = filter.scene.initial.q.copy()
        if trial > 0:
            q = simulator.tree.integrate(q, SPREAD * rng.normal(size=simulator.nv))
        fit = _fit(filter, measurements, registered(filter, measurements, q))
        if fit is not None and (best is None or fit.excess < best.excess):
            best = fit
            if fit.excess <= 1.0:
                break
    if best is None or best.excess > 1.0:
        return None
    return posterior_at(filter, _unwound(filter, best.q), best.factor, stamp, begun, active)


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

    Raises:
        SimulationError: the masses that something holds are too unlike for its force to be told from rounding.
    """
    begun = stamp if begun is None else begun
    if active is None:
        active = [effect.active_at((stamp - begun) * 1e-9) for effect in filter.simulator.switches.effects]
    _enter_start(filter, stamp, begun, active)
    nv, n = filter.simulator.nv, filter.process.n
    state = filter.process.start(q, np.zeros(nv))
    factor = np.zeros((n, n))
    factor[:nv, :nv] = factor_q
    deviations = np.concatenate([filter.scene.noise.velocity, filter.process.start_factor(state)])
    factor[nv:, nv:] = np.diag(deviations)
    filter.constrain(state, factor)
    if filter.constrained:
        filter.simulator.switches.require_alike(state.q)
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


@dataclass(frozen=True, eq=False)
class Fit:
    """A configuration q (nq,), the factor (nv, nv) of its covariance, and how bad it is: above 1 beyond the gate."""

    q: np.ndarray
    factor: np.ndarray
    excess: float


def registered(filter: Filter, measurements: Sequence[Measurement], q: np.ndarray) -> np.ndarray:
    """Return q (nq,) with each free body put where its markers are, by the nearest rigid motion.

    Whoever faces away from where the scene begins would otherwise start half a turn off, and Gauss-Newton may not find home.
    """
    simulator, q = filter.simulator, q.copy()
    links = simulator.tree.links
    seen: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    simulator.move(q, np.zeros(simulator.nv))
    for measurement in measurements:
        source = filter.sources[measurement.topic]
        if not isinstance(source, PointsSource) or not isinstance(measurement, PointsMeasurement):
            continue
        for index in measurement.seen:
            marker = source.markers[index]
            root = simulator.tree.frame(marker.part).link
            while root >= 0 and links[root].parent >= 0:
                root = links[root].parent
            if root >= 0 and links[root].joint.kind is JointKind.FREE:
                position, R = simulator.pose(marker.part)
                seen.setdefault(root, []).append((position + R @ np.array(marker.point), measurement.points[index]))
    for root, pairs in seen.items():
        if len(pairs) >= 3:
            here, there = (np.array(points) for points in zip(*pairs, strict=True))
            R, t = nearest_rigid_motion(here, there)
            position, orientation = q[links[root].q][:3], q[links[root].q][3:]
            position[:] = R @ position + t
            orientation[:] = rotations.multiply(rotations.quaternion_from_matrix(R), orientation)
    return q


def nearest_rigid_motion(here: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R (3, 3) and t (3,) that bring points (k, 3) nearest to others, R here + t ~ there, k >= 3 (Arun et al. 1987)."""
    U, _, Vt = np.linalg.svd((there - there.mean(axis=0)).T @ (here - here.mean(axis=0)))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return R, there.mean(axis=0) - R @ here.mean(axis=0)


def _fit(filter: Filter, measurements: Sequence[Measurement], q: np.ndarray) -> Fit | None:
    """The best fit from q; None if not observable or not found.

    Where markers lie beyond the gate, those that do so nearly as far as the furthest are left out, and again, down to the quorum.
    """
    measurements = list(measurements)
    fewest = {index: QUORUM * _count(each) for index, each in enumerate(measurements) if _count(each) > 1}
    while True:
        found = _gauss_newton(filter, measurements, q)
        if found is None:
            return None
        q, factor, cost, redundancy, converged = found
        if not fewest:
            excess = cost / filter.gate_limit(redundancy) if redundancy > 0 else 0.0
            return Fit(q, factor, excess) if converged else None
        state = filter.process.start(q, np.zeros(filter.simulator.nv))
        apart = [_excess(filter, each, state) for each in measurements]
        worst = max(float(np.max(each, initial=0.0)) for each in apart)
        if worst <= 1.0:
            return Fit(q, factor, worst) if converged else None
        before = sum(map(_count, measurements))
        for index, least in fewest.items():
            measurements[index] = _without(measurements[index], apart[index] > max(1.0, NEARLY * worst))
            if _count(measurements[index]) < least:
                return None
        if sum(map(_count, measurements)) == before:
            return None


def _count(measurement: Measurement) -> int:
    """How many markers a frame of them saw; 0 of anything else."""
    return len(measurement.seen) if isinstance(measurement, PointsMeasurement) else 0


def _excess(filter: Filter, measurement: Measurement, state: State) -> np.ndarray:
    """How far each seen marker, or all that was measured, is from where the state has it: squared, over what the gate allows."""
    seen = filter.innovation(measurement, state)
    _, y = seen.whitened
    return np.asarray(np.sum(y.reshape(-1, seen.block) ** 2, axis=1) / filter.gate_limit(seen.block))


def _without(measurement: Measurement, left_out: np.ndarray) -> Measurement:
    """A frame of markers without some of those that it saw, (seen,) bool."""
    assert isinstance(measurement, PointsMeasurement)
    points = measurement.points.copy()
    points[measurement.seen[left_out]] = np.nan
    return replace(measurement, points=points)


def _gauss_newton(
    filter: Filter, measurements: Sequence[Measurement], q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, int, bool] | None:
    """Configuration, covariance factor, cost, redundancy of the best fit from q, and whether found; None if not observable."""
    simulator, v = filter.simulator, np.zeros(filter.simulator.nv)
    turning = _turning(simulator.tree)
    state = filter.process.start(q.copy(), v)
    converged = True
    for _ in range(ITERATIONS):
        rows, errors = [np.zeros((0, simulator.nv))], [np.zeros(0)]
        for measurement in measurements:
            seen = filter.innovation(measurement, state)
            own_rows, own_errors = seen.whitened
            rows.append(own_rows)
            errors.append(own_errors)
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
        converged = float(np.linalg.norm(U.T @ y)) < SETTLED
    factor = np.zeros((simulator.nv, simulator.nv))
    factor[:, : basis.shape[1]] = basis @ V.T / s
    cost = float(y @ y - np.sum((U.T @ y) ** 2))
    return state.q, lower_factor(factor), cost, len(y) - basis.shape[1], converged


def _unwound(filter: Filter, q: np.ndarray) -> np.ndarray:
    """Return q (nq,) with each hinge within half a turn of where the scene begins: what is measured tells no full turns."""
    q, begin = q.copy(), filter.scene.initial.q
    for link in filter.simulator.tree.links:
        if link.joint.kind is JointKind.REVOLUTE:
            q[link.q] -= 2.0 * np.pi * np.round((q[link.q] - begin[link.q]) / (2.0 * np.pi))
    return q


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
