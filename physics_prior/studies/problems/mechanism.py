"""A mechanism and where it starts; a benchmark is one whose motion is known from somewhere else."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.integrators import DEFAULT, IntegratorName
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import Effect
from physics_prior.model import Tree

Distance = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A tree, what acts on it, and its start.

    Attributes:
        tree, effects: as ``Simulator`` takes them.
        q, v: (nq,) and (nv,), where it starts.
        tau: (nv,) constant generalized forces, N and N m; empty for none.
    """

    tree: Tree
    effects: tuple[Effect, ...]
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray | None = None

    def run(self, integrator: IntegratorName = DEFAULT, effects: Sequence[Effect] | None = None) -> "Run":
        """A motion that begins at the start, put onto what holds; effects other than its own where given."""
        simulator = Simulator(self.tree, self.effects if effects is None else effects, integrator)
        run = Run(simulator, self.q.copy(), self.v.copy(), self.tau)
        simulator.begin(run.q, run.v)
        return run


@dataclass(eq=False)
class Run:
    """A motion under way: q (nq,) and v (nv,) at ``time`` s, and the simulator that moves them."""

    simulator: Simulator
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray | None = None
    time: float = 0.0

    def advance(self, h: float, count: int = 1) -> None:
        """Count steps of h seconds."""
        self.simulator.advance(self.q, self.v, h, count, self.tau)
        self.time += count * h

    def to(self, time: float, h: float) -> None:
        """On to a time, s, by equal steps as near to h as divide the way; the time is then exactly that."""
        count = max(1, round((time - self.time) / h))
        self.advance((time - self.time) / count, count)
        self.time = time

    def energy(self) -> float:
        """Kinetic energy and potential energy of gravity, J."""
        self.simulator.move(self.q, self.v)
        return self.simulator.energy()

    def kinetic_energy(self) -> float:
        """Kinetic energy, J."""
        return 0.5 * float(self.v @ self.simulator.mass_matrix(self.q) @ self.v)

    def residual(self) -> float:
        """How far the constraints are off, m; 0 without any."""
        return float(np.max(np.abs(self.simulator.constraint_error(self.q, self.v)), initial=0.0))

    def point(self, part: str, point: Sequence[float]) -> np.ndarray:
        """A point (3,) of a part in the world, m."""
        self.simulator.move(self.q, self.v)
        position, R = self.simulator.pose(part)
        return np.asarray(position + R @ np.asarray(point, dtype=float))


def euclidean(a: np.ndarray, b: np.ndarray) -> float:
    """Distance of two points."""
    return float(np.linalg.norm(a - b))


def largest(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of two vectors' entries."""
    return float(np.max(np.abs(a - b)))


def turn(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two orientations (4,), rad; reference quaternions are rounded, so they are normalised."""
    return float(np.linalg.norm(rotations.log(rotations.multiply(rotations.conjugate(a), b))))


@dataclass(frozen=True, eq=False, kw_only=True)
class Benchmark(Mechanism):
    """A mechanism whose motion is known.

    Attributes:
        observe: what of a run is compared, (n,).
        times, values: (k,) s and (k, n), what ``observe`` gives there, from a closed solution or computed elsewhere.
        distance: of what was observed from what is known.
    """

    observe: Callable[[Run], np.ndarray]
    times: np.ndarray
    values: np.ndarray
    distance: Distance = euclidean

    def errors(self, run: Run, h: float, until: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Run at steps of h s; times (k,) and the distances there from what is known (k,)."""
        times = self.times[self.times <= until]
        out = np.empty(len(times))
        for i, (time, value) in enumerate(zip(times, self.values, strict=False)):
            run.to(float(time), h)
            out[i] = self.distance(self.observe(run), value)
        return times, out
