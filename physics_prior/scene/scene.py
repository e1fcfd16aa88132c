"""The scene: everything that simulation and estimation need to know, read from one file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_prior.dynamics.contact.memory import Sleep
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import Effect
from physics_prior.errors import SceneError
from physics_prior.model import Tree
from physics_prior.scene.measurements import MeasurementSource
from physics_prior.scene.readouts import Readout
from physics_prior.scene.schema import Accuracy, Gate, Health, Simulation, Step


@dataclass(frozen=True, eq=False)
class Noise:
    """How far the model is trusted, one number per degree of freedom.

    Attributes:
        force: (nv,) root of the spectral density of the unknown generalized force, N sqrt(s) along a line and
            N m sqrt(s) about an axis: an impulse of this size a second, as a standard deviation.
        jerk: (nv,) that of the jerk of the kinematic process, m/s^3 sqrt(s) and rad/s^3 sqrt(s).
        velocity: (nv,) standard deviation of the velocity before the first measurement, m/s and rad/s.
    """

    force: np.ndarray
    jerk: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True, eq=False)
class Initial:
    """Where the motion starts: configuration (nq,) and velocity (nv,)."""

    q: np.ndarray
    v: np.ndarray


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene file as read, checked and turned into SI units.

    Attributes:
        name: the file's name without its ending.
        path: the file.
        description: what it is, for people.
        frame_id: the world frame of all messages.
        tree: the model.
        effects: what acts on it, labels unique; nothing else is compiled into the step.
        measurements: where measurements come from, one source a topic.
        noise: how far the model is trusted.
        readouts: what to plot and score, names unique.
        gate: which measurements are believed.
        health: how long the estimate is trusted without any.
        step: time stepping.
        initial: start of the simulation.
        simulation: what ``simulate`` records.
        accuracy: what is asked of the step where none is given: ``stepping.settle`` finds one.
    """

    name: str
    path: Path
    description: str
    frame_id: str
    tree: Tree
    effects: tuple[Effect, ...]
    measurements: tuple[MeasurementSource, ...]
    noise: Noise
    readouts: tuple[Readout, ...]
    gate: Gate
    health: Health
    step: Step
    initial: Initial
    simulation: Simulation
    accuracy: Accuracy | None = None

    def simulator(self, sleeping: bool = True) -> Simulator:
        """The scene's own compiled step; islands at rest sleep if the scene says so and ``sleeping`` does not forbid it.

        Raises:
            SceneError: the scene asks for an accuracy, and no step has been chosen for it.
        """
        if self.accuracy is not None:
            raise SceneError(f"scene '{self.name}' asks for an accuracy: its step is not chosen yet")
        step, sleep = self.step, None
        if sleeping and step.sleep is not None:
            sleep = Sleep(step.sleep.velocity, step.sleep.duration)
        return Simulator(self.tree, self.effects, step.integrator, step.tolerance, step.size, sleep)
