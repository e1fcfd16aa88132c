"""Contact beside what holds: forces add up, and a moving anchor drags what touches."""

import numpy as np
import pytest

from physics_prior.dynamics.anchor_motion import displaced_anchor
from physics_prior.effects.anchor_motion import AnchorMotion, Sine
from physics_prior.effects.attachment import Attachment

CORNER = (0.1, 0.1, 0.1)


def held(cube, **fields):
    hand = Attachment(name="hand", part="cube", at="here", initially="off", **fields)
    return cube(effects=[hand], friction=0.5)


def total(simulator, q, v):
    """Force on the cube, N, and moment about its centre, N m, of all that holds or touches it."""
    wrenches = simulator.wrenches(q, v)
    force, moment = np.zeros(3), np.zeros(3)
    for name in ("hand", "contact"):
        force += wrenches[name].force
        moment += wrenches[name].moment + np.cross(wrenches[name].point - q[:3], wrenches[name].force)
    assert np.max(np.abs(wrenches["cube_joint"].force)) < 1e-12  # a free joint carries nothing
    return force, moment


@pytest.mark.parametrize("on", [False, True])
def test_a_cube_at_rest_is_carried_by_ground_and_hand_together(on, cube, at, g):
    simulator = held(cube, point=CORNER)
    q, v = at([0.0, 0.0, 0.1])
    simulator.begin(q, v)
    simulator.advance(q, v, 1e-3, 20)
    simulator.switch("hand", on, q, v)
    simulator.advance(q, v, 1e-3, 100)
    force, moment = total(simulator, q, v)
    assert np.max(np.abs(force - [0.0, 0.0, g])) < 1e-12  # measured 2e-15
    assert np.max(np.abs(moment)) < 1e-12  # measured 2e-16
    assert np.max(np.abs(q[:3] - [0.0, 0.0, 0.1])) < 1e-9
    assert (np.max(np.abs(simulator.wrenches(q, v)["hand"].force)) == 0.0) == (not on)


def test_a_cube_that_is_caught_hangs_and_let_go_falls_to_rest(cube, at, g):
    simulator = held(cube, point=CORNER)
    q, v = at([0.0, 0.0, 0.5])
    simulator.begin(q, v)
    simulator.advance(q, v, 1e-3, 50)
    simulator.switch("hand", True, q, v)
    simulator.advance(q, v, 1e-3, 200)
    assert np.max(np.abs(simulator.constraint_error(q, v))) < 1e-10
    simulator.switch("hand", False, q, v)
    simulator.advance(q, v, 1e-3, 2000)
    force, _ = total(simulator, q, v)
    assert np.max(np.abs(v)) < 1e-9
    assert np.max(np.abs(force - [0.0, 0.0, g])) < 1e-12  # measured 2e-15


@pytest.mark.parametrize(
    "motion",
    [AnchorMotion(velocity=(0.2, 0.0, 0.0)), AnchorMotion(sine=Sine(amplitude=(0.05, 0.02, 0.0), frequency=1.0))],
    ids=["belt", "shaker"],
)
def test_a_moving_anchor_drags_a_cube_over_the_ground(motion, cube, at, g):
    """It goes where the anchor goes, and all forces on it make its acceleration."""
    simulator = held(cube, motion=motion)
    table = motion.table(np.eye(3))
    q, v = at([0.0, 0.0, 0.1])
    simulator.begin(q, v)
    simulator.advance(q, v, 1e-3, 20)
    simulator.switch("hand", True, q, v)
    begin = q[:3] - np.array(displaced_anchor(table, simulator.time)[0])
    for _ in range(5):
        simulator.advance(q, v, 1e-3, 100)
        displacement, velocity, acceleration = map(np.array, displaced_anchor(table, simulator.time))
        assert np.max(np.abs(q[:3] - begin - displacement)) < 1e-12  # measured 7e-16
        assert np.max(np.abs(v[:3] - velocity)) < 1e-12
        force, _ = total(simulator, q, v)
        assert (
            np.max(np.abs(force - [0.0, 0.0, g] - acceleration)) < 2e-2
        )  # measured 6e-3: the mean over a step of 1 ms
