"""White forces that effects put on points, as generalized forces."""

import numpy as np

from physics_prior.dynamics.simulator import Simulator


class PointForces:
    """The noise of a simulator's effects: ``count`` independent white forces, one an axis that has any."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        noises = [effect.noise(simulator.tree) for effect in simulator.effects]
        self._noises = [noise for own in noises for noise in own]
        self._owners = [index for index, own in enumerate(noises) for _ in own]
        self.count = sum(int(np.count_nonzero(noise.density)) for noise in self._noises)

    def columns(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(nv, count) generalized forces, N sqrt(s) or N m sqrt(s), that each makes at q: J^T along an axis by its density."""
        if not self.count:
            return np.zeros((self._simulator.nv, 0))
        self._simulator.move(q, v)
        acting_now = self._simulator.switches.acting
        rows = [
            acting_now[owner] * noise.density[:, None] * self._simulator.jacobian(noise.at.part, noise.at.point)[3:]
            for owner, noise in zip(self._owners, self._noises, strict=True)
        ]
        acting = np.concatenate([noise.density for noise in self._noises]) != 0.0
        return np.ascontiguousarray(np.vstack(rows)[acting].T)
