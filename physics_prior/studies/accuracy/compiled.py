"""Our kernels: the recursions of joint coordinates, composed for the mechanism's effects, with each integrator."""

from collections.abc import Sequence
from dataclasses import dataclass

from physics_prior.dynamics.integrators import TOLERATED, IntegratorName
from physics_prior.dynamics.simulator import Simulator
from physics_prior.studies.accuracy.trajectory import Setting, Trajectory, run_timed
from physics_prior.studies.problems.mechanism import Benchmark


@dataclass
class Compiled:
    """The compiled step with one integrator; simulators are kept, so that nothing is built twice."""

    integrator: IntegratorName
    settings: Sequence[Setting]
    name: str
    engine: str = "compiled"

    def __post_init__(self) -> None:
        self._simulators: dict[tuple[Benchmark, float | None], Simulator] = {}

    def trajectory(self, benchmark: Benchmark, setting: Setting) -> Trajectory:
        """As ``Scheme`` says."""
        simulator = self._simulators.get((benchmark, setting.tolerance))
        q, v = benchmark.q.copy(), benchmark.v.copy()
        if simulator is None:
            allowed = TOLERATED if setting.tolerance is None else setting.tolerance
            simulator = Simulator(benchmark.tree, benchmark.effects, self.integrator, allowed)
            simulator.begin(q, v)
            simulator.advance(q.copy(), v.copy(), 1e-6)  # loads or compiles what is timed below
            self._simulators[benchmark, setting.tolerance] = simulator
        simulator.begin(q, v)
        return run_timed(
            benchmark,
            setting,
            lambda h, count: simulator.advance(q, v, h, count, benchmark.tau),
            lambda: (q, v),
        )
