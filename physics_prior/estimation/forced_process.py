"""Physics with unknown forces: muscles and what the ground does to feet are states beside configuration and velocity.

The state is x = (q, v, f). Over a step of h seconds f is constant; the scene's own step and its derivatives know it as any
other force. Its errors go on as
    d(q, v) = F d(q, v) + h/2 (1 + F) [0; M^-1 D] df,  df = exp(-h/T) df + w,  w of variance s^2 (1 - exp(-2 h/T)),
with D f the generalized forces of f: the Ornstein-Uhlenbeck process of each about its mean (Maybeck 1979, ch. 4.11).

Muscles hold the posture against what the ground does: the noise of a foot's wrench w comes with torques that leave the
accelerations of the joints as they are, so that a surprise under the foot moves the whole body, not the foot alone.
"""

import numpy as np

from physics_prior.dynamics.arrays import add_product
from physics_prior.dynamics.compose import GRAVITY
from physics_prior.dynamics.covariance import add_rows
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.types import Array
from physics_prior.estimation import bearing, ground, stance
from physics_prior.estimation.process import OnManifold, State, WhiteForces
from physics_prior.scene import Scene


@kernel
def carry_forced(F: Array, by_force: Array, forgotten: Array, U: Array, out: Array) -> None:
    """Fill the first n rows of out (., n) with a factor U (n, n) carried; P = U^T U, everything transposed.

    F (2 nv, 2 nv) and by_force (nf, 2 nv): derivatives of (q, v); forgotten (nf,): that of each force by itself.
    """
    n, m = U.shape[0], F.shape[0]
    for i in range(n):
        row, own = out[i], U[i]
        add_rows(own[:m], F, row)
        add_rows(own[m:], by_force, row)
        for j in range(m, n):
            row[j] = forgotten[j - m] * own[j]


class ForcedProcess(OnManifold):
    """The scene's own step with unknown forces (dynamics/unknown_forces.py); n = 2 nv + nf."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 2 * simulator.nv + simulator.unknown.count)
        self.unknown, self.nv = simulator.unknown, simulator.nv
        self._white = WhiteForces(scene, simulator)
        passive = np.setdiff1d(np.arange(self.nv), self.unknown.freedoms)
        self._passive, self._root = passive, np.ix_(passive, passive)
        self._held = np.ix_(self.unknown.freedoms, passive)
        self._under_feet = np.concatenate([np.arange(0), *(np.r_[foot.span] for foot in self.unknown.feet)])
        self._counter = np.ix_(self.unknown.torques, self._under_feet)
        gravity = simulator.memory.parameters[:GRAVITY]
        self._weight = simulator.tree.mass * float(np.linalg.norm(gravity))
        self.scale = max(self._weight, 1.0)

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
        response = np.linalg.solve(M, D).T
        forgotten = np.exp(-h / self.unknown.time_constant)
        noise = self._force_noise(state, M, D, h)
        F, G = (each.T for each in self.simulator.linearise(state.q, state.v, h, self._white.factor(state)))
        by_force = np.zeros((nf, 2 * nv))
        add_product(response, F[nv:], by_force)
        by_force[:, nv:] += response
        mean = self._mean(state)
        state.force = mean + forgotten * (state.force - mean)
        columns = 2 * nv if self._white.any else 0
        W = np.zeros((n + columns + nf, n))
        carry_forced(F, 0.5 * h * by_force, forgotten, np.ascontiguousarray(factor.T), W)
        W[n : n + columns, : 2 * nv] = G[:columns]
        W[n + columns :, 2 * nv :] = noise.T
        return W.T

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        factor = super().predict(state, factor, h, count)
        factor = stance.keep_still(self, state, factor, h * count)
        self.admit(state, factor)
        return factor

    def displace(self, state: State, error: np.ndarray) -> State:
        nv = self.nv
        q = self.simulator.displaced(state.q, error[:nv])
        force = state.force + error[2 * nv :]
        return State(q, state.v + error[nv : 2 * nv], state.acceleration, force, state.grounded)

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

    def _force_noise(self, state: State, M: np.ndarray, D: np.ndarray, h: float) -> np.ndarray:
        """(nf, nf) factor of the noise that a step of h seconds adds to the forces."""
        own, feet = self.unknown, self._under_feet
        deviation = own.deviation * np.sqrt(1.0 - np.exp(-2.0 * h / own.time_constant)) * self._acting(state)
        noise = np.diag(deviation)
        if len(own.torques):
            pushed = D[:, feet] * deviation[feet]
            moved = np.linalg.solve(M[self._root], pushed[self._passive])
            noise[self._counter] = M[self._held] @ moved - pushed[own.freedoms]
        return noise
