"""Deviations of wrenches against differences of wrenches in Python, with joints alone and with a loop and what holds."""

import numpy as np
import pytest

from physics_prior.dynamics.wrench_deviations import wrench_deviations
from physics_prior.errors import SimulationError
from physics_prior.scene import load_scene

SHARE = 1e-3


@pytest.mark.parametrize("name", ["double_pendulum", "four_bar"])
def test_they_are_those_of_differences_along_the_columns(name):
    scene = load_scene(name)
    simulator = scene.simulator()
    q, v, nv = scene.initial.q.copy(), scene.initial.v.copy(), simulator.nv
    simulator.begin(q, v)
    factor = 0.01 * np.random.default_rng(0).normal(size=(2 * nv, 2 * nv))
    factor[:, 1] = 0.0
    simulator.constrain(q, v, factor)
    squares = np.zeros((len(simulator.wrench_names), 6))
    for column in factor.T:
        ahead, behind = (
            simulator.wrench_array(simulator.displaced(q, side * column[:nv]), v + side * column[nv:])
            for side in (SHARE, -SHARE)
        )
        squares += ((ahead - behind) / (2.0 * SHARE)) ** 2
    ours = wrench_deviations(simulator, q, v, factor, SHARE)
    assert np.max(ours) > 0.1
    np.testing.assert_allclose(ours, np.sqrt(squares), rtol=1e-9, atol=1e-12)  # the same to the last bit


def test_what_is_not_finite_is_refused():
    scene = load_scene("double_pendulum")
    simulator = scene.simulator()
    factor = np.full((4, 4), np.inf)
    with pytest.raises(SimulationError, match="forces are not finite near the state"):
        wrench_deviations(simulator, scene.initial.q, scene.initial.v, factor, SHARE)
