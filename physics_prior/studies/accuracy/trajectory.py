"""What any contestant does: run a benchmark at a step size and hand back its states and the processor time that took."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Protocol

import numpy as np

from physics_prior.studies.problems.mechanism import Benchmark

LONGEST = 4.0  # s of processor time, beyond which a run is given up
WATCHED = 0.02  # s of processor time, about which a run goes on unwatched
TOLD = 0.05  # of that longest time, from which on a run's pace counts: first calls are slow


@dataclass(frozen=True)
class Setting:
    """Step size h, s, and, for integrators that choose their own steps within it, the error allowed each."""

    h: float
    tolerance: float | None = None


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States at the benchmark's times.

    Attributes:
        seconds: processor time over all of the benchmark's, s.
        q: (k, nq) in the benchmark's tree; None where the run was given up as too slow.
        v: (k, nv); None where the contestant does not tell.
        residual: how far what holds was off at most, m, in the contestant's own coordinates; None: judge by q.
    """

    seconds: float
    q: np.ndarray | None
    v: np.ndarray | None
    residual: float | None = None


class Scheme(Protocol):
    """A formulation with an integrator, or another engine with one.

    Attributes:
        engine: "compiled", "textbook", or the peer's name.
        name: formulation or engine, and integrator.
        settings: at which to run it.
    """

    @property
    def engine(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def settings(self) -> Sequence[Setting]: ...

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """Run from the benchmark's start; raises SimulationError where the motion is lost."""
        ...


Advance = Callable[[float, int], None]
"""Move on by count steps of h, s."""


def run_timed(
    benchmark: Benchmark, setting: Setting, advance: Advance, state: Callable[[], tuple[np.ndarray, np.ndarray]]
) -> Trajectory:
    """Advance from time to time of the benchmark, by equal steps as near to h as divide the way; only that is timed.

    The steps are asked for in parts, doubled while they are brief, so that a run that is too slow ends between its steps.
    """
    seconds, now, end, part = 0.0, 0.0, float(benchmark.times[-1]), 1
    q, v = [], []
    for time in benchmark.times:
        count = left = max(1, round((time - now) / setting.h))
        while left > 0:
            asked = min(part, left)
            begin = process_time()
            advance((time - now) / count, asked)
            taken = process_time() - begin
            seconds, left = seconds + taken, left - asked
            if seconds > LONGEST:
                return Trajectory(seconds, None, None)
            part = 2 * part if taken < WATCHED else max(1, part // 2)
        now = float(time)
        own_q, own_v = state()
        q.append(own_q.copy())
        v.append(own_v.copy())
        if seconds > TOLD * LONGEST and seconds / now * end > LONGEST:
            return Trajectory(seconds / now * end, None, None)
    return Trajectory(seconds, np.array(q), np.array(v))
