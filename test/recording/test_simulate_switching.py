"""Simulated scenes in which something takes hold and lets go as scheduled."""

from itertools import pairwise

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SceneError
from physics_prior.recording import decode, open_bag
from physics_prior.recording.messages import Marker
from physics_prior.recording.replay import replay
from physics_prior.recording.simulate import EPOCH, motion, simulate
from physics_prior.scene import load_scene

SCENE = """
description: A pendulum that is caught and released.
model:
  parts:
    rod:
      mass: 1 kg
      center_of_mass: [0, 0, -0.5]
      inertia: {rod: 1 m}
      joint: {kind: revolute, axis: y, name: pivot}
effects:
  - gravity
  - attachment: {name: hand, part: rod, point: [0, 0, -1], at: here, when: WHEN}
noise: {force: 1e-2}
measurements:
  - joints: {topic: /encoder, joints: {pivot: pivot}, noise: 1 deg}
initial: {positions: {pivot: 60 deg}}
simulation: {duration: 2 s, rate: 100 Hz}
"""


@pytest.fixture
def scene_of(tmp_path):
    def load(when, **changes):
        path = tmp_path / "caught.yaml"
        text = SCENE.replace("WHEN", when)
        for old, new in changes.items():
            text = text.replace(old, new)
        path.write_text(text)
        return load_scene(path)

    return load


@pytest.mark.parametrize(
    ("when", "windows"),
    [
        ("{from: 0.5 s, until: 800 ms}", [(0.5, 0.8)]),
        (
            "[{until: 0.1235 s}, {from: 0.3, until: 0.3051 s}, {from: 1.5 s}]",
            [(0.0, 0.1235), (0.3, 0.3051), (1.5, 9.0)],
        ),
    ],
)
def test_what_is_scheduled_holds_in_its_windows_and_only_there(scene_of, when, windows):
    """Also at times between two measurements, and at time zero."""
    scene = scene_of(when)
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    moments = list(motion(scene, simulator))
    for before, moment in pairwise(moments):
        now, then = ((each.stamp - moments[0].stamp) * 1e-9 for each in (moment, before))
        held, held_before = (any(begin <= time < end for begin, end in windows) for time in (now, then))
        still = abs(moment.v[0]) < 1e-12
        assert still == held or (held_before and not held)
        if held and held_before:
            assert abs(moment.q[0] - before.q[0]) < 1e-12
    assert simulator.switches.holds[0].active == held


def test_a_window_that_cannot_be_is_refused_where_it_stands(scene_of):
    with pytest.raises(SceneError, match=r"attachment.when.*: until 1 s is not valid: give more than from, 2 s"):
        scene_of("{from: 2 s, until: 1 s}")
    with pytest.raises(SceneError, match=r"attachment.when.*'form'"):
        scene_of("{form: 2 s}")
    with pytest.raises(SceneError, match=r"attachment.when.*: '2 m' is not a quantity in s"):
        scene_of("{from: 2 m}")


def test_motions_are_read_with_units(scene_of):
    motion_of = "{sine: {amplitude: [10 cm, 0, 0], frequency: 0.5 Hz, phase: 90 deg}}"
    scene = scene_of("{from: 0.5}", **{"at: here": f"at: [0, 0, -1], motion: {motion_of}"})
    sine = scene.effects[1].motion.sine
    assert sine.amplitude == (0.1, 0.0, 0.0)
    assert sine.frequency == 0.5
    assert sine.phase == pytest.approx(np.pi / 2)
    with pytest.raises(SceneError, match="'10 s' is not a quantity in m"):
        scene_of(
            "{from: 0.5}", **{"at: here": "at: [0, 0, -1], motion: {sine: {amplitude: [10 s, 0, 0], frequency: 1}}"}
        )
    with pytest.raises(SceneError, match=r"attachment\.at: 'there' is not"):
        scene_of("{from: 0.5}", **{"at: here": "at: there"})


def test_the_truth_tells_what_holds(scene_of, tmp_path):
    """On a topic of its own, where something is scheduled; its force is zero where it does not hold."""
    simulate(scene_of("{from: 0.5 s, until: 0.8 s}"), tmp_path / "bag", duration=1.0)
    told, forces = {}, {}
    for record in open_bag(tmp_path / "bag").read(["/truth/effects", "/truth/constraint_forces/hand"]):
        message = decode(record.message_type, record.data)
        time = round((record.log_time_ns - EPOCH) * 1e-9, 3)
        if record.topic == "/truth/effects":
            (value,) = message.status[0].values
            told[time] = (value.key, value.value)
        else:
            forces[time] = message.wrench.force
    assert len(told) == 101
    for time, (name, state) in told.items():
        assert (name, state) == ("hand", "on" if 0.5 <= time < 0.8 else "off")
        assert (forces[time].z != 0.0) == (state == "on")


def test_the_output_bag_of_a_replay_tells_which_effects_were_active_when(scene_of, tmp_path):
    """Diagnostics at every change, not only at their pace of one a second; and the dot of what holds comes and goes."""
    scene = scene_of("{from: 0.5 s, until: 0.8 s}")
    simulate(scene, tmp_path / "bag", duration=1.2)
    replay(tmp_path / "bag", scene, out=tmp_path / "out")
    told, drawn = {}, {}
    for record in open_bag(tmp_path / "out").read(["/diagnostics", "/markers"]):
        message, time = decode(record.message_type, record.data), round((record.log_time_ns - EPOCH) * 1e-9, 3)
        if record.topic == "/diagnostics":
            told[time] = next(pair.value for pair in message.status[0].values if pair.key == "active effects")
        else:
            (dot,) = [marker for marker in message.markers if marker.ns == "attachments"]
            drawn[time] = dot.action == Marker.ADD
    started, *changes = told.items()
    assert started == (0.01, "gravity")  # the first estimate that is final
    assert changes[:2] == [(0.5, "gravity, hand"), (0.8, "gravity")]
    assert {names for _, names in changes[2:]} <= {"gravity"}
    assert len(drawn) > 20
    assert all(there == (0.5 <= time < 0.8) for time, there in drawn.items())
