"""The process models by name."""

from collections.abc import Callable

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.forced_process import ForcedProcess
from physics_prior.estimation.process import FrozenProcess, KinematicProcess, PhysicsProcess, Process
from physics_prior.scene import Scene


def _physics(scene: Scene, simulator: Simulator) -> Process:
    return ForcedProcess(scene, simulator) if simulator.unknown.count else PhysicsProcess(scene, simulator)


PROCESSES: dict[str, Callable[[Scene, Simulator], Process]] = {
    "physics": _physics,
    "frozen": FrozenProcess,
    "kinematic": KinematicProcess,
}
"""By the name that ``--process`` knows them by."""
