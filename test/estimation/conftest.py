"""Scenes that the tests of estimation share, and what their sources measure, simulated in memory."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import Filter
from physics_prior.estimation.process import PhysicsProcess
from physics_prior.recording.simulate import Moment, motion
from physics_prior.scene import Scene, load_scene

EVERY_SOURCE = """
description: Every kind of joint and of measurement.
model:
  parts:
    base: {mass: 2, inertia: {box: [0.3, 0.2, 0.1]}, joint: {kind: free, name: root}}
    arm:
      mass: 1
      center_of_mass: [0, 0, 0.2]
      inertia: {capsule: {radius: 0.05, length: 0.4}}
      joint: {kind: spherical, name: shoulder, parent: base, position: [0.1, 0, 0.05], orientation: {axis: x, angle: 40 deg}}
    forearm:
      mass: 0.5
      center_of_mass: [0, 0, 0.1]
      inertia: {cylinder: {radius: 0.04, length: 0.3}}
      joint: {kind: revolute, name: elbow, parent: arm, axis: y, position: [0, 0, 0.4]}
    slider: {mass: 0.2, inertia: {sphere: 0.03}, joint: {kind: prismatic, name: slide, parent: forearm, axis: z}}
effects: [gravity]
measurements:
  - pose:
      topic: /arm/pose
      part: arm
      frame: {position: [0.02, 0, 0.1], orientation: {axis: [1, 2, 3], angle: 70 deg}}
      position_noise: 5 mm
      orientation_noise: 2 deg
      scale: 1.5
  - orientation: {topic: /base/imu, part: base, frame: {orientation: {axis: y, angle: 90 deg}}, orientation_noise: 1 deg}
  - points:
      topic: /markers
      noise: 1 mm
      markers: [{name: a, part: base}, {name: b, part: forearm, point: [0, 0, 0.1]}, {name: c, part: slider, point: [0.1, 0, 0]}]
  - joints: {topic: /encoders, joints: {e1: elbow, e2: slide}, noise: 1e-3}
noise: {force: 1e-2}
step: {size: 4 ms}
"""


@cache
def _filter(scene: Scene) -> Filter:
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    return Filter(scene, simulator, PhysicsProcess(scene, simulator))


@cache
def _shipped(name: str, rate: float, size: float) -> Scene:
    scene = load_scene(name)
    return replace(
        scene,
        simulation=scene.simulation.model_copy(update={"rate": rate}),
        step=scene.step.model_copy(update={"size": size}),
    )


@pytest.fixture(scope="session")
def every_source(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("scenes") / "every_source.yaml"
    path.write_text(EVERY_SOURCE)
    return load_scene(path)


@pytest.fixture(scope="session")
def shipped() -> Callable[..., Scene]:
    """A shipped scene at a reduced rate and a coarser step: (name, rate=50, size=5e-3)."""

    def make(name: str, rate: float = 50.0, size: float = 5e-3) -> Scene:
        return _shipped(name, rate, size)

    return make


@pytest.fixture(scope="session")
def filter_of() -> Callable[[Scene], Filter]:
    return _filter


@pytest.fixture(scope="session")
def moments_of() -> Callable[..., list[Moment]]:
    """The true states and measurements of a scene: (scene, seed=0, duration=1)."""

    @cache
    def make(scene: Scene, seed: int = 0, duration: float = 1.0) -> list[Moment]:
        return list(motion(scene, _filter(scene).simulator, seed, duration))

    return make


@pytest.fixture(scope="session")
def fingerprint() -> Callable[[Estimator], list[bytes]]:
    """Every bit of what an estimator knows in the end."""

    def of(estimator: Estimator) -> list[bytes]:
        posterior = estimator.history.nodes[-1].posterior
        state = posterior.state
        numbers = np.array([posterior.stamp, posterior.accepted, posterior.refused, posterior.nis])
        return [array.tobytes() for array in (state.q, state.v, state.acceleration, posterior.factor, numbers)]

    return of


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[[str], Scene]:
    """A scene from its text."""

    def load(text: str) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(text)
        return load_scene(path)

    return load
