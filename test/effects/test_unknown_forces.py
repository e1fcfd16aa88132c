"""Muscles and ground reactions by themselves: what they refuse, and that what the filter is told of them is how they act."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import REGISTRY
from physics_prior.effects.contact import Contact
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.ground_reaction import GroundReaction
from physics_prior.effects.muscle import Muscle
from physics_prior.errors import ModelError, SceneError
from physics_prior.model.human import Human
from physics_prior.scene import build_scene
from physics_prior.scene.yaml_file import parse_yaml

DIFFERENCE = 1e-6


def foot(side, **fields):
    strength = {"vertical": 600.0, "horizontal": 120.0, "moment": 48.0}
    return GroundReaction(**{"name": f"{side}_sole", "part": f"{side}_sole"} | strength | fields)


@pytest.fixture(scope="module")
def tree():
    return Human(60.0, 1.7, "female").tree()


@pytest.fixture(scope="module")
def simulator(tree):
    muscle = Muscle(strength={"left_hip": (100.0, 50.0, 20.0), "left_knee": 60.0, "neck": 10.0})
    return Simulator(tree, [Gravity(), muscle, foot("left"), foot("right")])


@pytest.fixture
def somewhere(simulator):
    """A posture, its velocity, and forces of standing and walking."""
    rng = np.random.default_rng(4)
    q = simulator.tree.integrate(simulator.tree.neutral(), 0.3 * rng.normal(size=simulator.nv))
    force = rng.normal(size=simulator.unknown.count) * simulator.unknown.deviation
    return q, rng.normal(size=simulator.nv), force


def test_forces_are_laid_out_effect_by_effect(simulator):
    unknown = simulator.unknown
    assert unknown.count == 3 + 1 + 3 + 12
    assert [each.name for each in unknown.feet] == ["left_sole", "right_sole"]
    assert simulator.wrench_names[-2:] == ["left_sole", "right_sole"]
    names = [simulator.tree.freedom_names[k] for k in unknown.freedoms]
    assert names == sorted(names, key=simulator.tree.freedom_names.index)
    assert unknown.deviation[: len(names)].tolist()[names.index("left_knee")] == 60.0


def test_they_act_as_their_columns_say(simulator, somewhere):
    """Accelerations under f are those under the generalized forces D f, and wrenches are f itself."""
    q, v, force = somewhere
    simulator.unknown.force = 0.0 * force
    still = simulator.acceleration(q, v)
    simulator.move(q, v)
    D = simulator.unknown.columns(simulator)
    pushed = simulator.acceleration(q, v, D @ force)
    simulator.unknown.force = force
    np.testing.assert_allclose(simulator.acceleration(q, v), pushed, rtol=1e-9, atol=1e-8)
    assert np.max(np.abs(pushed - still)) > 10.0
    wrenches = simulator.wrenches(q, v)
    for each in simulator.unknown.feet:
        np.testing.assert_array_equal(wrenches[each.name].force, force[each.span][:3])
        np.testing.assert_array_equal(wrenches[each.name].moment, force[each.span][3:])
    assert simulator.effort[simulator.unknown.freedoms] == pytest.approx(force[simulator.unknown.torques])


def test_derivatives_are_differences(simulator, somewhere):
    """Of accelerations under forces that stay as they are. Measured: 1e-8 of the largest."""
    q, v, force = somewhere
    simulator.unknown.force = force
    by_q, _ = simulator.acceleration_derivatives(q, v)
    for k, one in enumerate(np.eye(simulator.nv)):
        ahead, behind = (simulator.displaced(q, sign * DIFFERENCE * one) for sign in (1.0, -1.0))
        slope = (simulator.acceleration(ahead, v) - simulator.acceleration(behind, v)) / (2.0 * DIFFERENCE)
        np.testing.assert_allclose(by_q[:, k], slope, atol=1e-6 * np.max(np.abs(by_q)))


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ([Muscle(strength={"pelvis": 1.0})], "joint 'pelvis' is free: muscle acts in"),
        ([Muscle(strength={"left_knee": (1.0, 1.0, 1.0)})], "joint 'left_knee' has one axis: give it one strength"),
        (
            [Muscle(strength={"neck": 1.0}), Muscle(name="m", strength={"neck": 1.0})],
            "'m' and 'muscle' both move 'neck",
        ),
        ([foot("left"), foot("left", name="again")], "'left_sole' is pushed by the ground twice"),
        ([foot("left", name="left_knee")], "'left_knee' is a joint's name"),
        ([foot("left", part="left_foot")], "'left_foot' has no box for a sole: give the 'size'"),
        ([foot("left", part="world")], "'world' does not move"),
        ([foot("left", touch_speed=2.0)], "'touch_speed' 2 is above 'release_speed' 1.2"),
        ([foot("left", size=(0.2, 0.0))], r"'size' \[0.2, 0.0\] is not that of a sole"),
        ([foot("left"), Contact(part="right_sole")], "'contact' holds or touches something, which no scene with"),
    ],
)
def test_what_does_not_fit_is_refused(tree, effects, message):
    with pytest.raises(ModelError, match=message):
        Simulator(tree, effects)


def test_a_scene_that_mixes_them_names_the_line(tmp_path):
    text = """
description: A person who stands twice.
model: {human: {mass: 60 kg, height: 170 cm, sex: female}}
effects:
  - gravity
  - contact: {part: right_sole}
  - ground_reaction: {name: left_sole, part: left_sole, vertical: 600 N, horizontal: 120 N, moment: 48 N m}
measurements: []
"""
    path = tmp_path / "twice.yaml"
    path.write_text(text)
    with pytest.raises(SceneError, match=r"twice.yaml:7.*'contact' holds or touches something"):
        build_scene(parse_yaml(path, text))


def test_they_explain_themselves(tree):
    assert "six states" in foot("left").explain(tree)
    assert Muscle(strength={"neck": 1.0, "left_knee": 2.0}).explain(tree).startswith("4 unknown torques in 2 joints")
    assert {"muscle", "ground_reaction"} <= set(REGISTRY)
