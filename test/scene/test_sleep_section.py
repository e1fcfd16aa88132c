"""``step: {sleep: ...}``: simulations sleep, the estimator does not, and scenes in which nothing touches cannot."""

import pytest

from physics_prior.errors import SceneError
from physics_prior.estimation.estimator import Estimator
from physics_prior.scene import load_scene

SCENE = """\
description: a box that rests on the floor
model: {parts: {box: {mass: 2, inertia: {box: [0.2, 0.2, 0.2]}, joint: free}}}
effects: [gravity, {contact: {name: floor, part: box, friction: 0.5}}]
measurements: [{pose: {topic: /box, part: box, position_noise: 2 mm, orientation_noise: 0.5 deg}}]
noise: {force: 1e-3}
initial: {positions: {box: {position: [0, 0, 0.1]}}}
step:
  sleep: {duration: 50 ms}
"""


def load(path, text):
    (path / "box.yaml").write_text(text)
    return load_scene(path / "box.yaml")


def test_simulations_sleep_and_the_estimator_does_not(tmp_path):
    scene = load(tmp_path, SCENE)
    assert (scene.step.sleep.velocity, scene.step.sleep.duration) == (1e-4, 0.05)
    asleep = []
    for simulator in (scene.simulator(), Estimator(scene).simulator):
        q, v = scene.initial.q.copy(), scene.initial.v.copy()
        simulator.begin(q, v)
        simulator.advance(q, v, scene.step.size, 60)
        asleep.append(simulator.asleep)
    assert asleep == [("box",), ()]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            ", {contact: {name: floor, part: box, friction: 0.5}}",
            "",
            r"box.yaml:8: step.sleep.*where nothing may touch",
        ),
        ("50 ms", "0 s", r"box.yaml:8: step.sleep.duration"),
        ("{duration: 50 ms}", "{velocity: 1}", r"box.yaml:8: step.sleep.velocity"),
    ],
)
def test_sleep_that_cannot_be_is_refused_where_it_stands(tmp_path, old, new, message):
    with pytest.raises(SceneError, match=message):
        load(tmp_path, SCENE.replace(old, new))
