"""Errors that leave be what touches: what they keep, what they take away, and what forces then do."""

import numpy as np

from physics_prior import inertia
from physics_prior.dynamics.contact.admissible import admissible_errors
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_limit import JointLimit
from physics_prior.model import Joint, JointKind, Part, Tree

H = 1e-3
ERRORS = np.diag(np.r_[np.full(6, 5e-3), np.full(6, 0.5)])  # of a free body: 5 mm and 5 mrad, 0.5 m/s and rad/s


def slopes(simulator, q, v, errors, share=1e-3):
    """Root of the sum of squares of the forces' slopes along errors."""
    nv, total = simulator.nv, 0.0
    for column in errors.T:
        ends = [
            simulator.wrench_array(simulator.displaced(q, side * share * column[:nv]), v + side * share * column[nv:])
            for side in (1.0, -1.0)
        ]
        total = total + ((ends[0] - ends[1]) / (2.0 * share)) ** 2
    return np.sqrt(total)


def test_a_box_at_rest_may_lie_anywhere_but_neither_rise_nor_tilt_nor_move(cube, at):
    simulator = cube(friction=0.5)
    q, v = at((0.3, -0.2, 0.1))
    left = admissible_errors(simulator, q, v, ERRORS)
    expected = np.zeros((12, 12))
    expected[[0, 1, 5], [0, 1, 5]] = 5e-3
    assert np.max(np.abs(left - expected)) < 1e-12  # measured 6e-15
    assert np.max(slopes(simulator, q, v, left)) < 1e-10  # N, measured 2e-12: its weight is certain
    assert np.max(slopes(simulator, q, v, ERRORS)) > 1e3  # what the kink alone says


def test_a_box_that_slides_goes_on_sliding(cube, at, g):
    simulator = cube(friction=0.5)
    q, v = at((0.0, 0.0, 0.1), (2.0, 0.0, 0.0))
    left = admissible_errors(simulator, q, v, ERRORS)
    assert np.allclose(left[6:8, 6:8], 0.5 * np.eye(2), atol=1e-12)
    assert np.max(np.abs(left[[2, 3, 4, 8, 9, 10]])) < 1e-12  # measured 2e-15
    deviation = slopes(simulator, q, v, left)[-1]
    assert deviation[2] < 1e-10  # measured 2e-12
    # friction turns with the slip, whose direction 0.5 m/s across 2 m/s make uncertain by a quarter
    assert abs(deviation[1] - 0.5 * g * 0.25) < 0.02 * g  # measured 2e-3: gravity, friction and slip within a step


def test_in_flight_errors_are_left_alone(cube, at):
    simulator = cube(friction=0.5)
    assert admissible_errors(simulator, *at((0.0, 0.0, 1.0)), ERRORS) is ERRORS


def test_a_joint_at_its_stop_stays_there(g):
    rod = inertia.MassProperties(1.0, np.array([0.0, 0.0, -0.5]), np.diag([1 / 12, 1 / 12, 0.0]))
    tree = Tree(
        [Part("upper", rod), Part("lower", rod)],
        [
            Joint("pin", JointKind.REVOLUTE, "world", "upper", axis=np.array([0.0, 1.0, 0.0])),
            Joint("knee", JointKind.REVOLUTE, "upper", "lower", np.array([0, 0, -1.0]), axis=np.array([0.0, 1.0, 0.0])),
        ],
    )
    simulator = Simulator(tree, [Gravity(), JointLimit(lower={"knee": 0.3})])
    q, v = np.array([0.2, 0.3]), np.zeros(2)
    left = admissible_errors(simulator, q, v, np.diag([5e-3, 5e-3, 0.5, 0.5]))
    assert np.max(np.abs(left[[1, 3]])) < 1e-12  # measured 0
    assert left[0, 0] == 5e-3
    # the stop's moment goes with the pin's angle, smoothly
    deviation = slopes(simulator, q, v, left)
    assert np.isfinite(deviation).all()
    assert np.max(deviation) < 0.1 * g  # measured 0.07
