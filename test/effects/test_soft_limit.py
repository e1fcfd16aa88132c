"""Soft ends of a range: smooth, one-sided, conservative without damper, and a stop's companion."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.joint_limit import JointLimit
from physics_prior.effects.soft_limit import SoftLimit
from physics_prior.errors import ModelError
from physics_prior.inertia import box
from physics_prior.model import Joint, JointKind, Part, Tree

BODY = box(2.0, (0.1, 0.2, 0.3))
X, Y = np.eye(3)[:2]


@pytest.fixture(scope="module")
def tree():
    """A slide and a hinge."""
    return Tree(
        [Part("cart", BODY), Part("arm", BODY)],
        [
            Joint("rail", JointKind.PRISMATIC, "world", "cart", axis=X),
            Joint("elbow", JointKind.REVOLUTE, "cart", "arm", 0.3 * X, axis=Y),
        ],
    )


@pytest.fixture(scope="module")
def soft():
    """Factory of soft limits of the slide in (-0.5, 0.4) and the hinge below 1, over 0.1 m and 0.2 rad."""

    def build(damping=0.0):
        return SoftLimit(
            lower={"rail": -0.5},
            upper={"rail": 0.4, "elbow": 1.0},
            range={"rail": 0.1, "elbow": 0.2},
            stiffness={"rail": 300.0, "elbow": 20.0},
            damping={"rail": 10.0 * damping, "elbow": damping},
        )

    return build


@pytest.fixture(scope="module")
def force(tree):
    """Factory: the generalized force of a limit at q and v."""

    def of(limit):
        simulator = Simulator(tree, [limit])

        def at(q, v):
            simulator.acceleration(np.asarray(q, dtype=float), np.asarray(v, dtype=float))
            return simulator.effort

        return at

    return of


def test_the_force_by_hand(soft, force):
    at = force(soft(1.0))
    assert not at([0.29, 0.79], [5.0, 5.0]).any()  # not there yet, however fast
    # half way in: k d^2 / (2 range), and half of the damper
    assert at([0.35, 0.9], [0.0, 0.0]) == pytest.approx([-300 * 0.05**2 / 0.2, -20 * 0.1**2 / 0.4], rel=1e-12)
    assert at([0.35, 0.9], [0.3, 0.2]) == pytest.approx([-3.75 - 0.5 * 10 * 0.3, -0.5 - 0.5 * 0.2], rel=1e-12)
    assert at([-0.5, 0.0], [-0.1, 0.0]) == pytest.approx([300 * 0.05 + 10 * 0.1, 0.0], rel=1e-12)  # at the end
    assert at([-0.6, 0.0], [0.0, 0.0]) == pytest.approx([300 * 0.15, 0.0], rel=1e-12)  # and 0.1 m beyond it


def test_it_never_pulls(soft, force):
    at, rng = force(soft(50.0)), np.random.default_rng(0)
    clamped = 0
    for _ in range(300):
        rail, elbow = at([rng.uniform(0.3, 0.5), rng.uniform(0.8, 1.3)], 3.0 * rng.normal(size=2))
        assert rail <= 0.0
        assert elbow <= 0.0
        clamped += rail == 0.0
    assert 50 < clamped < 250  # a damper that would hold back what leaves does nothing


@pytest.mark.parametrize("q", [(0.3 + 1e-9, 0.8 - 1e-9), (0.35, 0.9), (0.4, 1.0), (-0.45, 1.1), (-0.6, 0.5)])
def test_derivatives_against_differences(tree, soft, q):
    simulator = Simulator(tree, [soft(1.0)])
    v = np.array([0.02 * np.sign(q[0]), 0.1])
    by_q, by_v = simulator.acceleration_derivatives(np.array(q), v)
    for k, (step, out) in enumerate([(np.eye(2)[i], by) for by in (by_q, by_v) for i in range(2)]):
        moved = [(np.array(q) + s * step, v) if k < 2 else (np.array(q), v + s * step) for s in (1e-6, -1e-6)]
        difference = (simulator.acceleration(*moved[0]) - simulator.acceleration(*moved[1])) / 2e-6
        # across the beginning and the end of the range too, where the second derivative jumps
        assert np.allclose(out[:, k % 2], difference, rtol=1e-5, atol=1e-2)


def test_the_force_is_the_gradient_of_the_energy(tree, soft, force):
    simulator, at = Simulator(tree, [soft()]), force(soft())

    def energy(q):
        simulator.move(q, np.zeros(2))
        return simulator.energy()

    start = energy(np.array([0.0, 0.0]))
    assert start == energy(np.array([0.29, -3.0]))  # nothing stored inside the range
    for q in np.array([(0.31, 0.85), (0.4, 1.0), (0.45, 1.3), (-0.43, 0.9), (-0.7, 0.0)]):
        slope = [(energy(q + d) - energy(q - d)) / 2e-5 for d in 1e-5 * np.eye(2)]
        assert at(q, [0.0, 0.0]) == pytest.approx(-np.array(slope), abs=1e-7)


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_energy_is_kept_without_damper_and_only_taken_with_it(tree, soft, damping):
    simulator = Simulator(tree, [soft(damping)])
    q, v, energies = np.zeros(2), np.array([1.5, 2.0]), []
    for _ in range(300):
        simulator.move(q, v)
        energies.append(simulator.energy())
        simulator.advance(q, v, 1e-3, 10)
    if damping:
        assert np.max(np.diff(energies)) < 1e-9
        assert energies[-1] < 0.7 * energies[0]
    else:
        assert np.ptp(energies) < 1e-6 * energies[0]


def test_what_the_spring_does_not_hold_meets_the_stop(tree):
    soft = SoftLimit(upper={"rail": 0.4}, range={"rail": 0.1}, stiffness={"rail": 300.0})
    simulator = Simulator(tree, [soft, JointLimit(upper={"rail": 0.4}, restitution=0.5)])
    for speed, stops in ((0.3, False), (3.0, True)):
        q, v, furthest = np.zeros(2), np.array([speed, 0.0]), 0.0
        for _ in range(2500):
            simulator.advance(q, v, 1e-3)
            furthest = max(furthest, q[0])
            if v[0] < 0.0 and q[0] < 0.3:
                break
        assert (furthest > 0.4 - 1e-3) == stops
        assert furthest <= 0.4 + 1e-9
        # the spring gives everything back, the stop half of the speed that is left there
        if not stops:
            assert v[0] == pytest.approx(-speed, rel=1e-6)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "limits no joint: give 'lower' or 'upper'"),
        ({"lower": {"knee": 0.0}}, "joint 'knee' is unknown or fixed"),
        ({"lower": {"rail": 0.0}, "stiffness": {}}, "joint 'rail' has no stiffness"),
        ({"lower": {"rail": 0.0}, "range": {}}, "joint 'rail' has no range"),
        ({"lower": {"rail": 0.0}, "damping": {"elbow": 1.0}}, "joint 'elbow' has no end"),
        ({"lower": {"rail": 0.0}, "upper": {"rail": 0.0}}, "lower limit 0 of 'rail' is not below its upper one, 0"),
    ],
)
def test_what_does_not_fit_is_named(tree, fields, message):
    limit = SoftLimit(**({"range": {"rail": 0.1}, "stiffness": {"rail": 1.0}} | fields))
    with pytest.raises(ModelError, match=message):
        limit.check(tree)
