"""The ways to run an estimator that the study sets beside each other, and the scenes that it runs them on."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from physics_prior.dynamics.integrators import IntegratorName
from physics_prior.scene import Scene, Step, load_scene
from physics_prior.studies.moving_human import moving_human

RATE = 50.0  # Hz, of the measurements


@dataclass(frozen=True)
class Variant:
    """One way to run an estimator.

    Attributes:
        integrator, size: of the scene's step, s; process: as ``--process`` knows it.
        every: only every so-many-th stamp is measured.
        lag: s, for which an estimate waits, to be smoothed by what comes meanwhile.
    """

    integrator: IntegratorName = "rk4"
    size: float = 20e-3
    process: str = "physics"
    every: int = 1
    lag: float = 0.0

    @property
    def series(self) -> str:
        """What it is compared with."""
        if self.lag > 0.0:
            return "smoothed, later by"
        if self.every > 1:
            return "fewer measurements"
        return {"physics": self.integrator, "frozen": "derivatives once", "kinematic": "no physics"}[self.process]

    @property
    def label(self) -> str:
        """What is special about it within its series."""
        if self.lag > 0.0:
            return f"{1e3 * self.lag:g} ms"
        return f"1 in {self.every}" if self.every > 1 else f"{1e3 * self.size:g} ms"

    def of(self, scene: Scene) -> Scene:
        """The scene, stepped so."""
        return replace(scene, step=Step(integrator=self.integrator, size=self.size))


SIZES = (20e-3, 10e-3, 5e-3, 2e-3, 1e-3)
STEPS = tuple(Variant(integrator, size) for integrator in ("semi_implicit_euler", "rk4") for size in SIZES)  # type: ignore[arg-type]
OTHERS = (
    *(Variant(size=size, process="frozen") for size in SIZES[1:]),
    Variant(process="kinematic"),
    *(Variant(every=every) for every in (2, 4)),
    *(Variant(lag=lag) for lag in (0.04, 0.1, 0.4)),
)
VARIANTS = (*STEPS, *OTHERS)


def _shipped(name: str) -> Scene:
    scene = load_scene(name)
    return replace(scene, simulation=scene.simulation.model_copy(update={"rate": RATE}))


PROBLEMS: dict[str, Callable[[], Scene]] = {
    "double_pendulum": lambda: _shipped("double_pendulum"),
    "four_bar": lambda: _shipped("four_bar"),
    "moving_human": lambda: moving_human("poses", Step()),
}
"""Scenes by name, each simulated; their measurements come at RATE."""
