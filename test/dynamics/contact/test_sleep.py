"""Islands at rest sleep: what is awake moves as ever, what is reached or pushed wakes, and contact is not asked for meanwhile."""

import numpy as np
import pytest

from physics_prior import inertia
from physics_prior.dynamics.contact.memory import Sleep
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.contact import Contact
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError
from physics_prior.model import Joint, JointKind, Part, Shape, Tree

H, SLEEP = 1e-3, Sleep(velocity=1e-4, duration=0.1)
FAR = -5.0  # m: where the second box rests until it is thrown


@pytest.fixture(scope="module")
def simulators():
    """Two boxes on the ground that may meet, and a pendulum beside them: with sleep, and without."""
    size = np.full(3, 0.2)
    parts = [Part(name, inertia.box(1.0, size), Shape("box", size)) for name in ("near", "far")]
    parts.append(Part("bob", inertia.point_mass(1.0, (0.0, 0.0, -1.0))))
    joints = [Joint(f"{name}_joint", JointKind.FREE, "world", name) for name in ("near", "far")]
    joints.append(
        Joint("pivot", JointKind.REVOLUTE, "world", "bob", np.array([0, 3.0, 2.0]), axis=np.array([0, 1.0, 0]))
    )
    boxes = [Contact(name=name, part=name, friction=0.5) for name in ("near", "far")]
    effects = [Gravity(), *boxes, Contact(name="meeting", part="near", to="far", friction=0.3)]
    tree = Tree(parts, joints)
    return [Simulator(tree, effects, interval=H, sleep=sleep) for sleep in (SLEEP, None)]


@pytest.fixture
def start(simulators):
    """Both boxes at rest, the pendulum at 60 degrees; in both simulators."""
    q = np.array([0, 0, 0.1, 1, 0, 0, 0, FAR, 0, 0.1, 1, 0, 0, 0, np.pi / 3], dtype=float)
    for simulator in simulators:
        simulator.begin(q, np.zeros(simulator.nv))
    return q, np.zeros(13)


def asked(simulator):
    """How many points of contact the last step had, and rows with them."""
    return simulator.memory.contact_part[5:7].astype(int).tolist()


def test_boxes_at_rest_sleep_beside_a_pendulum_that_swings_as_it_would_alone(simulators, start):
    sleeping, always = simulators
    (q, v), (p, w) = (start[0].copy(), start[1].copy()), start
    sleeping.advance(q, v, H, 99)
    assert sleeping.asleep == ()
    sleeping.advance(q, v, H, 1901)
    always.advance(p, w, H, 2000)
    assert (sleeping.asleep, always.asleep) == (("near", "far"), ())
    assert np.max(np.abs(q[:14] - p[:14])) < 2.0 * SLEEP.velocity  # the promise, over 2 s; measured 9e-17
    # kept awake, the boxes have the pendulum stepped to order one beside them; asleep, they leave it to rk4
    alone = Simulator(Tree(sleeping.tree.parts[2:], sleeping.tree.joints[2:]), [Gravity()])
    angle, rate = np.array([np.pi / 3]), np.zeros(1)
    alone.advance(angle, rate, H, 2000)
    assert abs(q[14] - angle[0]) < 4e-4  # measured 2.0e-4: of the first 0.1 s, when the boxes were awake
    assert abs(p[14] - angle[0]) < 1e-3  # measured 6.4e-4


def test_a_box_sleeps_until_another_one_hits_it_and_both_end_where_they_would(simulators, start):
    ends = []
    for simulator in simulators:
        q, v = start[0].copy(), start[1].copy()
        simulator.advance(q, v, H, 200)
        q[7], v[6] = -1.0, 4.0  # thrown from outside, 0.8 m before the other
        simulator.advance(q, v, H, 200)
        assert np.max(np.abs(v[:3])) < 1e-13
        if simulator.asleep:
            assert simulator.asleep == ("near",)
            while simulator.asleep:
                assert q[7] < -0.2  # not yet there
                simulator.advance(q, v, H)
            assert q[7] > -0.21
        simulator.advance(q, v, H, round((1.2 - simulator.time) / H))
        ends.append((q, v))
    (q, _), (p, _) = ends
    assert simulators[0].asleep == ("near", "far")
    assert q[0] > 0.2  # pushed on
    assert np.max(np.abs(q[:14] - p[:14])) < 1e-12  # measured 2e-14


def test_what_sleeps_is_not_asked_for_contact(simulators, start):
    for simulator, points in zip(simulators, (4, 8), strict=True):
        q, v = start[0].copy(), start[1].copy()
        simulator.advance(q, v, H, 150)
        v[6] = 1.0  # one slides far from the other: its corners alone are asked for
        simulator.advance(q, v, H, 10)
        assert asked(simulator) == [points, 3 * points]


def test_all_asleep_only_time_goes_on_and_forces_are_told_as_ever(simulators, start):
    sleeping, _ = simulators
    q, v = start
    q[14] = 0.0
    sleeping.advance(q, v, H, 150)
    assert sleeping.asleep == ("near", "far", "bob")
    before = q.copy()
    sleeping.advance(q, v, H, 50)
    assert np.array_equal(q, before)
    assert not v.any()
    assert sleeping.time == pytest.approx(0.2, abs=1e-12)
    assert sleeping.wrenches(q, v)["near"].force == pytest.approx([0.0, 0.0, 9.80665], abs=1e-9)


@pytest.mark.parametrize("touch", ["force", "place", "speed"])
def test_what_is_touched_from_outside_wakes_and_nothing_else(simulators, start, touch):
    sleeping, _ = simulators
    q, v = start
    q[14], tau = 0.0, np.zeros(13)
    sleeping.advance(q, v, H, 150)
    if touch == "force":
        tau[0] = 8.0  # N, more than friction holds
    elif touch == "place":
        q[2] += 0.01
    else:
        v[0] = 0.5
    sleeping.advance(q, v, H, 1, tau)
    assert sleeping.asleep == ("far", "bob")
    expected = {"force": (8.0 - 0.5 * 9.80665) * H, "place": 0.0, "speed": 0.5 - 0.5 * 9.80665 * H}[touch]
    assert v[0] == pytest.approx(expected, abs=1e-12)


def test_the_same_motion_has_the_same_bits(simulators, start):
    sleeping, _ = simulators
    ends = []
    for _ in range(2):
        q, v = start[0].copy(), start[1].copy()
        sleeping.begin(q, v)
        sleeping.advance(q, v, H, 700)
        assert not sleeping.candidates["asleep"].any()  # all but the step itself sees all that touches
        ends.append(q.tobytes() + v.tobytes())
    assert ends[0] == ends[1]


def test_sleep_needs_something_that_touches(simulators):
    with pytest.raises(ModelError, match="'sleep' is not valid where nothing may touch"):
        Simulator(simulators[0].tree, [Gravity()], sleep=SLEEP)
