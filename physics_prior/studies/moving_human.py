"""The benchmark's human-like tree as a scene: it floats, limbs sprung and pushed about, and all of it is measured.

Springs, dampers and unknown forces are in proportion to the inertia that they move.
"""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from physics_prior.dynamics.formulations.generalized import mass_matrix
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.model import JointKind
from physics_prior.recording.simulate import Moment, motion
from physics_prior.scene import (
    Gate,
    Health,
    Initial,
    Marker,
    MeasurementSource,
    Noise,
    PointsSource,
    PoseSource,
    Scene,
    Simulation,
    Step,
)
from physics_prior.studies.bench_models import humanlike

RATE = 50.0  # Hz
TRUE_STEP = 2e-3  # s, of the simulated motion
STIFFNESS, DAMPING, PUSH = 10.0, 3.0, 2.0  # of joints, by the inertia that each moves: 1/s^2, 1/s and rad/s^2 sqrt(s)
DRIFT = 0.02  # of the free root, m/s^2 sqrt(s) and rad/s^2 sqrt(s): it stays where Euler angles do
POSITION_NOISE, ORIENTATION_NOISE, MARKER_NOISE = 5e-3, 0.03, 5e-3  # m, rad, m
MARKERS = ((0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (0.0, 0.0, 0.05))  # m, on each body


def moving_human(measured: Literal["poses", "markers"], step: Step) -> Scene:
    """The scene: 16 poses a stamp, a topic each, or 48 markers in one message."""
    tree = humanlike()
    moved = 1.0 / np.diag(np.linalg.inv(mass_matrix(tree, tree.neutral())))
    force, least = PUSH * moved, {}
    for link in tree.links:
        if link.joint.kind is JointKind.FREE:
            force[link.v] *= DRIFT / PUSH
        else:
            force[link.v] = PUSH * moved[link.v].min()
            least[link.joint.name] = float(moved[link.v].min())
    tone = JointSpring(
        name="tone",
        stiffness={joint: STIFFNESS * own for joint, own in least.items()},
        damping={joint: DAMPING * own for joint, own in least.items()},
    )
    parts = [link.part for link in tree.links]
    sources: tuple[MeasurementSource, ...] = tuple(
        PoseSource(topic=f"/{part}/pose", part=part, position_noise=POSITION_NOISE, orientation_noise=ORIENTATION_NOISE)
        for part in parts
    )
    if measured == "markers":
        markers = tuple(
            Marker(name=f"{part}_{k}", part=part, point=at) for part in parts for k, at in enumerate(MARKERS)
        )
        sources = (PointsSource(topic="/markers", markers=markers, noise=MARKER_NOISE),)
    start = tree.integrate(tree.neutral(), np.random.default_rng(0).normal(scale=0.2, size=tree.nv))
    return Scene(
        name="moving_human",
        path=Path(),
        description="The benchmark's human-like tree, floating and moving.",
        frame_id="world",
        tree=tree,
        effects=(tone,),
        measurements=sources,
        noise=Noise(force, np.full(tree.nv, 100.0), np.full(tree.nv, 3.0)),
        readouts=(),
        gate=Gate(),
        health=Health(),
        step=step,
        initial=Initial(start, np.zeros(tree.nv)),
        simulation=Simulation(rate=RATE),
    )


def moments(scene: Scene, duration: float, seed: int) -> list[Moment]:
    """The scene's true motion and what is measured, simulated by Runge and Kutta's method at ``TRUE_STEP``."""
    true = replace(scene, step=Step(integrator="rk4", size=TRUE_STEP))
    return list(motion(true, true.simulator(), seed, duration))
