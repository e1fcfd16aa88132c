"""A scene's step, compiled: from the cache, or once and then with a word to whoever waits."""

import numpy as np

from physics_prior.commands.terminal import status
from physics_prior.dynamics.compose import step_module
from physics_prior.dynamics.kernel import cache_directory
from physics_prior.dynamics.simulator import Simulator
from physics_prior.scene import Scene


def compiled(scene: Scene) -> Simulator:
    """The scene's simulator with all of its kernels compiled, so that what comes next runs at its own speed."""
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    step = step_module(scene.effects, simulator.rows > 0, scene.step.integrator).__name__
    known = any(cache_directory().glob(f"*/{step}.linearise-*.nbc"))  # the largest kernel: compiled last
    with status(f"{'loading' if known else 'compiling'} the step of {scene.name}{'' if known else ', once: ~15 s'}"):
        q, v = scene.initial.q.copy(), scene.initial.v.copy()
        simulator.constrain(q, v, np.eye(2 * simulator.nv))
        simulator.advance(q, v, scene.step.size)
        simulator.wrenches(q, v)
        simulator.linearise(q, v, scene.step.size, scene.noise.force)
    return simulator
