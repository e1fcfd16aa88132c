"""The process models by name."""

from collections.abc import Callable

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SceneError
from physics_prior.estimation.forced_process import ForcedProcess
from physics_prior.estimation.process import FrozenProcess, KinematicProcess, PhysicsProcess, Process
from physics_prior.scene import Scene


def _physics(scene: Scene, simulator: Simulator) -> Process:
    return ForcedProcess(scene, simulator) if simulator.unknown.count else PhysicsProcess(scene, simulator)


def _knowing_no_forces(
    name: str, process: Callable[[Scene, Simulator], Process]
) -> Callable[[Scene, Simulator], Process]:
    def make(scene: Scene, simulator: Simulator) -> Process:
        unknown = [effect.label for effect in scene.effects if effect.unknown_force(scene.tree) is not None]
        if unknown:
            raise SceneError(
                f"process '{name}' finds no unknown forces, and scene '{scene.name}' has {unknown}: take 'physics', or"
                " leave these effects out"
            )
        return process(scene, simulator)

    return make


PROCESSES: dict[str, Callable[[Scene, Simulator], Process]] = {
    "physics": _physics,
    "frozen": _knowing_no_forces("frozen", FrozenProcess),
    "kinematic": _knowing_no_forces("kinematic", KinematicProcess),
}
"""By the name that ``--process`` knows them by."""
