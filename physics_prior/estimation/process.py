"""Process models: how the state goes on between measurements, and how surely.

``PhysicsProcess`` is the scene's own step, its noise an unknown force; ``FrozenProcess`` differentiates it less often.
``KinematicProcess`` knows no physics but that acceleration changes slowly (constant acceleration, white jerk: Bar-Shalom 2001,
ch. 6.2.3); it is what physics is measured against.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from physics_prior.dynamics.covariance import carry, carry_step
from physics_prior.dynamics.force_noise import PointForces
from physics_prior.dynamics.manifold import difference
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.estimation import events
from physics_prior.estimation.square_root import lower_factor, reduced
from physics_prior.scene import Scene


@dataclass(eq=False, slots=True)
class State:
    """A state on the manifold.

    Attributes:
        q, v: (nq,) and (nv,).
        acceleration: (nv,) of the kinematic process, else empty.
        force: (nf,) unknown forces of the process with such (forced_process.py), else empty.
        grounded: (feet,) bool, which of its feet stand.
    """

    q: np.ndarray
    v: np.ndarray
    acceleration: np.ndarray
    force: np.ndarray = field(default_factory=lambda: np.zeros(0))
    grounded: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def copy(self) -> "State":
        return State(self.q.copy(), self.v.copy(), self.acceleration.copy(), self.force.copy(), self.grounded.copy())


class Process(Protocol):
    """A process model: n errors (tangent of q, v, what else it keeps)."""

    n: int

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        """A state from configuration and velocity."""

    def start_factor(self, state: State) -> np.ndarray:
        """(n - 2 nv,) standard deviations of what else it keeps, before the first measurement."""

    def enter(self, state: State) -> None:
        """Have the simulator know what of a state is neither configuration nor velocity."""

    def settle(self, state: State, factor: np.ndarray) -> tuple[State, np.ndarray]:
        """State and factor after a measurement, when it is decided anew what stands on the ground."""

    def admit(self, state: State, factor: np.ndarray) -> bool:
        """Move a state in place, as its factor lets it, to where forces are possible; return whether it had to be."""

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

    def tangent(self, start: State, end: State) -> np.ndarray:
        """The error (nv,) of the configuration that leads from one state to another."""

    def difference(self, start: State, end: State) -> np.ndarray:
        """The error (n,) that does."""


def steps(seconds: float, size: float) -> tuple[int, float]:
    """How many equal steps of at most ``size`` fill a time, and how long each is."""
    count = max(1, math.ceil(seconds / size - 1e-9))
    return count, seconds / count


class OnManifold(ABC):
    """What process models share: errors are displacements on the manifold."""

    def __init__(self, scene: Scene, simulator: Simulator, n: int) -> None:
        self.scene, self.simulator, self.n = scene, simulator, n

    @abstractmethod
    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """As ``Process.advance``."""

    def enter(self, state: State) -> None:
        if len(state.force):
            self.simulator.unknown.force = state.force

    def settle(self, state: State, factor: np.ndarray) -> tuple[State, np.ndarray]:
        return state, factor

    def admit(self, state: State, factor: np.ndarray) -> bool:
        return False

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        F, G = self.advance(state, h)
        return np.hstack([F @ factor, G])

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        for _ in range(count):
            factor = reduced(np.ascontiguousarray(self.carry(state, factor, h).T))
        if not all(np.isfinite(array).all() for array in (state.q, state.v, state.acceleration, factor)):
            raise SimulationError(f"the prediction is not finite after steps of {h:g} s: a smaller step size may do")
        return factor

    def displace(self, state: State, error: np.ndarray) -> State:
        nv = self.simulator.nv
        q, v = self.simulator.displaced(state.q, error), state.v + error[nv : 2 * nv]
        return State(q, v, state.acceleration, state.force, state.grounded)

    def tangent(self, start: State, end: State) -> np.ndarray:
        out = np.empty(self.simulator.nv)
        difference(self.simulator.memory.links, start.q, end.q, out)
        return out

    def difference(self, start: State, end: State) -> np.ndarray:
        return np.concatenate([self.tangent(start, end), end.v - start.v, end.acceleration - start.acceleration])


class WhiteForces:
    """The white generalized forces of a scene: its own, and those that its effects put on points."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        self._own = np.diag(scene.noise.force)
        self._of_effects = PointForces(simulator)

    @property
    def turning(self) -> bool:
        """Whether their directions turn with the state."""
        return self._of_effects.count > 0

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self.turning or bool(self._own.any())

    def factor(self, state: State) -> np.ndarray:
        """(nv, nv): a factor of the density of the white generalized forces."""
        return lower_factor(self.columns(state)) if self.turning else self._own

    def columns(self, state: State) -> np.ndarray:
        """(nv, g): what generalized forces the independent white ones make, the scene's own first."""
        return np.hstack([self._own, self._of_effects.columns(state.q, state.v)])


class PhysicsProcess(OnManifold):
    """The scene's own step, with its analytic derivatives; noise is an unknown generalized force."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 2 * simulator.nv)
        self._white = WhiteForces(scene, simulator)

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        return State(q, v, np.zeros(0))

    def start_factor(self, state: State) -> np.ndarray:
        return np.zeros(0)

    def advance(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        return self.simulator.linearise(state.q, state.v, h, self._white.factor(state))

    def carry(self, state: State, factor: np.ndarray, h: float) -> np.ndarray:
        if len(self.simulator.candidates):
            return events.carry(self.simulator, state.q, state.v, factor, self._white.columns(state), h)
        return carry_step(self.simulator, state.q, state.v, h, factor, self._white.factor(state))

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        if len(self.simulator.candidates):
            return super().predict(state, factor, h, count)
        once = self._white.turning
        for _ in range(count if once else 1):
            factor = carry(self.simulator, state.q, state.v, h, 1 if once else count, factor, self._white.factor(state))
        return factor


class FrozenProcess(PhysicsProcess):
    """The same steps, but derivatives only once from measurement to measurement: those of one step over all of it."""

    def predict(self, state: State, factor: np.ndarray, h: float, count: int) -> np.ndarray:
        if count == 1 or len(self.simulator.candidates):
            return super().predict(state, factor, h, count)
        ahead, begin = state.copy(), self.simulator.time
        factor = carry(self.simulator, ahead.q, ahead.v, count * h, 1, factor, self._white.factor(state))
        self.simulator.time = begin
        self.simulator.advance(state.q, state.v, h, count)
        return factor


class KinematicProcess(OnManifold):
    """Constant acceleration of every degree of freedom, driven by white jerk; knows neither mass nor constraint."""

    def __init__(self, scene: Scene, simulator: Simulator) -> None:
        super().__init__(scene, simulator, 3 * simulator.nv)

    def start(self, q: np.ndarray, v: np.ndarray) -> State:
        return State(q, v, np.zeros(len(v)))

    def start_factor(self, state: State) -> np.ndarray:
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

    def displace(self, state: State, error: np.ndarray) -> State:
        out = super().displace(state, error)
        out.acceleration = state.acceleration + error[2 * self.simulator.nv :]
        return out
