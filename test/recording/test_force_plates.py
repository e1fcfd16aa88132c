"""A recording's force plates, from the bag to the figures: a box on a plane against its true contact force."""

import json
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from physics_prior import cli
from physics_prior.errors import RecordingError
from physics_prior.estimation.force_score import ForceScore
from physics_prior.interface.geometry import array_of, header_of, wrench_of
from physics_prior.recording.cdr import decode
from physics_prior.recording.messages import WrenchStamped
from physics_prior.recording.reader import open_bag
from physics_prior.recording.references import read_references
from physics_prior.recording.replay import replay
from physics_prior.recording.simulate import simulate
from physics_prior.recording.truth import Truth
from physics_prior.recording.writer import BagWriter
from physics_prior.scene import load_scene

TRUTH = "/truth/constraint_forces/floor"

SLIDING_BOX = """
description: a box that slides to rest on the floor
model: {parts: {box: {mass: 2, inertia: {box: [0.2, 0.2, 0.1]}, joint: free}}}
effects: [gravity, {contact: {name: floor, part: box, friction: 0.3}}]
measurements: [{pose: {topic: /box, part: box, position_noise: 0.01 mm, orientation_noise: 0.001 deg}}]
noise: {force: 1e-6, velocity: 2}
initial: {positions: {box: {position: [0.3, -0.2, 0.05]}}, velocities: {box: {linear: [0, 1.5, 0]}}}
step: {size: 2 ms}
simulation: {duration: 0.8 s, rate: 50 Hz}
"""


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """The scene, and a bag of it that has a force plate under the box."""
    folder = tmp_path_factory.mktemp("plates")
    path = folder / "box.yaml"
    path.write_text(SLIDING_BOX)
    scene = load_scene(path)
    simulate(scene, folder / "plain", seed=0)
    reader = open_bag(folder / "plain")
    poses = [array_of(decode(r.message_type, r.data).pose.position) for r in reader.read(["/box"])]
    with BagWriter(folder / "bag") as writer:
        for topic in ("/box", TRUTH):
            writer.add_topic(topic, type(decode(*next(iter(reader.read([topic])))[2:])))
        writer.add_topic("/plate", WrenchStamped)
        writer.add_topic("/astray", WrenchStamped)
        at = iter(poses)
        for record in reader.read(["/box", TRUTH]):
            message = decode(record.message_type, record.data)
            writer.write(record.topic, message, record.log_time_ns)
            if record.topic == TRUTH:
                force = array_of(message.wrench.force)
                place = next(at) * [1, 1, 0]
                wrench = wrench_of(force, np.cross(place, force))
                header = message.header
                writer.write("/plate", WrenchStamped(header, wrench), record.log_time_ns)
                astray = header_of(record.log_time_ns, "elsewhere")
                writer.write("/astray", WrenchStamped(astray, wrench), record.log_time_ns)
    return path, scene, folder / "bag"


def test_the_true_states_forces_are_those_of_the_plate(box):
    _, scene, bag = box
    simulator, reader = scene.simulator(), open_bag(bag.parent / "plain")
    (truth, plates), tells = read_references(reader, [TRUTH], scene), Truth(scene, scene.simulator())
    assert truth is None
    score = ForceScore(scene, simulator, plates)
    for stamp, records in groupby(reader.read(tells.topics), lambda record: record.log_time_ns):
        q, v = tells.state({each.topic: decode(each.message_type, each.data) for each in records})
        score.add(stamp, q, v, simulator.wrenches(q, v))
    for comparison in score.comparisons().values():
        for figures in comparison.figures(score.weight).values():
            assert figures["percent_weight"] < 1e-6  # 1e-9: a quaternion from a message is one to the last bit but one
            assert figures["seconds"] == pytest.approx(0.82)


def test_a_box_on_a_plane_is_scored_against_its_true_contact_force(box):
    _, scene, bag = box
    result = replay(bag, scene, references=[TRUTH])
    assert set(result.forces) == {"total", TRUTH}
    own = result.forces[TRUTH]
    np.testing.assert_array_equal(result.forces["total"].estimated, own.estimated)
    assert np.median(np.linalg.norm(own.estimated - own.measured, axis=1)) < 0.01  # 0.003 N, but where it comes to rest
    figures = result.score["forces"][TRUTH]
    assert figures["anterior_posterior"]["r"] > 0.9  # 0.927
    assert figures["anterior_posterior"]["percent_weight"] < 8.0  # 5.9
    assert figures["vertical"]["r"] is None  # a weight that does not change
    assert figures["vertical"]["seconds"] == pytest.approx(0.6, abs=0.03)


def test_a_plate_finds_the_box_by_its_centre_of_pressure(box):
    _, scene, bag = box
    named, found = (replay(bag, scene, references=[topic]).score["forces"] for topic in (TRUTH, "/plate"))
    assert found["/plate"] == named[TRUTH]
    assert found["total"] == named["total"]


def test_json_and_report_tell_each_component(box, tmp_path, capsys):
    path, _, bag = box
    words = ["replay", str(bag), "--scene", str(path), "--smooth", "--reference", "/plate"]
    assert cli.main([*words, "--json", "-"]) == 0
    forces = json.loads(capsys.readouterr().out)["reference"]["forces"]
    assert list(forces) == ["total", "/plate"]
    for components in forces.values():
        assert list(components) == ["vertical", "anterior_posterior", "medio_lateral"]
        for figures in components.values():
            assert {"rrmse_percent", "percent_weight", "r"} <= set(figures)
    assert cli.main(words) == 0
    out = capsys.readouterr().out
    for word in ("forces of the ground", "anterior-posterior", "/plate", "% of weight"):
        assert word in out


@pytest.mark.parametrize(
    ("references", "sentence"),
    [
        (["/astray"], "frame 'elsewhere', not in the scene's, 'world'"),
        (["/plate", "/plate"], "given twice"),
        (["/box"], "valid is sensor_msgs/msg/JointState or geometry_msgs/msg/WrenchStamped"),
        (["/nowhere"], "has no topic /nowhere"),
    ],
)
def test_what_is_no_reference_is_one_sentence(box, references, sentence):
    _, scene, bag = box
    with pytest.raises(RecordingError, match=sentence):
        replay(bag, scene, references=references)


def test_a_scene_that_stands_on_nothing_has_nothing_to_compare(box):
    _, scene, bag = box
    floating = replace(scene, effects=scene.effects[:1])
    with pytest.raises(RecordingError, match=r"nothing of scene 'box' stands on the ground: /plate needs an effect"):
        replay(bag, floating, references=["/plate"])
