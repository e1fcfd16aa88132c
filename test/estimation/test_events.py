"""The step of a covariance through events: what is uncertain about a contact is noise of the impact that it is part of."""

import numpy as np
import pytest

from physics_prior import inertia
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.contact import Contact
from physics_prior.effects.gravity import Gravity
from physics_prior.estimation.events import carry
from physics_prior.model import Joint, JointKind, Part, Shape, Tree

H = 1e-3


@pytest.fixture(scope="module")
def noise():
    """(12, 12) covariance of the noise of a step of a ball, 1 kg, from a height and a velocity."""
    part = Part("ball", inertia.sphere(1.0, 0.1), Shape("sphere", np.full(3, 0.2)))
    contact = Contact(part="ball", restitution=0.6, restitution_deviation=0.1, friction=0.1, friction_deviation=0.05)
    simulator = Simulator(Tree([part], [Joint("free", JointKind.FREE, "world", "ball")]), [Gravity(), contact])

    def covariance(height, velocity):
        q, v = np.array([0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0]), np.array([*velocity, 0.0, 0.0, 0.0])
        W = carry(simulator, q, v, np.zeros((12, 12)), np.zeros((6, 0)), H)
        return W @ W.T

    return covariance


def test_uncertain_restitution_and_friction_are_noise_of_an_impact(noise):
    P = noise(0.101, (3.0, 0.0, -2.0))
    assert np.sqrt(P[8, 8]) == pytest.approx(0.1 * 2.0, rel=0.01)  # measured 2.4e-3: deviation times speed of impact
    slip = 0.05 * (1.6 * 2.0)  # deviation times normal impulse over mass
    assert np.sqrt(P[6, 6]) == pytest.approx(slip, rel=0.03)  # measured 1.0e-2: restitution's share of it too


def test_they_are_nothing_in_flight(noise):
    assert not noise(1.0, (3.0, 0.0, -2.0)).any()


def test_friction_may_be_uncertain_about_none():
    """What is tried with friction takes rows that the memory had no room for: a box that rests wrote beyond its end."""
    box = Part("box", inertia.box(1.0, (0.2, 0.2, 0.2)), Shape("box", np.full(3, 0.2)))
    contact = Contact(part="box", friction_deviation=0.1)
    simulator = Simulator(Tree([box], [Joint("free", JointKind.FREE, "world", "box")]), [Gravity(), contact])
    q, v = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(20):
        W = carry(simulator, q, v, np.zeros((12, 12)), np.zeros((6, 0)), H)
        assert np.isfinite(W).all()
    # less friction than none there is not: half the variance of 0.1 either way; measured 6.934e-4
    assert np.linalg.norm(W[6]) == pytest.approx(0.1 * 9.81 * H / np.sqrt(2.0), rel=1e-3)
