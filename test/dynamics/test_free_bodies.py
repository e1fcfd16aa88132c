"""A scene without joints is compiled without them, and moves to the last bit as it would with them."""

import numpy as np
import pytest

from physics_prior.dynamics import simulator as simulator_module
from physics_prior.dynamics.compose import structure_of
from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.wrench_deviations import wrench_deviations
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.contact import Contact
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.spring import Spring
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree

PUSHES = [
    Gravity(),
    Drag(part="dart", point=(0.0, 0.1, 0.2), quadratic=0.1),
    Spring(part="dart", point=(0.0, 0.0, 0.3), to="stone", stiffness=20.0, damping=0.1),
]
HELD = [*PUSHES, Attachment(part="dart")]


@pytest.fixture(scope="module")
def two_bodies():
    inertia = np.array([[0.3, 0.02, -0.01], [0.02, 0.2, 0.03], [-0.01, 0.03, 0.25]])
    bodies = [MassProperties(2.0, np.array([0.0, 0.1, -0.05]), inertia), MassProperties(1.0, np.zeros(3), 2 * inertia)]
    names = ("dart", "stone")
    return Tree(
        [Part(name, body) for name, body in zip(names, bodies, strict=True)],
        [Joint(f"{name}_flight", JointKind.FREE, "world", name) for name in names],
    )


@pytest.fixture
def with_joints(monkeypatch):
    """`with_joints(...)`: a simulator compiled as if there were joints."""

    def build(*scene):
        with monkeypatch.context() as patch:
            patch.setattr(simulator_module, "structure_of", lambda *of: structure_of(*of)._replace(free=False))
            return Simulator(*scene)

    return build


def test_what_has_a_joint_or_touches_is_not_free(two_bodies, double_pendulum):
    assert structure_of(two_bodies, PUSHES).free
    assert structure_of(two_bodies, HELD).free
    assert not structure_of(two_bodies, [Contact(part="dart", shape="sphere", size=(0.1,))]).free
    assert not structure_of(double_pendulum, [Gravity()]).free


def test_bits_are_those_of_a_scene_with_joints(two_bodies, random_state, with_joints):
    q, v = random_state(np.random.default_rng(1), two_bodies)
    answers = []
    for simulator in (Simulator(two_bodies, HELD), with_joints(two_bodies, HELD)):
        own_q, own_v = q.copy(), v.copy()
        simulator.begin(own_q, own_v)
        simulator.project(own_q, own_v)
        simulator.advance(own_q, own_v, 1e-3, 20)
        F, G = simulator.linearise(own_q, own_v, 1e-3, np.ones(simulator.nv))
        simulator.move(own_q, own_v)
        jacobian = simulator.jacobian("stone", np.ones(3))
        numbers = [own_q, own_v, F, G, jacobian, simulator.mass_matrix(own_q)]
        answers.append([*numbers, simulator.energy(), simulator.displaced(own_q, own_v)])
    for free, jointed in zip(*answers, strict=True):
        assert np.array_equal(free, jointed)


def test_nothing_exerts_a_wrench_on_what_nothing_holds(two_bodies, random_state):
    """And no kernel is compiled to tell so; with an attachment there are the wrenches of that."""
    q, v = random_state(np.random.default_rng(2), two_bodies)
    free = Simulator(two_bodies, PUSHES)
    assert not free.wrench_array(q, v).any()
    assert not wrench_deviations(free, q, v, np.eye(24), 1e-4).any()
    held = Simulator(two_bodies, HELD)
    assert np.linalg.norm(held.wrenches(q, v)["attachment"].force) > 1.0
