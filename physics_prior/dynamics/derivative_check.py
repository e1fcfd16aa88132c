"""The derivatives of effects against differences: for whoever writes one."""

from collections.abc import Sequence

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.effect import Effect
from physics_prior.model import Tree

WIDTH = 1e-6  # rad, m and their rates: half the width of central differences


def derivative_error(tree: Tree, effects: Sequence[Effect], samples: int = 5, seed: int = 0) -> float:
    """How far the derivatives of acceleration under effects are off central differences, in random states.

    The largest deviation of an entry, relative to the largest entry or one: some 1e-9 for effects whose ``differentiate`` is
    that of their ``apply``. Where a force has a kink (a spring that goes slack) a state beside it is off by more.
    """
    simulator, rng, worst = Simulator(tree, effects), np.random.default_rng(seed), 0.0
    for _ in range(samples):
        q, v = tree.integrate(tree.neutral(), rng.normal(size=tree.nv)), rng.normal(size=tree.nv)
        simulator.project(q, v)
        analytic = simulator.acceleration_derivatives(q, v)
        for k in range(tree.nv):
            step = WIDTH * np.eye(tree.nv)[k]
            ends = [
                [simulator.acceleration(tree.integrate(q, sign * step), v) for sign in (1.0, -1.0)],
                [simulator.acceleration(q, v + sign * step) for sign in (1.0, -1.0)],
            ]
            for exact, (ahead, behind) in zip(analytic, ends, strict=True):
                off = np.abs((ahead - behind) / (2.0 * WIDTH) - exact[:, k]).max()
                worst = max(worst, float(off / max(1.0, np.abs(exact).max())))
    return worst
