"""Effects by themselves: what they refuse, contribute and explain, and that derivatives are those of their force."""

import numpy as np
import pytest
from pydantic import ValidationError

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import REGISTRY
from physics_prior.effects.attachment import Attachment, Hinge, Rod, Weld
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.soft_limit import SoftLimit
from physics_prior.effects.spring import Spring
from physics_prior.errors import ModelError
from physics_prior.inertia import box
from physics_prior.model import Joint, JointKind, Part, Tree


@pytest.fixture(scope="module")
def tree():
    body = box(2.0, (0.1, 0.2, 0.3))
    return Tree(
        [Part("base", body), Part("arm", body), Part("tip", body), Part("cap", body)],
        [
            Joint("flight", JointKind.FREE, "world", "base"),
            Joint(
                "elbow", JointKind.REVOLUTE, "base", "arm", np.array([0.3, 0.0, 0.0]), axis=np.array([0.0, 1.0, 0.0])
            ),
            Joint("wrist", JointKind.SPHERICAL, "arm", "tip", np.array([0.3, 0.0, 0.0])),
            Joint("glue", JointKind.FIXED, "tip", "cap", np.array([0.1, 0.0, 0.0])),
        ],
    )


def test_registry_names_every_effect_by_its_kind():
    assert all(effect.kind == kind for kind, effect in REGISTRY.items())
    assert {"gravity", "joint_damping", "joint_spring", "spring", "drag", "attachment", "rod", "hinge", "weld"} <= set(
        REGISTRY
    )


@pytest.mark.parametrize(
    ("effect", "rows"),
    [
        (Gravity(), 0),
        (JointDamping(coefficients={"elbow": 1.0}), 0),
        (JointSpring(stiffness={"elbow": 1.0, "wrist": 2.0}, rest={"elbow": 0.3}), 0),
        (Spring(part="tip", stiffness=10.0, damping=1.0), 0),
        (Drag(part="tip", quadratic=0.1, wind=(1, 0, 0)), 0),
        (SoftLimit(upper={"elbow": 1.0}, range={"elbow": 0.2}, stiffness={"elbow": 3.0}), 0),
        (Attachment(part="tip"), 3),
        (Rod(part="tip", length=0.5), 1),
        (Hinge(part="tip", axis=(0, 0, 2), to_axis=(0, 0, 1)), 5),
        (Weld(part="tip", to="base"), 6),
    ],
)
def test_effects_explain_themselves_and_count_their_rows(tree, effect, rows):
    effect.check(tree)
    assert len(effect.explain(tree)) > 10
    assert effect.label == effect.kind
    pairs = effect.point_pairs(tree)
    assert sum(1 if pair.length is not None else len(pair.directions) for pair in pairs) == rows
    assert Simulator(tree, [effect]).rows == rows


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (Attachment(part="foot"), "part 'foot' is unknown: known parts are .*'tip'"),
        (Attachment(part="tip", to="hand"), "part 'hand' is unknown"),
        (Weld(part="tip", to="cap"), "'tip' and 'cap' are one rigid body"),
        (JointDamping(coefficients={"flight": 1.0}), "joint 'flight' is free"),
        (JointDamping(coefficients={"glue": 1.0}), "joint 'glue' is unknown or fixed"),
        (JointSpring(stiffness={"flight": 1.0}), "joint 'flight' is free: a joint spring acts in"),
        (JointSpring(stiffness={"knee": 1.0}), "joint 'knee' is unknown or fixed: moving joints are"),
        (JointSpring(stiffness={"elbow": 1.0}, rest={"wrist": (1, 0, 0, 0)}), "joint 'wrist' has no stiffness"),
        (JointSpring(stiffness={"elbow": 1.0}, damping={"wrist": 1.0}), "joint 'wrist' has no stiffness"),
        (
            JointSpring(stiffness={"wrist": 1.0}, rest={"wrist": 0.5}),
            "joint 'wrist' is spherical: its rest is a quatern",
        ),
        (
            JointSpring(stiffness={"elbow": 1.0}, rest={"elbow": (1, 0, 0, 0)}),
            "'elbow' is revolute: its rest is one number",
        ),
        (JointSpring(stiffness={"wrist": 1.0}, rest={"wrist": (0, 0, 0, 0)}), "quaternion .* is no rotation"),
        (Spring(part="foot", stiffness=1.0), "part 'foot' is unknown: known parts are .*'tip'"),
        (Spring(part="tip", to="cap", stiffness=1.0), "'tip' and 'cap' are one rigid body"),
        (Drag(part="foot", linear=1.0), "part 'foot' is unknown"),
        (Drag(part="world", linear=1.0), "'world' does not move"),
        (Drag(part="tip"), "drag without a coefficient does nothing: give 'linear'"),
    ],
)
def test_effects_that_do_not_fit_are_refused(tree, effect, message):
    with pytest.raises(ModelError, match=message):
        Simulator(tree, [effect])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Rod(part="tip", length=0.0),
        lambda: Rod(part="tip", length=1.0, at="here"),
        lambda: Attachment(part="tip", at="there"),
        lambda: Weld(part="tip", at=None),
        lambda: Attachment(part="tip", when={"from": 1.0}, initially="on"),
        lambda: Attachment(part="tip", when=[{"from": -1.0}]),
        lambda: Attachment(part="tip", when=[{"until": 1.0}, {"from": 2.0, "until": 2.0}]),
        lambda: Attachment(part="tip", initially="later"),
        lambda: Rod(part="tip", length=1.0, lenght=2.0),
        lambda: JointDamping(coefficients={"elbow": -1.0}),
        lambda: JointDamping(coefficients={}),
        lambda: JointSpring(stiffness={"elbow": -1.0}),
        lambda: JointSpring(stiffness={"elbow": 1.0}, damping={"elbow": -1.0}),
        lambda: JointSpring(stiffness={"elbow": 1.0}, rest={"elbow": float("nan")}),
        lambda: JointSpring(stiffness={"elbow": 1.0}, rest={"elbow": (1.0, 0.0)}),
        lambda: Spring(part="tip", stiffness=-1.0),
        lambda: Spring(part="tip", stiffness=1.0, at=(0.0, float("nan"), 0.0)),
        lambda: Spring(part="tip", stiffness=1.0, rest_length=-0.1),
        lambda: Spring(part="tip", stiffness=1.0, damping=float("inf")),
        lambda: Spring(part="tip"),
        lambda: Drag(part="tip", linear=-0.1),
        lambda: Drag(part="tip", linear=0.1, wind=(float("nan"), 0.0, 0.0)),
        lambda: Attachment(),
    ],
)
def test_parameters_out_of_range_are_refused(make):
    with pytest.raises(ValidationError):
        make()


def test_gravities_add_up(tree):
    fields = [Gravity(), Gravity(name="tide", acceleration=(0.1, 0.0, 0.2))]
    q, v = tree.neutral(), np.zeros(tree.nv)
    assert np.allclose(Simulator(tree, fields).acceleration(q, v)[:3], [0.1, 0.0, 0.2 - 9.80665], atol=1e-13)


def test_damping_resists_each_named_joint_only(tree):
    rng = np.random.default_rng(0)
    simulator = Simulator(tree, [JointDamping(coefficients={"elbow": 2.0, "wrist": 0.5})])
    v = rng.normal(size=tree.nv)
    simulator.acceleration(tree.neutral(), v)
    assert np.allclose(simulator.effort, -np.array([0, 0, 0, 0, 0, 0, 2.0, 0.5, 0.5, 0.5]) * v, atol=0.0)


def test_damping_takes_energy_and_no_momentum(tree):
    rng = np.random.default_rng(1)
    simulator = Simulator(tree, [JointDamping(coefficients={"elbow": 2.0, "wrist": 0.5})])
    q, v = tree.neutral(), rng.normal(size=tree.nv)

    def measured():
        simulator.move(q, v)
        return simulator.energy(), simulator.mass_matrix(q)[:3] @ v

    energy, momentum = measured()
    for _ in range(5):
        simulator.advance(q, v, 1e-3, 100)
        less, same = measured()
        assert less < energy
        assert np.allclose(same, momentum, atol=1e-10)  # measured 2e-12
        energy = less


@pytest.mark.parametrize(
    "effect",
    [
        Hinge(part="tip", point=(0.1, 0, 0), at=(0.7, 0, 0), axis=(0, 1, 1), to_axis=(0, 1, 1)),
        Weld(part="tip", at=(0.6, 0, 0)),
    ],
)
def test_hinge_and_weld_leave_what_they_should(tree, effect):
    """After a second of a push: a hinge has turned about its axis only, a weld not at all."""
    simulator = Simulator(tree, [Gravity(acceleration=(0.0, 0.0, 0.0)), effect])
    q, v = tree.neutral(), np.random.default_rng(2).normal(size=tree.nv)
    simulator.project(q, v)
    simulator.advance(q, v, 1e-3, 1000)
    simulator.move(q, v)
    position, R = simulator.pose("tip")
    if isinstance(effect, Weld):
        assert np.allclose(position, effect.at, atol=1e-11)
        assert np.allclose(R, np.eye(3), atol=1e-10)
    else:
        axis = np.array(effect.axis) / np.sqrt(2.0)
        assert np.allclose(position + R @ effect.point, effect.at, atol=1e-11)
        assert np.allclose(R @ axis, axis, atol=1e-10)
        assert rotations.log(rotations.quaternion_from_matrix(R)) @ axis != pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("when", "on", "switches"),
    [
        ((), (0.0, 1.0, 5.0), ()),
        ({"from": 1.0, "until": 2.0}, (1.0, 1.999999999), (1.0, 2.0)),
        ({"until": 2.0}, (0.0, 1.5), (2.0,)),
        (
            [{"from": 0.1, "until": 0.3}, {"from": 0.3, "until": 0.7}, {"from": 3.0}],
            (0.1, 0.3, 0.6, 4.0),
            (0.1, 0.7, 3.0),
        ),
    ],
)
def test_windows_of_time_begin_at_once_and_end_before_their_end(when, on, switches):
    """To the nanosecond; windows that touch are one."""
    effect = Attachment(part="tip", when=when)
    assert effect.switch_times() == switches
    for time in (0.0, 0.1, 0.3, 0.6, 0.7, 1.0, 1.5, 1.999999999, 2.0, 4.0, 5.0):
        windows = [when] if isinstance(when, dict) else when
        inside = any(window.get("from", 0.0) <= time < window.get("until", np.inf) for window in windows)
        assert effect.active_at(time) == (inside or not when)
    assert all(effect.active_at(time) for time in on)
