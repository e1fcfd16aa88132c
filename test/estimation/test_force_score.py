"""Forces of the ground against plates: figures by hand, axes by the way that is walked, plates by who stands on them."""

import numpy as np
import pytest

from physics_prior.dynamics.wrench import Wrench
from physics_prior.errors import RecordingError
from physics_prior.estimation.force_score import Comparison, ForceScore, Plate
from physics_prior.scene import load_scene

G = 9.80665
PERIOD = 10_000_000  # ns
EPOCH = 1_700_000_000_000_000_000  # ns

WALKER = """
description: a trunk that is carried over the ground by two feet
model:
  parts:
    trunk: {mass: 8, inertia: {box: [0.2, 0.3, 0.5]}, joint: free}
    left: {mass: 1, inertia: {box: [0.2, 0.1, 0.1]}, joint: {kind: revolute, axis: y, parent: trunk, position: [0, 0.2, -0.9]}}
    right: {mass: 1, inertia: {box: [0.2, 0.1, 0.1]}, joint: {kind: revolute, axis: y, parent: trunk, position: [0, -0.2, -0.9]}}
effects:
  - gravity
  - contact: {name: left_sole, part: left, friction: 1, velocity: VELOCITY}
  - contact: {name: right_sole, part: right, friction: 1, velocity: VELOCITY}
measurements: []
"""


def walker(tmp_path, velocity=(0.0, 0.0, 0.0), text=WALKER):
    path = tmp_path / "walker.yaml"
    path.write_text(text.replace("VELOCITY", str(list(velocity))))
    scene = load_scene(path)
    return scene, scene.simulator()


def scored(scene, simulator, plates, left, right, speed=(0.0, 0.0, 0.0)):
    """The score of a trunk that moves at a steady speed on given forces (k, 3) of both feet."""
    score = ForceScore(scene, simulator, plates)
    q, v = simulator.tree.neutral(), np.zeros(simulator.nv)
    for k, forces in enumerate(zip(left, right, strict=True)):
        q[:3] = np.array(speed) * k * 1e-2 + [0.0, 0.0, 0.95]
        wrenches = dict(zip(("left_sole", "right_sole"), (Wrench(f, 0.0 * f, 0.0 * f) for f in forces), strict=True))
        score.add(EPOCH + k * PERIOD, q, v, wrenches)
    return score


def plate(topic, forces, at=None, force=None):
    """A plate of forces (k, 3), pressed at points (k, 3); without points its moment is unknown."""
    moments = np.full_like(forces, np.nan) if at is None else np.cross(at, forces)
    stamps = EPOCH + PERIOD * np.arange(len(forces))
    return Plate(topic, stamps, np.hstack([forces, moments]), force)


def test_figures_are_those_of_the_definition():
    t = np.linspace(0.0, 1.0, 101)
    theirs = np.stack([np.sin(7 * t), np.cos(5 * t), np.zeros_like(t)], axis=1)
    ours = theirs + [0.1, 0.0, 0.2] + 0.3 * np.stack([np.cos(3 * t), t, 0.0 * t], axis=1)
    stamps = (1e7 * np.arange(101)).astype(np.int64)
    figures = Comparison(stamps, ours, theirs).figures(weight=5.0)
    for index, name in enumerate(("vertical", "anterior_posterior")):
        rmse = np.linalg.norm(ours[:, index] - theirs[:, index]) / np.sqrt(101)
        span = (np.ptp(ours[:, index]) + np.ptp(theirs[:, index])) / 2
        assert figures[name]["rrmse_percent"] == pytest.approx(100 * rmse / span, rel=1e-12)
        assert figures[name]["percent_weight"] == pytest.approx(100 * rmse / 5.0, rel=1e-12)
        assert figures[name]["r"] == pytest.approx(np.corrcoef(ours[:, index], theirs[:, index])[0, 1], rel=1e-12)
        assert figures[name]["seconds"] == pytest.approx(1.01)
    still = figures["medio_lateral"]  # neither moves: an error, but no range and no correlation
    assert (still["rrmse_percent"], still["r"]) == (None, None)
    assert still["percent_weight"] == pytest.approx(4.0)


def waves(count=200):
    """Forces of two feet that take turns, (count, 3) each, N; the bodies weigh 10 G."""
    t = np.arange(count) * 1e-2
    share = np.clip(0.5 + np.sin(2 * np.pi * t), 0.0, 1.0)[:, None]
    whole = np.stack([8 * np.sin(6 * t), 3 * np.cos(6 * t), 10 * G + 9 * np.cos(12 * t)], axis=1)
    return share * whole, (1.0 - share) * whole


@pytest.mark.parametrize(
    ("speed", "velocity", "ahead"),
    [
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), [1, 0]),
        ((0.0, -1.3, 0.0), (0.0, 0.0, 0.0), [0, -1]),
        ((0.0, 0.0, 0.0), (0.6, 0.8, 0.0), [-0.6, -0.8]),  # on a treadmill
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), [1, 0]),  # stands: as its first part faces
    ],
)
def test_components_follow_gravity_and_the_way_that_is_walked(tmp_path, speed, velocity, ahead):
    scene, simulator = walker(tmp_path, velocity)
    left, right = waves()
    total = left + right
    score = scored(scene, simulator, [plate("/plate", total)], left, right, speed)
    (comparison,) = score.comparisons().values()
    x, y = ahead
    expected = np.stack([total[:, 2], total[:, :2] @ [x, y], total[:, :2] @ [-y, x]], axis=1)
    for forces in (comparison.estimated, comparison.measured):
        np.testing.assert_allclose(forces, expected, atol=1e-9)
    for figures in comparison.figures(score.weight).values():
        assert figures["percent_weight"] < 1e-9
        assert figures["r"] > 1.0 - 1e-12


def test_a_plate_is_compared_with_the_foot_that_stands_on_it_while_it_does(tmp_path):
    scene, simulator = walker(tmp_path)
    left, right = waves()
    at = np.tile([0.0, 0.2, 0.0], (200, 1))
    plates = [plate("/a", right, at * [1, -1, 1]), plate("/b", left, at)]
    found = scored(scene, simulator, plates, left, right).comparisons()
    assert list(found) == ["total", "/a", "/b"]
    for topic, forces in (("/a", right), ("/b", left)):
        loaded = forces[:, 2] > 0.02 * 10 * G
        assert 100 < loaded.sum() < 150
        np.testing.assert_array_equal(found[topic].stamps, EPOCH + PERIOD * np.flatnonzero(loaded))
        np.testing.assert_allclose(found[topic].estimated, forces[loaded][:, [2, 0, 1]], atol=1e-12)
        np.testing.assert_allclose(found[topic].measured, forces[loaded][:, [2, 0, 1]], atol=1e-12)


def test_a_plate_that_both_feet_or_none_stand_on_counts_in_the_total_alone(tmp_path):
    scene, simulator = walker(tmp_path)
    left, right = waves()
    between = np.zeros((200, 3))
    aside = np.tile([0.0, 0.6, 0.0], (200, 1))
    for at in (None, between, aside):
        assert list(scored(scene, simulator, [plate("/a", left + right, at)], left, right).comparisons()) == ["total"]


def test_the_total_counts_where_no_foot_stands_beside_the_plates(tmp_path):
    scene, simulator = walker(tmp_path)
    left, right = waves(300)
    left[:150] *= left[:150, 2:] > 10.0  # lands late
    at = np.tile([0.0, 0.2, 0.0], (300, 1))
    measured = left.copy()
    measured[:120] = 0.0  # the plate is where the left foot's second step lands
    found = scored(scene, simulator, [plate("/a", measured, at), plate("/b", right, at * [1, -1, 1])], left, right)
    stands = left[:, 2] > 0.02 * 10 * G
    first = np.flatnonzero(np.diff(stands.astype(int)) == -1)[0]
    beside = stands & (np.arange(300) <= first)
    assert beside[:first].sum() > 40
    expected = EPOCH + PERIOD * np.flatnonzero(~beside)
    np.testing.assert_array_equal(found.comparisons()["total"].stamps, expected)


def test_a_force_of_the_scenes_own_name_needs_no_place(tmp_path):
    scene, simulator = walker(tmp_path)
    left, right = waves()
    found = scored(scene, simulator, [plate("/truth/a", right, force="right_sole")], left, right).comparisons()
    assert "/truth/a" in found


def test_plates_are_read_between_their_samples_and_not_beyond(tmp_path):
    stamps = EPOCH + PERIOD * np.arange(4)
    forces = np.array([[0.0, 0, 1], [0, 0, 3], [0, 0, np.nan], [0, 0, 5]])
    own = Plate("/a", stamps, np.hstack([forces, forces]))
    at = own.at(np.array([stamps[0] - 1, stamps[0], stamps[0] + PERIOD // 4, stamps[1] + 1, stamps[3], stamps[3] + 1]))
    np.testing.assert_array_equal(at[:, 2], [np.nan, 1.0, 1.5, np.nan, 5.0, np.nan])


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("part: right, friction: 1, velocity: VELOCITY", "part: right, to: trunk", "stands on the ground"),
        ("  - gravity\n", "", "has no gravity"),
    ],
)
def test_what_cannot_be_compared_is_refused(tmp_path, old, new, sentence):
    text = WALKER.replace(old, new)
    if "ground" in sentence:
        text = text.replace("part: left, friction: 1, velocity: VELOCITY", "part: left, to: trunk")
    scene, simulator = walker(tmp_path, text=text)
    with pytest.raises(RecordingError, match=sentence):
        ForceScore(scene, simulator, [plate("/a", np.zeros((2, 3)))])
