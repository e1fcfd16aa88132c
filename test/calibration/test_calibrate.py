"""Calibration: a simulated trial of a person of known build is explained; the shipped scenes are what the command writes."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from physics_prior import rotations
from physics_prior.calibration import calibrate, scene_text
from physics_prior.calibration.frames import Frames
from physics_prior.calibration.normal_equations import Normal
from physics_prior.cli import main
from physics_prior.errors import MeasurementError
from physics_prior.model.human import Human
from physics_prior.resources import scene_path
from physics_prior.scene import load_marker_set, load_scene

BAGS = Path(__file__).resolve().parents[2].parent / "shared" / "bags"
TRUE = {"left_thigh": 0.44, "right_thigh": 0.43, "left_shank": 0.40, "right_shank": 0.41, "hip_width": 0.19}
MARKERS = "lower_body_28"


def trial(frames: int, noise: float, seed: int):
    """Stamps, markers and true places of somebody who moves the legs about and turns round."""
    rng, markers = np.random.default_rng(seed), load_marker_set(MARKERS)
    human = Human(70.0, 1.75, "male", lengths=TRUE, rigid=markers.rigid)
    tree = human.tree()
    places = [each.nominal(human) + rng.normal(scale=0.5 * each.spread, size=3) for each in markers.markers.values()]
    times = np.linspace(0.0, 4.0, frames)
    phase, q = rng.uniform(0.0, 6.0, size=tree.nv), np.tile(tree.neutral(), (frames, 1))
    for each, t in zip(q, times, strict=True):
        turn = 0.4 * np.sin(2.0 * t + phase)
        turn[:3] = [t, 0.0, 0.95]
        each[:] = tree.integrate(tree.neutral(), turn)
        each[3:7] = rotations.multiply(rotations.exp(np.array([0.0, 0.0, 1.5 * t])), each[3:7])
    at = Frames(tree, q, {}, 0)
    points = np.stack(
        [at.points(each.part, place) for each, place in zip(markers.markers.values(), places, strict=True)], axis=1
    )
    return times, points + noise * rng.normal(size=points.shape), np.array(places), markers


@pytest.fixture(scope="module")
def found():
    times, points, places, markers = trial(40, 0.001, 1)
    points[3:9, ::5] = np.nan
    points[20:23, [2, 9]] = points[20:23, [9, 2]]
    return calibrate(times, points, markers, Human(70.0, 1.75, "male"), True), places


def test_lengths_and_places_are_found_within_what_is_said(found):
    """Of a person unlike the average, through gaps and swapped labels: within four of its deviations, legs within 15 mm."""
    fit, places = found
    for name, length in TRUE.items():
        assert abs(fit.human.lengths[name] - length) < 4.0 * fit.deviations[name]
        assert abs(fit.human.lengths[name] - length) < 0.015
        assert name in fit.informed
    off = np.array(list(fit.places.values())) - places
    assert np.max(np.abs(off) / np.array(list(fit.place_deviations.values()))) < 4.0
    assert not {"left_forearm", "head"} & set(fit.informed)


def test_names_of_a_recording_stay_names(found):
    fit, _ = found
    frame = 'lab"\neffects: []  # no gravity'
    text = scene_text(fit, load_marker_set(MARKERS), "/markers", frame, "a test", 1.0)
    scene = yaml.safe_load(text)
    assert scene["frame_id"] == frame
    assert "gravity" in scene["effects"]


def test_the_same_trial_gives_the_same_person(found):
    times, points, _, markers = trial(40, 0.001, 1)
    points[3:9, ::5] = np.nan
    points[20:23, [2, 9]] = points[20:23, [9, 2]]
    again = calibrate(times, points, markers, Human(70.0, 1.75, "male"), True)
    assert again.human.lengths == pytest.approx(found[0].human.lengths, abs=1e-9)


def test_the_step_is_that_of_the_whole_least_squares():
    """The arrow's elimination against the dense normal equations."""
    rng = np.random.default_rng(0)
    normal = Normal(3, 4, 5)
    J, e, weight = np.zeros((27, 17)), rng.normal(size=(3, 3, 3)), rng.uniform(0.5, 2.0, size=(3, 3))
    for k in range(3):
        by_posture, by_constants = rng.normal(size=(3, 3, 4)), rng.normal(size=(3, 3, 5))
        normal.add(e[k], by_posture, by_constants, weight[k])
        for frame in range(3):
            rows = slice(9 * k + 3 * frame, 9 * k + 3 * frame + 3)
            J[rows, 4 * frame : 4 * frame + 4], J[rows, 12:] = by_posture[frame], by_constants[frame]
    W = np.diag(np.repeat(weight.ravel(), 3))
    dense = np.linalg.solve(J.T @ W @ J, J.T @ W @ e.ravel())
    postures, constants = normal.step(0.0, True)
    assert np.concatenate([postures.ravel(), constants]) == pytest.approx(dense, abs=1e-9)
    assert normal.covariance() == pytest.approx(np.linalg.inv(J.T @ W @ J)[12:, 12:], rel=1e-5)
    assert normal.cost == pytest.approx(e.ravel() @ W @ e.ravel())


def test_derivatives_are_differences():
    markers = load_marker_set(MARKERS)
    tree = Human(70.0, 1.75, "male", rigid=markers.rigid).tree()
    rng = np.random.default_rng(2)
    q = tree.integrate(tree.neutral(), rng.normal(scale=0.5, size=tree.nv))
    place = np.array([0.1, 0.02, -0.1])
    frames = Frames(tree, q[None], {}, 0)
    here = frames.points("left_foot", place)
    J = frames.by_posture("left_foot", here)[0]
    for column, e in enumerate(1e-6 * np.eye(tree.nv)):
        ends = [Frames(tree, tree.integrate(q, s * e)[None], {}, 0).points("left_foot", place)[0] for s in (1.0, -1.0)]
        assert J[:, column] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-8)


def test_what_is_no_trial_is_refused():
    times, points, _, markers = trial(5, 0.0, 3)
    with pytest.raises(MeasurementError, match="28"):
        calibrate(times, points[:, :5], markers, Human(70.0, 1.75, "male"), True)
    with pytest.raises(MeasurementError, match="0 frames"):
        calibrate(times, np.full_like(points, np.nan), markers, Human(70.0, 1.75, "male"), True)


@pytest.mark.parametrize(
    ("subject", "words"), [("mass=70", "lacks"), ("mass=70,sex=male,age=3", "age=3"), ("mass=x,sex=male", "'x'")]
)
def test_a_subject_that_is_none_is_refused(subject, words, capsys, tmp_path):
    with pytest.raises(SystemExit) as caught:
        main(["calibrate", "bag", "--subject", subject, "--markers", MARKERS, "-o", str(tmp_path / "s.yaml")])
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not BAGS.is_dir(), reason="the recordings are not here")
def test_the_shipped_scene_is_what_the_command_writes(tmp_path, capsys):
    """But for the last digit, which the machine's linear algebra may round otherwise."""
    again = tmp_path / "walk_bmc.yaml"
    words = ["--subject", "mass=77.2,sex=male", "--markers", MARKERS, "--forces"]
    assert main(["calibrate", str(BAGS / "bmc_walk1"), *words, "-o", str(again)]) == 0
    assert "told by" in capsys.readouterr().out
    new, old = load_scene(again), load_scene(scene_path("walk_bmc"))
    for mine, theirs in zip(new.measurements[0].markers, old.measurements[0].markers, strict=True):
        assert (mine.name, mine.part) == (theirs.name, theirs.part)
        assert mine.point == pytest.approx(theirs.point, abs=5e-4)
        assert mine.noise == pytest.approx(theirs.noise, rel=0.02)
    for mine, theirs in zip(new.tree.joints, old.tree.joints, strict=True):
        assert mine.position == pytest.approx(theirs.position, abs=5e-4)
