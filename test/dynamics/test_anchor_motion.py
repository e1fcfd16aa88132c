"""Anchors that move as prescribed, against closed forms (equation 4 with its time derivatives)."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from physics_prior.dynamics.anchor_motion import displaced_anchor
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.anchor_motion import AnchorMotion, Keyframes, Sine
from physics_prior.effects.attachment import Attachment, Rod
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties, box
from physics_prior.model import Joint, JointKind, Part, Tree

G = 9.81
GRAVITY = Gravity(acceleration=(0.0, 0.0, -G))
KEYFRAMES = Keyframes(times=(0.1, 0.3, 0.6, 1.0), positions=((0, 0, 0), (0.1, 0, 0.05), (0.2, -0.1, 0), (0.2, 0, 0.1)))
SINE = Sine(amplitude=(0.05, 0.02, 0.03), frequency=1.5, phase=0.4)
MOTIONS = [
    AnchorMotion(velocity=(0.3, 0.1, -0.2)),
    AnchorMotion(sine=SINE),
    AnchorMotion(keyframes=KEYFRAMES),
]


@pytest.fixture(scope="module")
def box_tree():
    return Tree([Part("box", box(2.0, (0.3, 0.2, 0.1)))], [Joint("flight", JointKind.FREE, "world", "box")])


@pytest.mark.parametrize("motion", MOTIONS)
def test_velocity_and_acceleration_are_derivatives(motion):
    table = motion.table(np.eye(3))
    for time in (0.05, 0.2, 0.45, 0.8, 1.2):
        h = 1e-5
        (behind, u, _), (_, velocity, acceleration), (ahead, w, _) = (
            map(np.array, displaced_anchor(table, time + shift)) for shift in (-h, 0.0, h)
        )
        assert np.max(np.abs((ahead - behind) / (2 * h) - velocity)) < 1e-8  # measured 2e-10
        assert np.max(np.abs((w - u) / (2 * h) - acceleration)) < 1e-7  # measured 3e-9


def test_keyframes_are_met_and_joined_smoothly():
    """Twice continuously differentiable between the ends, at rest at both and beyond."""
    table = AnchorMotion(keyframes=KEYFRAMES).table(np.eye(3))
    for time, position in zip(KEYFRAMES.times, KEYFRAMES.positions, strict=True):
        assert np.max(np.abs(np.array(displaced_anchor(table, time)[0]) - position)) < 1e-15
    for time in KEYFRAMES.times[1:-1]:
        before, after = (np.array(displaced_anchor(table, time + shift)) for shift in (-1e-12, 1e-12))
        assert np.max(np.abs(after - before)) < 1e-9  # measured 4e-11
    for time, end in ((0.0, 0), (5.0, -1)):
        displacement, velocity, acceleration = displaced_anchor(table, time)
        assert np.max(np.abs(np.array(displacement) - KEYFRAMES.positions[end])) < 1e-15
        assert velocity == acceleration == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, r"give one of \['velocity', 'sine', 'keyframes'\]"),
        ({"velocity": (0, 0, 0), "sine": SINE}, "give one of"),
        ({"keyframes": {"times": (0.0, 0.0), "positions": ((0, 0, 0), (0, 0, 1))}}, "give increasing ones"),
        ({"keyframes": {"times": (0.0, 1.0, 2.0), "positions": ((0, 0, 0), (0, 0, 1))}}, "give as many of both"),
        ({"sine": {"amplitude": (0, 0, 1), "frequency": 0.0}}, "greater than 0"),
    ],
)
def test_motions_that_are_none_are_refused(fields, message):
    with pytest.raises(ValidationError, match=message):
        AnchorMotion(**fields)


def test_an_anchor_on_a_moving_part_has_no_motion_of_its_own(box_tree):
    tree = Tree(
        [*box_tree.parts, Part("arm", box(1.0, (0.1, 0.1, 0.1)))],
        [*box_tree.joints, Joint("hand", JointKind.SPHERICAL, "box", "arm")],
    )
    with pytest.raises(ModelError, match="'box' moves by itself"):
        Simulator(tree, [Attachment(part="arm", to="box", motion=MOTIONS[0])])


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_towed_mass_feels_m_a(motion, box_tree):
    """Held at its centre, the body goes where the anchor goes and the force on it is m (a - g)."""
    simulator = Simulator(box_tree, [GRAVITY, Attachment(part="box", at=(1.0, 0.0, 0.0), motion=motion)])
    q, v = box_tree.neutral(), np.zeros(6)
    simulator.begin(q, v)
    table = motion.table(np.eye(3))
    for _ in range(10):
        simulator.advance(q, v, 1e-2, 10)
        displacement, velocity, acceleration = map(np.array, displaced_anchor(table, simulator.time))
        assert np.max(np.abs(q[:3] - [1.0, 0.0, 0.0] - displacement)) < 1e-11  # measured 1e-13
        assert np.max(np.abs(v[:3] - velocity)) < 1e-12
        force = simulator.wrenches(q, v)["attachment"].force
        assert np.max(np.abs(force - 2.0 * (acceleration + [0.0, 0.0, G]))) < 1e-10  # measured 2e-13


def test_a_pendulum_on_a_shaken_pivot_is_the_analytic_one():
    """A point mass on a rod from an anchor that shakes: l th'' = -(g + z'') sin th - x'' cos th, against DOP853."""
    sine, length = Sine(amplitude=(0.05, 0.0, 0.08), frequency=2.0, phase=0.3), 0.7
    point = MassProperties(1.5, np.zeros(3), np.zeros((3, 3)))
    axes = np.eye(3)
    stages = [Part("slide_x"), Part("ball", point)]
    joints = [
        Joint("x", JointKind.PRISMATIC, "world", "slide_x", axis=axes[0]),
        Joint("z", JointKind.PRISMATIC, "slide_x", "ball", axis=axes[2]),
    ]
    tree = Tree(stages, joints)
    simulator = Simulator(tree, [GRAVITY, Rod(part="ball", length=length, motion=AnchorMotion(sine=sine))])
    table = AnchorMotion(sine=sine).table(np.eye(3))
    theta = 0.8
    pivot, speed, _ = map(np.array, displaced_anchor(table, 0.0))
    q = (pivot + length * np.array([np.sin(theta), 0.0, -np.cos(theta)]))[[0, 2]]
    v = speed[[0, 2]]
    simulator.begin(q, v)
    assert np.max(np.abs(v - speed[[0, 2]])) < 1e-12

    def rate(time, y):
        _, _, a = displaced_anchor(table, time)
        return [y[1], -((G + a[2]) * np.sin(y[0]) + a[0] * np.cos(y[0])) / length]

    times = np.linspace(0.0, 3.0, 13)
    exact = solve_ivp(rate, (0.0, 3.0), [theta, 0.0], method="DOP853", t_eval=times, rtol=1e-12, atol=1e-13).y[0]
    for time, angle in zip(times[1:], exact[1:], strict=True):
        simulator.advance(q, v, 1e-3, 250)
        assert abs(simulator.time - time) < 1e-12
        pivot = np.array(displaced_anchor(table, time)[0])
        at = pivot + length * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        assert np.max(np.abs(q - at[[0, 2]])) < 1e-9  # measured 3e-11
    # what the anchor does is the body's change of energy: dE/dt = force . velocity of the anchor
    work = 0.0
    simulator.move(q, v)
    before = simulator.energy()
    for _ in range(500):
        simulator.advance(q, v, 5e-4)
        force = simulator.wrenches(q, v)["rod"].force
        work += 1e-3 * force @ np.array(displaced_anchor(table, simulator.time)[1])
        simulator.advance(q, v, 5e-4)
    simulator.move(q, v)
    assert abs(simulator.energy() - before - work) < 3e-5  # measured 9e-6, the midpoint rule's


@pytest.mark.parametrize("effect", [Attachment, Rod])
@pytest.mark.parametrize("motion", MOTIONS)
def test_derivatives_of_a_step(effect, motion, box_tree):
    """F against central differences, along directions that the rows leave."""
    own = {"length": 0.6} if effect is Rod else {}
    holder = effect(part="box", point=(0.1, 0.0, 0.05), at=(0.5, 0.0, 0.2), motion=motion, **own)
    simulator = Simulator(box_tree, [GRAVITY, holder])
    rng = np.random.default_rng(0)
    q, v = box_tree.neutral(), rng.normal(size=6)
    q[0] = 0.6
    simulator.begin(q, v)
    simulator.time = start = 0.35
    simulator.project(q, v)
    A, A_q = simulator.tangent_rows(q, v)
    allowed = np.linalg.svd(np.block([[A, np.zeros_like(A)], [A_q, A]]))[2][2 * simulator.rows :].T
    end_q, end_v = q.copy(), v.copy()
    F, _ = simulator.linearise(end_q, end_v, 1e-3, np.ones(6))

    def end(column):
        simulator.time = start
        moved_q, moved_v = box_tree.integrate(q, column[:6]), v + column[6:]
        simulator.advance(moved_q, moved_v, 1e-3)
        return np.concatenate([box_tree.difference(end_q, moved_q), moved_v - end_v])

    for column in allowed.T:
        difference = (end(1e-5 * column) - end(-1e-5 * column)) / 2e-5
        assert np.max(np.abs(F @ column - difference)) < 1e-7  # measured 1.5e-9
