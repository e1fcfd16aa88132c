"""Scoring an estimate against a reference: errors of readouts, of their rates, and of the forces that go with them.

A force is compared with the model's at the reference state: the configuration and velocity that give the reference's
readouts, found by Newton's method.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import RecordingError
from physics_prior.estimation.readout import COORDINATES, Values, difference, evaluate, jacobian, rates, unit
from physics_prior.scene import ForceReadout, JointReadout, Readout, Scene

FROM_SECONDS = 0.2  # after the first measurement: the start's own error is not the filter's
NEWTON_ITERATIONS = 20
CONVERGED = 1e-12


@dataclass(frozen=True, eq=False)
class Reference:
    """A recorded truth: stamps (k,) ns, names, positions (k, names) and velocities (k, names) [NaN where unknown]."""

    stamps: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    velocities: np.ndarray

    def at(self, stamp: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Positions and velocities at a stamp, interpolated; None outside the reference."""
        index = int(np.searchsorted(self.stamps, stamp))
        if index < len(self.stamps) and self.stamps[index] == stamp:
            return self.positions[index], self.velocities[index]
        if index == 0 or index == len(self.stamps):
            return None
        share = (stamp - self.stamps[index - 1]) / (self.stamps[index] - self.stamps[index - 1])
        return (
            (1.0 - share) * self.positions[index - 1] + share * self.positions[index],
            (1.0 - share) * self.velocities[index - 1] + share * self.velocities[index],
        )


class Score:
    """Collects errors stamp by stamp.

    Raises:
        RecordingError: the reference names neither readouts nor joints of the scene.
    """

    def __init__(self, scene: Scene, simulator: Simulator, names: Sequence[str]) -> None:
        self.scene, self.simulator = scene, simulator
        self.compared = _compared(scene, names)
        self.forces = [readout for readout in scene.readouts if isinstance(readout, ForceReadout)]
        self.angular = np.array([unit(readout, simulator) == "rad" for readout in self.compared])
        self._position: list[np.ndarray] = []
        self._velocity: list[np.ndarray] = []
        self._force: list[np.ndarray] = []

    def add(
        self,
        q: np.ndarray,
        v: np.ndarray,
        acceleration: np.ndarray | None,
        positions: dict[str, float],
        velocities: dict[str, float],
    ) -> Values | None:
        """Compare a state with the reference's positions and velocities by name.

        Returns the scene's readouts at the reference state; None where the reference does not fix it.
        """
        names = [readout.name for readout in self.compared]
        target = np.array([positions[name] for name in names])
        target_rates = np.array([velocities[name] for name in names])
        own, own_rates = self._coordinates(q, v), rates(self.compared, self.simulator, q, v)
        self._position.append(self._difference(own, target))
        self._velocity.append(np.array([own_rates[name] for name in names]) - target_rates)
        true = self._state(q, target, target_rates)
        if true is None:
            return None
        theirs = evaluate(self.scene.readouts, self.simulator, *true)
        if self.forces:
            ours = evaluate(self.forces, self.simulator, q, v, acceleration)
            self._force.append(np.concatenate([np.atleast_1d(ours[name] - theirs[name]) for name in ours]))
        return theirs

    def summary(self) -> dict[str, float | None]:
        """Root mean square errors: of angles [deg], lengths [m], rates and forces [% of the model's weight].

        Rates and forces are pooled over their components; a component of a force that the scene never loads (that across
        a planar mechanism) is left out. ``force_vector`` is the length of the error instead.
        """
        position, velocity, force = (
            np.array(rows) if rows else np.zeros((0, 0)) for rows in (self._position, self._velocity, self._force)
        )
        gravity = np.linalg.norm(np.sum([np.zeros(3), *(effect.field() for effect in self.scene.effects)], axis=0))
        weight = float(self.scene.tree.mass * gravity)
        loaded = np.max(np.abs(force), axis=0, initial=0.0) > 1e-6 * weight if force.size else np.zeros(0, dtype=bool)
        percent = 100.0 / weight if weight > 0.0 else None
        vectors = force.reshape(len(force), -1, 3) if force.size and force.shape[1] % 3 == 0 else None
        return {
            "from_s": FROM_SECONDS,
            "position_rmse_deg": _rms(np.degrees(position[:, self.angular])) if position.size else None,
            "position_rmse_m": _rms(position[:, ~self.angular]) if position.size else None,
            "velocity_rmse": _rms(velocity),
            "force_rmse_percent_weight": _scaled(_rms(force[:, loaded]) if force.size else None, percent),
            "force_vector_rmse_percent_weight": _scaled(
                None if vectors is None else _rms(np.linalg.norm(vectors, axis=2)), percent
            ),
        }

    def _coordinates(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        values = evaluate(self.compared, self.simulator, q, v)
        return np.array([values[readout.name] for readout in self.compared], dtype=float)

    def _difference(self, end: np.ndarray, start: np.ndarray) -> np.ndarray:
        return np.where(self.angular, difference(end, start, True), end - start)

    def _state(
        self, q: np.ndarray, target: np.ndarray, target_rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """The configuration next to q, and the velocity, that give the reference; None where it does not fix them."""
        nv = self.simulator.nv
        still = np.zeros(nv)
        if not np.isfinite(target_rates).all():
            return None
        q = q.copy()
        for _ in range(NEWTON_ITERATIONS):
            J = jacobian(self.compared, self.simulator, q, still)
            A, _ = self.simulator.tangent_rows(q, still)
            if np.linalg.matrix_rank(np.concatenate([J, A]), tol=1e-9) < nv:
                return None
            error = np.concatenate([self._difference(target, self._coordinates(q, still)), np.zeros(len(A))])
            step = np.linalg.lstsq(np.concatenate([J, A]), error, rcond=1e-10)[0]
            q = self.simulator.displaced(q, step)
            self.simulator.project(q, still)
            if np.max(np.abs(step)) < CONVERGED:
                break
        rows = np.concatenate([target_rates, np.zeros(len(A))])
        return q, np.linalg.lstsq(np.concatenate([J, A]), rows, rcond=1e-10)[0]


def _compared(scene: Scene, names: Sequence[str]) -> list[Readout]:
    """The readouts, or else the joints, that a reference's names mean."""
    readouts: list[Readout] = [
        readout for readout in scene.readouts if isinstance(readout, COORDINATES) and readout.name in names
    ]
    known = {readout.name for readout in readouts}
    readouts += [
        JointReadout(name=joint.name, joint=joint.name)
        for joint in scene.tree.joints
        if joint.name in names and joint.name not in known and joint.nv == 1
    ]
    if not readouts:
        valid = [readout.name for readout in scene.readouts] + [joint.name for joint in scene.tree.joints]
        raise RecordingError(f"the reference names {list(names)}: none is a readout or joint of the scene, {valid}")
    return readouts


def _rms(values: np.ndarray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _scaled(value: float | None, factor: float | None) -> float | None:
    return None if value is None or factor is None else value * factor
