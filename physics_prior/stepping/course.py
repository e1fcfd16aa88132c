"""The motion that steps are tried on: from a start, from time to time, what is seen there and what it took."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from time import thread_time

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import Effect
from physics_prior.errors import SimulationError
from physics_prior.estimation.process import steps
from physics_prior.inertia import MassProperties
from physics_prior.model import Tree
from physics_prior.scene import Scene, Step

NANOSECONDS = 1e9
MOST_SECONDS, MOST_LOOKS = 10.0, 20_000  # of a scene's duration: s, and measurements
LONGEST_RUN = 20.0  # s of processor time, beyond which a run is given up
BRIEF = 1e-6  # s

Observe = Callable[[Simulator, np.ndarray, np.ndarray], np.ndarray]
Distance = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True, eq=False)
class Course:
    """What is followed, and how far two ways are apart.

    Attributes:
        tree, effects: as ``Simulator`` takes them.
        q, v, tau: (nq,) and (nv,), where it starts; (nv,) constant generalized forces, N and N m, None for none.
        times: (k,) s, multiples of the first, at which it is looked at; steps end there.
        parts: of the time from look to look: as many steps as the longest that are tried make of it.
        observe: what is seen of a state, (n,); distance: of two such sights.
    """

    tree: Tree
    effects: tuple[Effect, ...]
    q: np.ndarray
    v: np.ndarray
    times: np.ndarray
    parts: int
    observe: Observe
    distance: Distance
    tau: np.ndarray | None = None

    @property
    def interval(self) -> float:
        """The time from look to look, s."""
        return float(self.times[0])

    @property
    def longest(self) -> float:
        """The longest step that is tried, s."""
        return self.interval / self.parts


def course_of(scene: Scene) -> Course:
    """The scene's own motion from its initial state without noise, for 10 s at most, seen at its rate of measurements."""
    simulation, tree = scene.simulation, scene.tree
    count = min(MOST_LOOKS, max(1, int(min(simulation.duration, MOST_SECONDS) * simulation.rate + 1e-9)))
    interval = 1.0 / simulation.rate
    marks = [_marks(part.mass_properties) for part in tree.parts]
    names = [part.name for part in tree.parts]

    def observe(simulator: Simulator, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        simulator.move(q, v)
        poses = [simulator.pose(name) for name in names]
        return np.concatenate([x + own @ R.T for (x, R), own in zip(poses, marks, strict=True)])

    times = interval * np.arange(1, count + 1)
    return Course(tree, scene.effects, scene.initial.q, scene.initial.v, times, 1, observe, furthest)


def furthest(a: np.ndarray, b: np.ndarray) -> float:
    """The largest distance of points (n, 3) in a from those in b, m."""
    return float(np.sqrt(np.max(np.sum((a - b) ** 2, axis=1))))


def _marks(body: MassProperties) -> np.ndarray:
    """(4, 3) points of a part in its frame, m, that show both how far it is off and how far it has turned."""
    radius = float(np.sqrt(np.trace(body.inertia) / (2.0 * body.mass))) if body.mass > 0.0 else 0.0
    return np.asarray(body.center_of_mass + radius * np.vstack([np.zeros(3), np.eye(3)]))


class Follower:
    """A simulator of a course, stepped as a ``Step`` says.

    Attributes:
        taken: processor time of the last run's steps, s; made: how many there were, whole ones or of an adaptive
            integrator's what it was given.
    """

    def __init__(self, course: Course, step: Step) -> None:
        self._course, self._size = course, step.size
        self._simulator = Simulator(course.tree, course.effects, step.integrator, step.tolerance, step.size)
        self.taken, self.made = 0.0, 0
        with suppress(SimulationError):  # loads or compiles what is timed below
            q, v = course.q.copy(), course.v.copy()
            self._simulator.begin(q, v)
            self._simulator.advance(q, v, min(step.size, BRIEF))

    def sights(self) -> list[np.ndarray]:
        """Run; return what is seen at the start and at the times. SimulationError where the motion is lost."""
        seen: list[np.ndarray] = []
        self._run(self._course.times, lambda q, v: seen.append(self._course.observe(self._simulator, q, v).copy()))
        return seen

    def seconds(self) -> float:
        """Run without a look; return the processor time that the steps took, s. SimulationError where the motion is lost."""
        self._run(self._course.times[-1:], lambda q, v: None)
        return self.taken

    def _run(self, times: np.ndarray, look: Callable[[np.ndarray, np.ndarray], None]) -> None:
        course, simulator = self._course, self._simulator
        q, v, now = course.q.copy(), course.v.copy(), 0
        self.taken, self.made = 0.0, 0
        simulator.begin(q, v)
        look(q, v)
        for time in times:
            following = round(time * NANOSECONDS)
            for stretch in simulator.switches.stretches(now, following):
                count, h = steps((stretch.end - stretch.begin) / NANOSECONDS, self._size)
                begin = thread_time()
                try:
                    simulator.advance(q, v, h, count, course.tau)
                finally:
                    self.taken += thread_time() - begin
                    self.made += count
                if self.taken > LONGEST_RUN:
                    raise SimulationError(f"{time:g} s of motion take more than {LONGEST_RUN:g} s of processor time")
                simulator.time = stretch.end / NANOSECONDS
                simulator.switches.follow(stretch.events, q, v)
            now = following
            look(q, v)
