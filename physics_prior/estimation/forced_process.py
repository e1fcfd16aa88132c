"""Physics with unknown forces: muscles and what the ground does to feet are states beside configuration and velocity.

The state is x = (q, v, f). Over a step of h seconds f is constant; the scene's own step and its derivatives know it as any
other force. Its errors go on as
    d(q, v) = F d(q, v) + h/2 (1 + F) [0; M^-1 D] df,  df = exp(-h/T) df + w,  w of variance s^2 (1 - exp(-2 h/T)),
with D f the generalized forces of f: the Ornstein-Uhlenbeck process of each about its mean (Maybeck 1979, ch. 4.11).

Muscles hold the posture against what the ground does: the noise of a foot's wrench w comes with torques that leave the
accelerations of the joints as they are, so that a surprise under the foot moves the whole body, not the foot alone.
"""

import numpy as np

from physics_prior.dynamics.arrays import accumulate, clear, copy
from physics_prior.dynamics.compose import GRAVITY
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.linear_solve import factorize_square, solve_square
from physics_prior.dynamics.products import add_product
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.types import Array
from physics_prior.estimation import bearing, ground, stance
from physics_prior.estimation.process import OnManifold, State, WhiteForces
from physics_prior.scene import Scene


@kernel
def respond(
    M: Array,
    D: Array,
    torques: Array,
    held: Array,
    passive: Array,
    noise: Array,
    response: Array,
    A: Array,
    B: Array,
    pivots: Array,
) -> None:
    """Fill response (nf, nv), accelerations M^-1 D per unknown force, and in noise (nf, nf) the torques that go with feet's.

    M (nv, nv), which is lost; D (nv, nf). noise comes as the diagonal of each force's own; the torques (k,) act on the freedoms
    held, the passive (p,) are the others. A (p, p), B (nv, nf) and pivots (nv,) are scratch.
    """
    nv, nf = D.shape
    for i in range(passive.shape[0]):
        for j in range(passive.shape[0]):
            A[i, j] = M[passive[i], passive[j]]
        for j in range(nf):
            B[i, j] = D[passive[i], j] * noise[j, j]
    for k in range(torques.shape[0]):
        for j in range(nf):
            if j != torques[k]:
                noise[torques[k], j] = -D[held[k], j] * noise[j, j]
    factorize_square(A, pivots)
    solve_square(A, pivots, B[: passive.shape[0]])
    for k in range(torques.shape[0]):
        for i in range(passive.shape[0]):
            accumulate(M[held[k], passive[i]], B[i], noise[torques[k]])
    copy(D, B)
    factorize_square(M, pivots)
    solve_square(M, pivots, B)
    for j in range(nf):
        for k in range(nv):
            response[j, k] = B[k, j]


@kernel
def carry_forced(F: Array, response: Array, h: float, forgotten: Array, U: Array, by_force: Array, out: Array) -> None:
    """Fill the first n rows of out (., n) with a factor U (n, n) carried by h seconds; P = U^T U, everything transposed.

    F (2 nv, 2 nv): derivative of (q, v); response (nf, nv): accelerations by each force; forgotten (nf,): derivative of each by
    itself; by_force (nf, 2 nv): filled with that of (q, v) by the forces.
    """
    n, m, nv = U.shape[0], F.shape[0], response.shape[1]
    clear(by_force)
    add_product(response, 0, F[nv:], by_force)
    for i in range(by_force.shape[0]):
        for j in range(nv):
            by_force[i, nv + j] += response[i, j]
        for j in range(m):
            by_force[i, j] *= 0.5 * h
    add_product(U, 0, F, out[:n])
    add_product(U, m, by_force, out[:n])
    for i in range(n):
        for j in range(m, n):
            out[i, j] = forgotten[j - m] * U[i, j]


class ForcedProcess(OnManifold):
    """The scene's own step with unknown forces (dynamics/unknown_forces.py); n = 2 nv + nf.

    Attributes:
        told: foot -> whether it stands, where that is not to be decided (landings.py).
    """

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 2 * simulator.nv + simulator.unknown.count)
        self.unknown, self.nv = simulator.unknown, simulator.nv
        self._white = WhiteForces(scene, simulator)
        self._passive = np.setdiff1d(np.arange(self.nv), self.unknown.freedoms)
        gravity = simulator.memory.parameters[:GRAVITY]
        self._weight = simulator.tree.mass * float(np.linalg.norm(gravity))
        self.scale = max(self._weight, 1.0)
        self.told: dict[int, bool] = {}

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        force = np.zeros(self.unknown.count)
        state = State(q, v, np.zeros(0), force, np.zeros(len(self.unknown.feet), dtype=bool))
        self.simulator.move(q, v)
        sure = np.zeros((self.n, 1))
        for index in range(len(self.unknown.feet)):
            state.grounded[index] = ground.stands(self, index, state, False, False, sure, 0.0)
        force[:] = self._mean(state)
        return state

    def start_factor(self, state: State) -> np.ndarray:
        return np.where(self._acting(state), self.unknown.deviation, 0.0)

    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        W = self.carry(state, np.eye(self.n), h)
        return W[:, : self.n], W[:, self.n :]

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        nv, nf, n = self.nv, self.unknown.count, self.n
        self.enter(state)
        M = self.simulator.mass_matrix(state.q)
        D = self.unknown.columns(self.simulator)
        forgotten = np.exp(-h / self.unknown.time_constant)
        noise = np.diag(self.unknown.deviation * np.sqrt(1.0 - forgotten**2) * self._acting(state))
        response, at, passive = np.empty((nf, nv)), (self.unknown.torques, self.unknown.freedoms), len(self._passive)
        scratch = np.empty((passive, passive)), np.empty((nv, nf)), np.empty(nv)
        respond(M, D, *at, self._passive, noise, response, *scratch)
        F, G = (each.T for each in self.simulator.linearise(state.q, state.v, h, self._white.factor(state)))
        mean = self._mean(state)
        state.force = mean + forgotten * (state.force - mean)
        columns = 2 * nv if self._white.any else 0
        W = np.zeros((n + columns + nf, n))
        carry_forced(F, response, h, forgotten, np.ascontiguousarray(factor.T), np.empty((nf, 2 * nv)), W)
        W[n : n + columns, : 2 * nv] = G[:columns]
        W[n + columns :, 2 * nv :] = noise.T
        return W.T

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        factor = super().predict(state, factor, h, count)
        factor = stance.keep_still(self, state, factor, h * count)
        self.admit(state, factor)
        return factor

    def displace(self, state: State, error: np.ndarray) -> State:
        out = super().displace(state, error)
        out.force = state.force + error[2 * self.nv :]
        return out

    def difference(self, start: State, end: State) -> np.ndarray:
        return np.concatenate([super().difference(start, end), end.force - start.force])

    def settle(self, state: State, factor: np.ndarray) -> tuple[State, np.ndarray]:
        return ground.settle(self, state, factor)

    def admit(self, state: State, factor: np.ndarray) -> bool:
        return bearing.admit(self, state, factor)

    def _acting(self, state: State) -> np.ndarray:
        """(nf,) bool: which unknown forces there are; those of feet off the ground are not."""
        acting = np.ones(self.unknown.count, dtype=bool)
        for foot, grounded in zip(self.unknown.feet, state.grounded, strict=True):
            acting[foot.span] = grounded
        return acting

    def _mean(self, state: State) -> np.ndarray:
        """(nf,) N or N m, to which forces return: the weight, in equal shares under the feet that stand; no torque."""
        mean = np.zeros(self.unknown.count)
        for foot, grounded in zip(self.unknown.feet, state.grounded, strict=True):
            if grounded:
                mean[foot.span.start + 2] = self._weight / np.count_nonzero(state.grounded)
        return mean
