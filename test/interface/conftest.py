"""A scene with every kind of joint and a held point, its simulator, and estimates of it at random states."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimate import Counts, Estimate, Health, Level
from physics_prior.scene import load_scene

EVERY_JOINT = """
description: every kind of joint
frame_id: lab
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
      joint: {kind: revolute, name: elbow-1, parent: arm, axis: y, position: [0, 0, 0.4]}
    slider: {mass: 0.2, inertia: {sphere: 0.03}, joint: {kind: prismatic, name: elbow.1, parent: forearm, axis: z}}
    camera: {mass: 0.1, inertia: 1e-4, joint: {kind: fixed, name: mount, parent: base, position: [0, 0.1, 0]}}
effects:
  - gravity
  - attachment: {name: strap, part: slider, point: [0, 0, 0.1]}
measurements:
  - pose: {topic: /arm/pose, part: arm, position_noise: 5 mm, orientation_noise: 2 deg, scale: 1.5}
  - orientation: {topic: /base/imu, part: base, orientation_noise: 2 deg}
  - points:
      topic: /markers
      noise: 1 mm
      markers: [{name: a, part: base}, {name: b, part: arm, point: [0, 0, 0.1]}]
  - joints: {topic: /encoders, joints: {e1: elbow-1, e2: elbow.1}, noise: 1e-3}
noise: {force: 1e-2}
"""


@pytest.fixture(scope="session")
def every_joint(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "every_joint.yaml"
    path.write_text(EVERY_JOINT)
    return load_scene(path)


@pytest.fixture(scope="session")
def every_joint_simulator(every_joint):
    return Simulator(every_joint.tree, every_joint.effects, every_joint.step.integrator)


@pytest.fixture
def estimate_of():
    def make(simulator, seed=0, stamp=1_700_000_000_250_000_000, **changes):
        rng = np.random.default_rng(seed)
        nv = simulator.nv
        q = simulator.tree.integrate(simulator.tree.neutral(), rng.normal(size=nv))
        v = rng.normal(size=nv)
        root = 0.1 * rng.normal(size=(2 * nv, 2 * nv))
        values = {
            "stamp": stamp,
            "q": q,
            "v": v,
            "covariance": root @ root.T,
            "vdot": rng.normal(size=nv),
            "effort": rng.normal(size=nv),
            "wrenches": simulator.wrenches(q, v),
            "wrench_deviations": {name: rng.uniform(1, 2, size=6) for name in simulator.wrench_names},
            "constraint_error": 1e-12,
            "rank": simulator.rows,
            "rows": simulator.switches.rows,
            "holding": simulator.switches.holding,
            "health": Health(Level.OK),
            "nis": (5.0, 6),
            "counts": Counts(read=10, used=8, gated=1, late=2, rejected=1),
        }
        return Estimate(**(values | changes))

    return make
