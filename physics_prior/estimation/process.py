"""Process models: how the state goes on between measurements, and how surely.

``PhysicsProcess`` is the scene's own step, its noise an unknown force; ``FrozenProcess`` differentiates it less often.
``KinematicProcess`` knows no physics but that acceleration changes slowly (constant acceleration, white jerk: Bar-Shalom 2001,
ch. 6.2.3); it is what physics is measured against.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from physics_prior.dynamics.covariance import carry, carry_step
from physics_prior.dynamics.force_noise import PointForces
from physics_prior.dynamics.manifold import difference
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.estimation import events
from physics_prior.estimation.square_root import lower_factor
from physics_prior.scene import Scene


@dataclass(eq=False)
class State:
    """A state on the manifold: q (nq,), v (nv,) and, for the kinematic process, the acceleration (nv,), else empty."""

    q: np.ndarray
    v: np.ndarray
    acceleration: np.ndarray

    def copy(self) -> "State":
        return State(self.q.copy(), self.v.copy(), self.acceleration.copy())


class Process(Protocol):
    """A process model: n errors (tangent of q, v, what else it keeps)."""

    n: int

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        """A state from configuration and velocity."""

    def start_factor(self) -> np.ndarray:
        """(n - 2 nv,) standard deviations of what else it keeps, before the first measurement."""

    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Move the state in place by h seconds; return its derivative F (n, n) and a noise factor G (n, g)."""

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        """Move the state in place by h seconds; return (n, n + g): a factor (n, n) of its errors carried, and one of noise."""

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        """Move the state in place by count steps of h seconds; return the lower factor (n, n) of its errors' covariance.

        Raises:
            SimulationError: the state or the factor is not finite, or the step was not possible.
        """

    def displace(self, state: State, error: np.ndarray) -> State:
        """The state moved by an error (n,)."""

    def difference(self, start: State, end: State) -> np.ndarray:
        """The error (n,) that leads from one state to another."""


def steps(seconds: float, size: float) -> tuple[int, float]:
    """How many equal steps of at most ``size`` fill a time, and how long each is."""
    count = max(1, math.ceil(seconds / size - 1e-9))
    return count, seconds / count


class _OnManifold(ABC):
    def __init__(self, scene: Scene, simulator: Simulator, n: int) -> None:
        self.scene, self.simulator, self.n = scene, simulator, n

    @abstractmethod
    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """As ``Process.advance``."""

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        F, G = self.advance(state, h)
        return np.hstack([F @ factor, G])

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        for _ in range(count):
            factor = lower_factor(self.carry(state, factor, h))
        if not all(np.isfinite(array).all() for array in (state.q, state.v, state.acceleration, factor)):
            raise SimulationError(f"the prediction is not finite after steps of {h:g} s: a smaller step size may do")
        return factor

    def displace(self, state: State, error: np.ndarray) -> State:
        nv = self.simulator.nv
        q = self.simulator.displaced(state.q, error[:nv])
        return State(q, state.v + error[nv : 2 * nv], state.acceleration + error[2 * nv :])

    def difference(self, start: State, end: State) -> np.ndarray:
        turn = np.empty(self.simulator.nv)
        difference(self.simulator.memory.links, start.q, end.q, turn)
        return np.concatenate([turn, end.v - start.v, end.acceleration - start.acceleration])


class PhysicsProcess(_OnManifold):
    """The scene's own step, with its analytic derivatives; noise is an unknown generalized force."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 2 * simulator.nv)
        self._own_noise = np.diag(scene.noise.force)
        self._effects_noise = PointForces(simulator)

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        return State(q, v, np.zeros(0))

    def start_factor(self) -> np.ndarray:
        return np.zeros(0)

    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        return self.simulator.linearise(state.q, state.v, h, self._noise(state))

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        if len(self.simulator.candidates):
            return events.carry(self.simulator, state.q, state.v, factor, self._columns(state), h)
        return carry_step(self.simulator, state.q, state.v, h, factor, self._noise(state))

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        if len(self.simulator.candidates):
            return super().predict(state, factor, h, count)
        once = self._effects_noise.count > 0  # their directions turn with the state
        for _ in range(count if once else 1):
            factor = carry(self.simulator, state.q, state.v, h, 1 if once else count, factor, self._noise(state))
        return factor

    def _noise(self, state: State) -> np.ndarray:
        """(nv, nv): a factor of the density of the white generalized forces."""
        return lower_factor(self._columns(state)) if self._effects_noise.count else self._own_noise

    def _columns(self, state: State) -> np.ndarray:
        """(nv, g): what generalized forces the independent white ones make, the scene's own first."""
        return np.hstack([self._own_noise, self._effects_noise.columns(state.q, state.v)])


class FrozenProcess(PhysicsProcess):
    """The same steps, but derivatives only once from measurement to measurement: those of one step over all of it."""

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        if count == 1 or len(self.simulator.candidates):
            return super().predict(state, factor, h, count)
        ahead, begin = state.copy(), self.simulator.time
        factor = carry(self.simulator, ahead.q, ahead.v, count * h, 1, factor, self._noise(state))
        self.simulator.time = begin
        self.simulator.advance(state.q, state.v, h, count)
        return factor


class KinematicProcess(_OnManifold):
    """Constant acceleration of every degree of freedom, driven by white jerk; knows neither mass nor constraint."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 3 * simulator.nv)

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        return State(q, v, np.zeros(len(v)))

    def start_factor(self) -> np.ndarray:
        return 10.0 * self.scene.noise.velocity

    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        nv = self.simulator.nv
        state.q[:] = self.simulator.displaced(state.q, h * state.v + 0.5 * h * h * state.acceleration)
        state.v += h * state.acceleration
        F = np.eye(3 * nv)
        index = np.arange(nv)
        F[index, nv + index] = F[nv + index, 2 * nv + index] = h
        F[index, 2 * nv + index] = 0.5 * h * h
        moments = np.array([[h**5 / 20, h**4 / 8, h**3 / 6], [h**4 / 8, h**3 / 3, h**2 / 2], [h**3 / 6, h**2 / 2, h]])
        return F, np.kron(np.linalg.cholesky(moments), np.diag(self.scene.noise.jerk))


PROCESSES: dict[str, Callable[[Scene, Simulator], Process]] = {
    "physics": PhysicsProcess,
    "frozen": FrozenProcess,
    "kinematic": KinematicProcess,
}
"""The process models, by the name that ``--process`` knows them by."""
