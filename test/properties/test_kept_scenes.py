"""What random scenes have found, at its smallest."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Rod
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError, SimulationError
from physics_prior.inertia import MassProperties, point_mass, rod
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


def test_a_rod_about_its_own_axis_is_refused_though_rounding_gives_it_inertia():
    """An inertia of 5e-17 kg m^2 passed: what then could not be held was called open by 0.6 m."""
    slanted = np.array([0.61340444, -0.78697413, -0.06638313])
    joints = [
        Joint("first_joint", JointKind.REVOLUTE, "world", "first", axis=slanted),
        Joint("second_joint", JointKind.REVOLUTE, "first", "second", np.array([0.0, 0.9, -1.0]), axis=DOWN),
    ]
    with pytest.raises(ModelError, match="'second_joint' moves no inertia"):
        Simulator(Tree([Part("first"), Part("second", HANGING)], joints))


def locked(speed):
    """A slider on a rail across the rod that holds it, its only place; and a state in it, with the speed that rows allow."""
    tree = Tree(
        [Part("slider", point_mass(1.0, DOWN))], [Joint("rail", JointKind.PRISMATIC, "world", "slider", axis=DOWN)]
    )
    hold = Rod(part="slider", at=(1.1, 0.0, 0.0), length=1.1)
    return Simulator(tree, [Gravity(), hold]), np.zeros(1), np.array([speed])


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_what_a_dead_centre_locks_is_put_back_in_one_step(h):
    """Projection stopped on its way back, 6e-7 m off, and lifted the slider by 1 mm in the next step."""
    simulator, q, v = locked(4.0)
    simulator.begin(q, v)
    for _ in range(10):
        simulator.advance(q, v, h)
        assert np.max(np.abs(simulator.constraint_error(q, v))) < 1.1e-11  # measured 9e-12
        assert abs(q[0]) < 1e-5  # measured 4.4e-6: the root of that


def test_what_a_step_leaves_open_is_refused_by_name():
    """Steps of 1 s at 135 rad/s: projection gave up 2 m off, and the motion went on from there."""
    hold = Rod(name="link", part="second", point=(0.0, 0.0, -1.0), at=(0.3, 0.0, -2.4), length=0.5)
    simulator = Simulator(two(HANGING, JointKind.REVOLUTE, HANGING), [Gravity(), hold])
    q, v = np.zeros(2), np.array([60.0, -90.0])
    simulator.begin(q, v)
    with pytest.raises(SimulationError, match=r"'link' is open by .* m after a step of 1 s"):
        simulator.advance(q, v, 1.0, 30)


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_what_a_dead_centre_locks_makes_no_turns(h):
    """A hanging link held by a rod across its plane: projection went 21 turns away, and the next step began there."""
    tree = Tree([Part("link", HANGING)], [Joint("pin", JointKind.REVOLUTE, "world", "link", axis=Y)])
    hold = Rod(part="link", point=(0.0, 0.0, -1.0), at=(0.0, 1.0, -1.0), length=1.0)
    simulator = Simulator(tree, [Gravity(), hold])
    q, v = np.zeros(1), np.array([5.0])
    simulator.begin(q, v)
    for _ in range(10):
        simulator.advance(q, v, h)
        assert abs(q[0]) < 1e-5  # measured 3.4e-6


def test_a_contradiction_on_an_axis_is_refused():
    """Two anchors 1 mm apart for a point on the axis: the carrier was put 1e82 m away, where they count as one."""
    joints = [
        Joint("rail", JointKind.PRISMATIC, "world", "first", axis=np.array([1.0, 0.0, 0.0])),
        Joint("pin", JointKind.REVOLUTE, "first", "second", DOWN, axis=DOWN),
    ]
    hold = {"part": "second", "point": (0.0, 0.0, -1.0), "to": "first"}
    effects = [
        Attachment(name="hold", at=(0.0, 1e-90, -2.0), **hold),
        Attachment(name="other", at=(1e-3, 0.0, -2.0), **hold),
    ]
    simulator = Simulator(Tree([Part("first", HANGING), Part("second", point_mass(1.0, Y))], joints), effects)
    with pytest.raises(SimulationError, match="'other' cannot take hold"):
        simulator.begin(np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("hung", [False, True])
@pytest.mark.parametrize("mass", [1e-6, 1e-9, 1e-12])
def test_a_light_link_held_elsewhere_leaves_a_loop_alone(mass, hung):
    """Beside two held links of 1e-9 kg a loop of 1 kg links lost 2e-4 J in a second, beside 1e-10 kg it came open."""

    def swung(light):
        links = [HANGING, HANGING, HANGING, rod(light, 1.0).transformed(np.eye(3), 0.5 * DOWN)]
        names, bases = "abcde", ["world", "a", "b", "c" if hung else "world", "d"]
        joints = [
            Joint(f"joint_{name}", JointKind.REVOLUTE, base, name, np.zeros(3) if base == "world" else DOWN, axis=Y)
            for name, base in zip(names, bases, strict=True)
        ]
        tree = Tree([Part(name, link) for name, link in zip(names, [*links, links[-1]], strict=True)], joints)
        q, v = np.array([0.3, -0.5, 0.4, 0.2, 0.7]), np.zeros(5)
        posed, holds = Simulator(tree), []
        posed.move(q, v)
        for name in "ce":
            x, R = posed.pose(name)
            holds.append(Attachment(name=f"hold_{name}", part=name, point=(0.0, 0.0, -1.0), at=tuple(x + R @ DOWN)))
        simulator = Simulator(tree, [Gravity(), *holds])
        simulator.begin(q, v)
        simulator.advance(q, v, 1e-3, 1000)
        return q[:3], simulator.rank

    (expected, _), (found, rank) = swung(1e-14), swung(mass)
    assert rank == 4
    # hung where the loop is held, they weigh on no link of it
    assert np.max(np.abs(found - expected)) < 1e-12  # measured 6e-15


@pytest.mark.parametrize("lever", [(3.0, 0.0, 0.0), (0.3, 0.2, 0.1), (0.0, 0.0, -1.0)])
def test_a_body_that_turns_far_more_easily_than_it_comes_along_is_refused(lever):
    """1 kg of 1e-12 kg m^2, held off its centre: "1.21 m stay" was said of points that were together, or a step came open."""
    body = MassProperties(1.0, np.zeros(3), 1e-12 * np.diag([1.0, 0.9, 1.2]))
    tree = Tree([Part("body", body)], [Joint("float", JointKind.FREE, "world", "body")])
    simulator = Simulator(tree, [Gravity(), Attachment(name="hold", part="body", point=lever, at=lever)])
    with pytest.raises(SimulationError, match=r"'hold' cannot take hold: the masses .* too unlike"):
        simulator.begin(tree.neutral(), np.zeros(6))


@pytest.mark.parametrize(("ratio", "sound"), [(1e-5, True), (1e-9, False), (1e-12, False)])
def test_what_is_tied_to_a_light_link_that_is_held_is_refused_where_rounding_parts_them(ratio, sound):
    """No pair of rows alone shows it: the tie gives way as its light link does, which is held by the pin."""
    light = rod(ratio, 1.0).transformed(np.eye(3), 0.5 * DOWN)
    joints = [
        Joint("heavy_joint", JointKind.REVOLUTE, "world", "heavy", axis=Y),
        Joint("light_joint", JointKind.REVOLUTE, "world", "light", np.array([1.0, 0.0, 0.0]), axis=Y),
    ]
    tree = Tree([Part("heavy", HANGING), Part("light", light)], joints)
    below = {"point": (0.0, 0.0, -1.0)}
    holds = [
        Attachment(name="tie", part="heavy", to="light", at=(-1.0, 0.0, -1.0), **below),
        Attachment(name="pin", part="light", at=(1.0, 0.0, -1.0), **below),
    ]
    simulator, q, v = Simulator(tree, [Gravity(), *holds]), np.zeros(2), np.zeros(2)
    if not sound:
        with pytest.raises(SimulationError, match=r"'tie' cannot take hold: the masses .* too unlike"):
            simulator.begin(q, v)
        return
    simulator.begin(q, v)
    simulator.advance(q, v, 1e-3, 100)
    assert np.max(np.abs(simulator.constraint_error(q, v))) < 1e-12  # measured 0
