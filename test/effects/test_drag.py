"""Drag against closed forms: the terminal velocity and the way to it."""

import numpy as np
import pytest

from physics_prior.dynamics.force_noise import PointForces
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import box
from physics_prior.model import Joint, JointKind, Part, Tree

MASS, G = 2.0, 9.80665


@pytest.fixture(scope="module")
def ball():
    return Tree([Part("ball", box(MASS, (0.1, 0.1, 0.1)))], [Joint("flight", JointKind.FREE, "world", "ball")])


def fall(tree, drag, v, seconds):
    """Height and velocity (6,) after some time of free fall from rest at the origin."""
    simulator = Simulator(tree, [Gravity(), drag])
    q = tree.neutral()
    simulator.advance(q, v, 1e-3, round(1000 * seconds))
    return q[2], v


def test_quadratic_drag_falls_as_galilei_did_not_say(ball):
    """m z'' = -m g + c z'^2: v = -vt tanh(g t / vt), z = -vt^2/g ln cosh(g t / vt), vt^2 = m g / c."""
    drag, t = Drag(part="ball", quadratic=0.5), 0.8
    limit = np.sqrt(MASS * G / drag.quadratic)
    z, v = fall(ball, drag, np.zeros(6), t)
    assert v[2] == pytest.approx(-limit * np.tanh(G * t / limit), rel=1e-11)  # measured 1e-13
    assert z == pytest.approx(-(limit**2) / G * np.log(np.cosh(G * t / limit)), rel=1e-11)
    assert fall(ball, drag, np.zeros(6), 10.0)[1][2] == pytest.approx(-limit, rel=1e-12)  # measured 5e-14


def test_linear_drag_carries_along_with_the_wind_and_slows_the_spin(ball):
    """m u' = m g - c u of the velocity u against the wind; I w' = -c w about an axis of symmetry."""
    wind, t = np.array([3.0, -1.0, 0.5]), 0.8
    drag = Drag(part="ball", linear=1.5, angular=0.01, wind=tuple(wind))
    spin = np.array([1.0, 2.0, 3.0])
    _, v = fall(ball, drag, np.concatenate([np.zeros(3), spin]), t)
    decay, limit = np.exp(-drag.linear / MASS * t), wind + np.array([0.0, 0.0, -MASS * G / drag.linear])
    assert np.allclose(v[:3], limit - limit * decay, rtol=0.0, atol=1e-12)  # measured 1e-14
    moment = ball.links[0].mass_properties.inertia[0, 0]
    assert np.allclose(v[3:], spin * np.exp(-drag.angular / moment * t), rtol=0.0, atol=1e-11)  # measured 4e-13


def test_drag_off_the_centre_turns_into_the_wind(ball):
    """At rest in wind, the moment is the lever crossed with the force."""
    drag = Drag(part="ball", point=(0.0, 0.0, 0.2), quadratic=0.25, wind=(4.0, 0.0, 0.0))
    simulator = Simulator(ball, [drag])
    vdot = simulator.acceleration(ball.neutral(), np.zeros(6))
    force = np.array([0.25 * 16.0, 0.0, 0.0])
    assert np.allclose(vdot[:3], force / MASS, rtol=1e-14)
    turning = np.cross([0.0, 0.0, 0.2], force) / ball.links[0].mass_properties.inertia[1, 1]
    assert np.allclose(vdot[3:], turning, rtol=1e-14)


def test_gusts_push_where_the_drag_acts(ball):
    """White forces at a point are, in the body's freedoms, J^T along each axis that has any."""
    drag = Drag(part="ball", point=(0.0, 0.0, 0.2), linear=1.0, gusts=(0.5, 0.0, 2.0))
    forces = PointForces(Simulator(ball, [Gravity(), drag]))
    columns = forces.columns(ball.neutral(), np.zeros(6))
    assert forces.count == 2
    assert np.allclose(columns[:, 0], [0.5, 0.0, 0.0, 0.0, 0.1, 0.0], atol=1e-15)
    assert np.allclose(columns[:, 1], [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], atol=1e-15)
    assert drag.explain(ball).startswith("resists the motion of ball in gusts: 1 N s/m")
