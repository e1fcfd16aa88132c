"""The three formulations in NumPy, integrated as they stand: quaternions normalised after a step, drift left to be seen.

Each is positions x and velocities u with rates xdot(x, u) and udot(x, u). They know gravity and equality rows; springs come in as
generalized forces of their ends (virtual work).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.compose import GRAVITY, pack_parameters
from physics_prior.dynamics.formulations import generalized, point_pairs
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.maximal import MaximalCoordinates
from physics_prior.dynamics.formulations.newton_euler import Bodies, Q
from physics_prior.dynamics.formulations.quaternion import QuaternionCoordinates
from physics_prior.effects.effect import PointPair
from physics_prior.effects.spring import Spring
from physics_prior.errors import SimulationError
from physics_prior.model import JointKind, Tree
from physics_prior.studies.accuracy.trajectory import Setting, Trajectory, run_timed
from physics_prior.studies.problems.mechanism import Benchmark

LOST = 1e6  # of any number of the state, beyond which the motion is lost

Force = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Generalized forces (nv,) at q (nq,) and v (nv,) of the tree, beside gravity."""


class Formulation(Protocol):
    """Positions x and velocities u of a formulation."""

    def start(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """X and u at q (nq,) and v (nv,) of the tree."""
        ...

    def rates(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Xdot and udot."""
        ...

    def normalise(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same with quaternions of unit length."""
        ...

    def state(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q and v of the tree."""
        ...

    def residual(self, x: np.ndarray, u: np.ndarray) -> float:
        """How far its own constraints are off at most, m."""
        ...


class Generalized:
    """Only the joints' freedoms (equations 6 and 7)."""

    def __init__(self, tree: Tree, gravity: np.ndarray, pairs: Sequence[PointPair], force: Force) -> None:
        self._tree, self._gravity, self._pairs, self._force = tree, gravity, pairs, force

    def start(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        return q.copy(), v.copy()

    def rates(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``; quaternions by equation 2."""
        xdot, (x, u) = np.zeros(len(x)), self.normalise(x, u)
        for link in self._tree.links:
            own, spin = x[link.q], u[link.v]
            if link.joint.kind in (JointKind.FREE, JointKind.SPHERICAL):
                xdot[link.q] = np.concatenate([spin[:-3], rotations.derivative(own[-4:], spin[-3:])])
            else:
                xdot[link.q] = spin
        tau = self._force(x, u)
        motion = generalized.mixed_accelerations(self._tree, x, u, tau, self._gravity, self._pairs)
        return xdot, motion.acceleration

    def normalise(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        out = x.copy()
        for link in self._tree.links:
            if link.joint.kind in (JointKind.FREE, JointKind.SPHERICAL):
                last = link.q.stop
                out[last - 4 : last] = rotations.normalize(out[last - 4 : last])
        return out, u

    def state(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        return x, u

    def residual(self, x: np.ndarray, u: np.ndarray) -> float:
        """As ``Formulation``: of loops and attachments."""
        bodies = Bodies.of(self._tree)
        closed = point_pairs.body_pairs(bodies, self._pairs)
        return _largest(point_pairs.residual(closed, bodies.state(kinematics(self._tree, x, u))))


class Maximal:
    """Every link a free body (equations 3 and 4), turned by its angular velocity."""

    def __init__(self, tree: Tree, gravity: np.ndarray, pairs: Sequence[PointPair], force: Force) -> None:
        self._system, self._force = MaximalCoordinates(tree, gravity, pairs), force

    def start(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        state = self._system.state(q, v)
        return state[:, : Q.stop], state[:, Q.stop :]

    def rates(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        state = np.hstack(self.normalise(x, u))
        out = self._system.derivative(state, self._force(*self._system.generalized(state)))
        return out[:, : Q.stop], out[:, Q.stop :]

    def normalise(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        return np.hstack([x[:, : Q.start], rotations.normalize(x[:, Q])]), u

    def state(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        return self._system.generalized(np.hstack([x, u]))

    def residual(self, x: np.ndarray, u: np.ndarray) -> float:
        """As ``Formulation``: of joints, loops and attachments."""
        return _largest(self._system.residual(np.hstack([x, u])))


class Quaternion:
    """The same with the quaternions' rates as velocities, held on the unit sphere by a multiplier each (equation 5)."""

    def __init__(self, tree: Tree, gravity: np.ndarray, pairs: Sequence[PointPair], force: Force) -> None:
        self._system, self._force = QuaternionCoordinates(tree, gravity, pairs), force

    def start(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        state = self._system.state(q, v)
        return state[:, : Q.stop], state[:, Q.stop :]

    def rates(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        state = np.hstack([x, u])
        out = self._system.derivative(state, self._force(*self._system.generalized(state)))
        return out[:, : Q.stop], out[:, Q.stop :]

    def normalise(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``; a rate along the quaternion would change its length, and is left out."""
        q = rotations.normalize(x[:, Q])
        along = np.sum(q * u[:, Q], axis=1, keepdims=True)
        return np.hstack([x[:, : Q.start], q]), np.hstack([u[:, : Q.start], u[:, Q] - along * q])

    def state(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``Formulation``."""
        return self._system.generalized(np.hstack([x, u]))

    def residual(self, x: np.ndarray, u: np.ndarray) -> float:
        """As ``Formulation``: of joints, loops and attachments."""
        q, v = self.state(x, u)
        state = self._system.maximal.state(q, v)
        state[:, : Q.stop] = x
        return _largest(self._system.maximal.residual(state))


FORMULATIONS: dict[str, Callable[[Tree, np.ndarray, Sequence[PointPair], Force], Formulation]] = {
    "generalized": Generalized,
    "quaternion": Quaternion,
    "maximal": Maximal,
}


def rk4(formulation: Formulation, x: np.ndarray, u: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """One step of the classical Runge-Kutta method in the formulation's own coordinates."""
    x1, u1 = formulation.rates(x, u)
    x2, u2 = formulation.rates(x + 0.5 * h * x1, u + 0.5 * h * u1)
    x3, u3 = formulation.rates(x + 0.5 * h * x2, u + 0.5 * h * u2)
    x4, u4 = formulation.rates(x + h * x3, u + h * u3)
    return x + h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4), u + h / 6.0 * (u1 + 2.0 * u2 + 2.0 * u3 + u4)


def semi_implicit_euler(
    formulation: Formulation, x: np.ndarray, u: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """One step: the velocity by the acceleration at its start, then the position by the new velocity."""
    _, udot = formulation.rates(x, u)
    u = u + h * udot
    xdot, _ = formulation.rates(x, u)
    return x + h * xdot, u


STEPS = {"rk4": rk4, "semi_implicit_euler": semi_implicit_euler}


@dataclass
class Textbook:
    """A formulation with one of the steps above."""

    formulation: str
    step: str
    settings: Sequence[Setting]
    engine: str = "textbook"

    @property
    def name(self) -> str:
        """As ``Scheme`` says."""
        return f"{self.formulation}, {self.step}"

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """As ``Scheme`` says."""
        tree, effects = benchmark.tree, benchmark.effects
        gravity = pack_parameters(tree, effects)[:GRAVITY]
        pairs = [pair for effect in effects for pair in effect.point_pairs(tree)]
        formulation = FORMULATIONS[self.formulation](tree, gravity, pairs, forces_of(benchmark))
        step, turns = STEPS[self.step], _Turns(tree, benchmark.q)
        x, u = formulation.start(benchmark.q, benchmark.v)
        worst = 0.0

        def advance(h: float, count: int) -> None:
            nonlocal x, u, worst
            for _ in range(count):
                x, u = formulation.normalise(*step(formulation, x, u, h))
                if not max(np.max(np.abs(x)), np.max(np.abs(u))) < LOST:
                    raise SimulationError(f"{self.name} lost the motion at steps of {h:g} s")
                turns.follow(formulation.state(x, u)[0])
            worst = max(worst, formulation.residual(x, u))

        found = run_timed(benchmark, setting, advance, lambda: (turns.q, formulation.state(x, u)[1]))
        return Trajectory(found.seconds, found.q, found.v, worst)


class _Turns:
    """Whole turns of hinges, which maximal coordinates do not know: the angle nearest to that of the step before."""

    def __init__(self, tree: Tree, q: np.ndarray) -> None:
        hinges = [link.q.start for link in tree.links if link.joint.kind is JointKind.REVOLUTE]
        self._hinges = np.array(hinges, dtype=int)
        self.q = q.copy()

    def follow(self, q: np.ndarray) -> None:
        """Take q (nq,) for the new configuration."""
        turns = np.round((self.q[self._hinges] - q[self._hinges]) / (2.0 * np.pi))
        self.q = q.copy()
        self.q[self._hinges] += 2.0 * np.pi * turns


def forces_of(benchmark: Benchmark) -> Force:
    """The benchmark's constant forces, and those of its springs: J_a^T f - J_b^T f of the pull f on a."""
    tree = benchmark.tree
    constant = np.zeros(tree.nv) if benchmark.tau is None else benchmark.tau
    springs = [effect.parameters(tree) for effect in benchmark.effects if isinstance(effect, Spring)]

    def force(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if not springs:
            return constant
        tau, k = constant.copy(), kinematics(tree, q, v)
        for own in springs:
            jacobians, points = [], []
            for link, point in ((int(own[0]), own[1:4]), (int(own[4]), own[5:8])):
                lever = rotations.rotate(k.orientation[link], point)
                points.append(k.position[link] + lever)
                jacobians.append(k.linear_jacobian[link] - rotations.skew(lever) @ k.angular_jacobian[link])
            gap, apart = points[1] - points[0], jacobians[1] - jacobians[0]
            length = np.linalg.norm(gap)
            pull = own[8] * (length - own[9]) + own[10] * (gap @ apart @ v) / length
            tau -= apart.T @ (gap / length) * pull
        return tau

    return force


def _largest(residual: np.ndarray) -> float:
    return float(np.max(np.abs(residual), initial=0.0))
