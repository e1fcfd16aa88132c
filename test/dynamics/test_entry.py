"""A step as Python calls it: its machine code at once, and only for arrays that it would not misread."""

import inspect

import numpy as np
import pytest

from physics_prior.dynamics.covariance import carry
from physics_prior.dynamics.entry import ENTRIES
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import Gravity
from physics_prior.errors import SimulationError


@pytest.fixture
def simulator(double_pendulum):
    return Simulator(double_pendulum, [Gravity()])


def test_what_is_entered_is_what_the_dispatcher_calls(simulator):
    start, results = np.array([0.3, -0.2]), []
    for advance in (simulator.step.advance, simulator.step.module.advance):
        q, v = start.copy(), np.ones(2)
        assert advance(simulator.memory.array, q, v, np.zeros(2), 1e-3, 10) == 0
        results.append((q.tobytes(), v.tobytes()))
    assert results[0] == results[1]
    assert simulator.step.advance is simulator.step.advance
    assert simulator.step.advance is not simulator.step.module.advance


@pytest.mark.parametrize("name", ENTRIES)
def test_types_are_given_for_every_argument(simulator, name):
    parameters = inspect.signature(getattr(simulator.step.module, name).py_func).parameters
    assert len(parameters) == len(ENTRIES[name])


def test_an_unknown_function_is_none(simulator):
    with pytest.raises(AttributeError, match="fly"):
        _ = simulator.step.fly


def read_only(array):
    array.flags.writeable = False
    return array


WRONG = {
    "integers": (
        np.array([0, 1]),
        "an array of shape (2,) and type int64: a NumPy array of 2 floats (float64) is valid",
    ),
    "single": (np.zeros(2, np.float32), "an array of shape (2,) and type float32: a NumPy array of 2 floats"),
    "few": (np.zeros(1), "an array of shape (1,) and type float64: a NumPy array of 2 floats"),
    "square": (np.zeros((2, 2)), "an array of shape (2, 2) and type float64: a NumPy array of 2 floats"),
    "list": ([0.0, 1.0], "a list: a NumPy array of 2 floats"),
    "apart": (np.zeros((2, 2))[:, 0], "read-only, or its numbers stand apart in memory: a copy of it is valid"),
    "read-only": (read_only(np.zeros(2)), "read-only, or its numbers stand apart in memory: a copy of it is valid"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("name", ["q", "v", "tau"])
def test_an_array_that_would_be_misread_is_refused(simulator, name, case):
    array, told = WRONG[case]
    state = {"q": np.zeros(2), "v": np.zeros(2), "tau": np.zeros(2)} | {name: array}
    q, v, tau = state.values()
    calls = [
        lambda: simulator.acceleration(q, v, tau),
        lambda: simulator.acceleration_derivatives(q, v, tau),
        lambda: simulator.advance(q, v, 1e-3, 1, tau),
    ]
    if name != "tau":
        calls += [lambda: simulator.wrench_array(q, v), lambda: simulator.linearise(q, v, 1e-3, np.ones(2))]
    for call in calls:
        with pytest.raises(SimulationError) as refused:
            call()
        assert str(refused.value).startswith(f"{name} is {told}")


def test_noise_and_factors_of_whole_numbers_are_those_of_floats(simulator):
    """Machine code would read the bits of integers as floats."""
    results = []
    for kind in (int, float):
        q, v = np.array([0.3, -0.2]), np.ones(2)
        F, G = simulator.linearise(q, v, 1e-2, np.array([2, 3], dtype=kind))
        factor = carry(simulator, q, v, 1e-2, 2, np.eye(4, dtype=kind), np.diag(np.array([2, 3], dtype=kind)))
        results.append((F.tobytes(), G.tobytes(), factor.tobytes()))
    assert results[0] == results[1]
