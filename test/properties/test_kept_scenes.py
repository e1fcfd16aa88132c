"""What random scenes have found, at its smallest."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Rod
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError, SimulationError
from physics_prior.inertia import point_mass, rod
from physics_prior.model import Joint, JointKind, Part, Tree

DOWN = np.array([0.0, 0.0, -1.0])
Y = np.array([0.0, 1.0, 0.0])
HANGING = rod(1.0, 1.0).transformed(np.eye(3), 0.5 * DOWN)


def two(first, first_kind, second, second_kind=JointKind.REVOLUTE, axis=Y):
    """A part on the world and a part 1 m below its origin."""
    joints = [
        Joint("first_joint", first_kind, "world", "first", axis=axis),
        Joint("second_joint", second_kind, "first", "second", DOWN, axis=axis),
    ]
    return Tree([Part("first", first), Part("second", second)], joints)


def test_inertia_that_is_rounding_is_none():
    """All mass on one line: the joints about it had inertias of -2e-17 to 8e-17 kg m^2, and no eigenvalues."""
    tree = two(point_mass(1.0, DOWN), JointKind.FREE, HANGING, axis=np.array([0.0, 0.0, 1.0]))
    with pytest.raises(ModelError, match="moves no inertia"):
        Simulator(tree)


def test_a_posture_without_inertia_is_refused_where_parts_are_put_together():
    """A thin rod that hangs straight from a ball joint, of which an attachment asks what it cannot."""
    tree = two(HANGING, JointKind.SPHERICAL, HANGING)
    simulator = Simulator(tree, [Gravity(), Attachment(part="second", point=(0.0, 0.0, -1.0), at=(0.0, 0.1, -1.9))])
    with pytest.raises(SimulationError, match=r"'attachment' cannot take hold|'first_joint/z' moves no inertia"):
        simulator.begin(tree.neutral(), np.zeros(tree.nv))


@pytest.mark.parametrize("length", [0.125, 0.25])
@pytest.mark.parametrize("turned", [0.0, 1e-9, 1e-6, 1e-3])
def test_a_rod_at_its_dead_centre_lets_a_chain_swing(length, turned):
    """The rod in line with the arm that it holds: its row was rounding, and a step later the arm was 1 m away."""
    tree = two(HANGING, JointKind.SPHERICAL, HANGING)
    hold = Rod(part="first", point=(0.0, 0.0, -1.0), at=(0.0, 0.0, -1.0 + length), length=length)
    simulator = Simulator(tree, [Gravity(), hold])
    q, v = np.array([np.cos(0.5 * turned), 0.0, np.sin(0.5 * turned), 0.0, 0.5 * np.pi]), np.zeros(4)
    simulator.begin(q, v)
    simulator.move(q, v)
    start = simulator.energy()
    for _ in range(1000):
        simulator.advance(q, v, 1e-3)
        assert np.max(np.abs(simulator.constraint_error(q, v))) < 1e-11  # measured 2e-13
    simulator.move(q, v)
    assert simulator.energy() == pytest.approx(start, abs=1e-7)  # measured 1e-9
