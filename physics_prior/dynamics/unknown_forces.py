"""Unknown forces of effects (effects/unknown_force.py): their numbers in a step's parameters, and what they do to joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.algebra import get3, put3
from physics_prior.dynamics.compose import GRAVITY
from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.kinematics import point_jacobian
from physics_prior.dynamics.sole import SOLE, sole_record
from physics_prior.dynamics.types import Array, Records
from physics_prior.effects.effect import Effect
from physics_prior.effects.unknown_force import Sole, check_together
from physics_prior.model import Tree

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Foot:
    """A sole, the name of its wrench, and which of the unknown forces that is."""

    name: str
    sole: Sole
    span: slice


class UnknownForces:
    """The unknown forces f (count,) of a simulator, effect by effect; ``parameters`` are the numbers of its step.

    Attributes:
        deviation, time_constant: (count,) of each; places: (count,) where in the parameters it is.
        feet: the soles, whose six forces each are a wrench, force first, world axes; soles (feet,) SOLE: what kernels read.
        torques, freedoms: which forces act in joints, and on which degrees of freedom.

    Raises:
        ModelError: an effect that shares the load with them.
    """

    def __init__(self, tree: Tree, effects: Sequence[Effect], parameters: np.ndarray) -> None:
        check_together(tree, effects)
        self._parameters = parameters
        places, deviation, constants, freedoms = [np.zeros(0, dtype=int)], [np.zeros(0)], [np.zeros(0)], []
        self.feet: list[Foot] = []
        self.count = 0
        for index, effect in enumerate(each for each in effects if each.compiled is not None):
            force = effect.unknown_force(tree)
            if force is None:
                continue
            size = len(force.places)
            places.append(int(parameters[GRAVITY + index]) + force.places)
            deviation.append(force.deviation)
            constants.append(np.full(size, force.time_constant))
            freedoms.append(force.freedoms if force.sole is None else np.full(size, -1))
            if force.sole is not None:
                self.feet.append(Foot(effect.label, force.sole, slice(self.count, self.count + size)))
            self.count += size
        self.places = np.concatenate(places)
        records = [sole_record(tree, foot.sole, foot.span.start) for foot in self.feet]
        self.soles = np.concatenate([np.zeros(0, SOLE), *records])
        self.deviation, self.time_constant = np.concatenate(deviation), np.concatenate(constants)
        of_all = np.concatenate([np.zeros(0, dtype=int), *freedoms])
        self.torques = np.flatnonzero(of_all >= 0)
        self.freedoms = of_all[self.torques]

    @property
    def force(self) -> np.ndarray:
        """(count,) the forces that act now, N or N m; settable."""
        return np.take(self._parameters, self.places)

    @force.setter
    def force(self, value: np.ndarray) -> None:
        self._parameters[self.places] = value

    def columns(self, simulator: "Simulator") -> np.ndarray:
        """D (nv, count): generalized forces by f; needs ``simulator.move``."""
        D, memory = np.zeros((simulator.nv, self.count)), simulator.memory
        D[self.freedoms, self.torques] = 1.0
        if self.feet:
            fill_wrench_columns(memory.links, memory.work, self.soles, D, np.empty((6, simulator.nv)), np.empty(3))
        return D

    def wrench_rows(self) -> np.ndarray:
        """(feet, 6) the wrenches that act now."""
        force = self.force
        return np.array([force[foot.span] for foot in self.feet]).reshape(-1, 6)

    def points(self, simulator: "Simulator") -> list[np.ndarray]:
        """Where these act, (3,) m in the world; needs the poses."""
        out = []
        for foot in self.feet:
            position, R = simulator.pose(foot.sole.part)
            out.append(position + R @ foot.sole.center)
        return out


@kernel
def fill_wrench_columns(links: Records, work: Records, soles: Records, D: Array, J: Array, place: Array) -> None:
    """Fill the columns of D (nv, nf) that are of feet: generalized forces by their wrenches. J (6, nv), place (3,)."""
    for index in range(soles.shape[0]):
        sole = soles[index]
        put3(place, get3(sole.center))
        point_jacobian(links, work, sole.link, place, J)
        for k in range(D.shape[0]):
            for c in range(3):
                D[k, sole.force + c], D[k, sole.force + 3 + c] = J[3 + c, k], J[c, k]
