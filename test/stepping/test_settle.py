"""Scenes that ask for an accuracy: each kind of it end to end on a pendulum, and what is refused."""

import json
import math

import numpy as np
import pytest

from physics_prior import cli
from physics_prior.errors import SceneError
from physics_prior.estimation.estimator import Estimator
from physics_prior.recording.simulate import motion
from physics_prior.scene import load_scene
from physics_prior.stepping import kept, settle
from physics_prior.stepping.course import course_of
from physics_prior.stepping.trials import EXPLICIT, IMPLICIT, Trials
from physics_prior.studies.effects.variant import SceneText
from physics_prior.studies.problems.pendulum import G

SCENE = """\
description: a pendulum of a point mass, let go at 90 deg, whose motion is known
model:
  parts:
    bob: {mass: 1, center_of_mass: [0, 0, -1], inertia: {sphere: 1 mm}, joint: {kind: revolute, axis: y, name: pin}}
effects: [{gravity: {acceleration: [0, 0, -9.81]}}]
measurements: [{pose: {topic: /bob, part: bob, position_noise: 5 mm, orientation_noise: 2 deg}}]
noise: {force: 1e-3}
initial: {positions: {pin: 90 deg}}
simulation: {duration: 2 s, rate: 20 Hz, force_noise: false}
accuracy: {tolerance: 1e-4 m}
"""
TOLERANCE = "tolerance: 1e-4 m"


@pytest.fixture
def load(tmp_path):
    def write(*changes):
        text = SCENE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "bob.yaml").write_text(text)
        return load_scene(tmp_path / "bob.yaml")

    return write


@pytest.fixture(autouse=True)
def choices_of_its_own(tmp_path, monkeypatch):
    """Kernels come from the cache, choices go elsewhere."""
    monkeypatch.setattr(kept, "cache_directory", lambda: tmp_path / "choices")


def largest_error(scene):
    """Of the angle, rad, which is m for a metre's pendulum, against the quarter periods of the elliptic solution."""
    from scipy.special import ellipj, ellipk

    k = math.sin(0.25 * math.pi)
    worst = 0.0
    for moment in motion(scene, scene.simulator()):
        t = 1e-9 * (moment.stamp - 1_700_000_000 * 10**9)
        # a sphere of 1 mm turns with the rod: the pendulum is longer by 2/5 r^2
        sn = ellipj(ellipk(k * k) - math.sqrt(G / (1.0 + 0.4e-6)) * t, k * k)[0]
        worst = max(worst, abs(float(moment.q[0]) - 2.0 * math.asin(k * float(sn))))
    return worst


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-8])
def test_a_tolerance_is_kept_and_not_overdone(load, tolerance):
    """Against a closed solution: 1.0e-3, 9.3e-6 and 8.6e-9 m."""
    scene, choice = settle(load((TOLERANCE, f"tolerance: {tolerance} m")))
    assert choice.kept
    assert choice.taken.error <= tolerance
    assert largest_error(scene) == pytest.approx(choice.taken.error, rel=0.5)  # angles, and points of the bob
    assert (scene.step, scene.accuracy) == (choice.taken.step, None)
    assert scene.step.size <= 1.0 / 20.0


def test_a_finer_tolerance_takes_a_finer_step(load):
    steps = [settle(load((TOLERANCE, f"tolerance: {each} mm")))[1].others for each in (10, 0.1)]
    (coarse,), (fine,) = ([each.step.size for each in other if each.scheme == "semi_implicit_euler"] for other in steps)
    assert fine < coarse


def test_a_generous_budget_buys_all_that_can_be_told_and_a_mean_one_is_not_kept(load):
    rich = settle(load((TOLERANCE, "budget: 1 s per step")))[1]
    assert rich.kept
    assert rich.taken.error <= 1e-12
    assert rich.taken.scheme == "dop853"
    poor = settle(load((TOLERANCE, "budget: 1 ns per step")))[1]
    assert not poor.kept
    assert poor.taken.us > 1e-3
    assert poor.work == "estimating"
    assert {each.step.size for each in (poor.taken, *poor.others)} == {0.05}


def test_a_factor_of_real_time_is_a_budget(load):
    """20 Hz leave 50 ms from measurement to measurement, of which 1e-6 are as little as above, and all enough."""
    assert not settle(load((TOLERANCE, "real_time_factor: 1e9")))[1].kept
    assert settle(load((TOLERANCE, "real_time_factor: 1")))[1].kept


def test_where_nothing_is_measured_the_motion_is_timed(load):
    changes = [(TOLERANCE, "budget: 1 s"), ("measurements: [{pose: {topic: /bob, part: bob, position_noise: 5 mm,", "")]
    changes[1] = (SCENE.splitlines()[5] + "\n", "")
    choice = settle(load(*changes))[1]
    assert choice.work == "moving"
    assert choice.kept


def test_a_choice_is_made_once_and_kept(load, monkeypatch):
    first = settle(load())[1]
    monkeypatch.setattr("physics_prior.stepping.choosing.choose", lambda *args: pytest.fail("chosen again"))
    assert settle(load())[1].model_dump(exclude_unset=True) == first.model_dump(exclude_unset=True)
    for change in (("1e-4 m", "2e-4 m"), ("90 deg", "91 deg"), ("mass: 1", "mass: 2"), ("rate: 20", "rate: 25")):
        assert kept.read(load(change)) is None, change
    assert kept.read(load(("a pendulum of", "a swing of"))) is not None  # words change nothing


def test_of_two_that_choose_at_once_the_first_counts(load):
    scene = load()
    first = settle(scene)[1]
    second = first.model_copy(update={"seconds": 1.0})
    assert kept.write(scene, second).seconds == first.seconds
    kept.path_of(scene).write_text("{")
    assert kept.read(scene) is None
    assert kept.write(scene, second).seconds == 1.0


def test_a_scene_that_names_its_step_is_left_alone():
    scene = load_scene("pendulum")
    assert settle(scene) == (scene, None)


def test_an_unsettled_scene_is_not_stepped(load):
    with pytest.raises(SceneError, match="its step is not chosen yet"):
        Estimator(load())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([(TOLERANCE, "")], r"bob.yaml:10: accuracy: give one of 'tolerance', 'budget' and 'real_time_factor'"),
        ([(TOLERANCE, "tolerance: 1 m, budget: 1 s")], r"bob.yaml:10: accuracy: give one of"),
        ([(TOLERANCE, "tolerance: 0 m")], r"bob.yaml:10: accuracy.tolerance: '0 m'.*out of range.*>= 1e-13"),
        ([(TOLERANCE, "tolerance: 1e-4 s")], r"bob.yaml:10: accuracy.tolerance: '1e-4 s'.*in m"),
        ([(TOLERANCE, "budget: 50 us per day")], r"bob.yaml:10: accuracy.budget: '50 us per day'"),
        ([(TOLERANCE, "budget: -50 us per step")], r"bob.yaml:10: accuracy.budget:.*out of range"),
        ([(TOLERANCE, "real_time_factor: 0")], r"bob.yaml:10: accuracy.real_time_factor: 0 is out of range"),
        ([(TOLERANCE, "tolerence: 1 m")], r"unknown key 'tolerence'.*tolerance"),
        ([("accuracy:", "step: {size: 1 ms}\naccuracy:")], r"bob.yaml:10: step: is not valid beside 'accuracy'"),
        (
            [("effects: [", "effects: [{joint_limit: {upper: {pin: 2}}}, ")],
            r"bob.yaml:10: accuracy: is not valid where something may touch",
        ),
    ],
)
def test_what_cannot_be_asked_is_refused_where_it_stands(load, changes, message):
    with pytest.raises(SceneError, match=message):
        load(*changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("90 deg", "0 deg")], r"bob.yaml: accuracy: nothing moves by 0.0001 m from the scene's initial state"),
        ([("initial: {", "initial: {velocities: {pin: 1e59 rad/s}, ")], r"accuracy: .*is lost"),
    ],
)
def test_a_motion_that_tells_nothing_is_refused(load, changes, message):
    with pytest.raises(SceneError, match=message):
        settle(load(*changes))


def test_implicit_rules_are_tried_where_the_longest_step_loses_the_motion(load, monkeypatch):
    trials = Trials(course_of(load()), 1e-4)
    assert trials.contestants() == [*EXPLICIT]
    monkeypatch.setattr(Trials, "error", lambda self, scheme, n: math.inf)
    assert trials.contestants() == [*EXPLICIT, *IMPLICIT]


def test_a_motion_that_is_not_known_long_enough_is_refused(load, monkeypatch):
    """A pendulum that falls from all but upright: what it starts with grows by e in 0.32 s."""
    monkeypatch.setattr("physics_prior.stepping.trials.SHORTEST", 0.9)
    scene = load(("1e-4 m", "1e-12 m"), ("90 deg", "179.9999999 deg"), ("2 s", "9 s"))
    with pytest.raises(
        SceneError, match=r"bob.yaml: accuracy: an error of 1e-12 m cannot be told on this scene's motion"
    ):
        settle(scene)


def test_what_takes_too_long_is_given_up(load, monkeypatch):
    monkeypatch.setattr("physics_prior.stepping.course.LONGEST_RUN", 0.0)
    with pytest.raises(
        SceneError, match=r"bob.yaml: accuracy: the motion .* is lost: 0.05 s of motion take more than 0 s"
    ):
        settle(load())


def test_a_rate_beyond_reason_shortens_the_motion_that_is_tried(load):
    course = course_of(load(("rate: 20 Hz", "rate: 1 MHz")))
    assert len(course.times) == 20_000
    assert course.times[-1] == pytest.approx(0.02)


@pytest.mark.slow
def test_stiff_motion_has_its_own_contestants(load):
    """A damper of 1e4 N m s/rad on 1 kg m^2 loses Runge and Kutta's 50 ms; the implicit rules take them."""
    damped = ("effects: [", "effects: [{joint_damping: {coefficients: {pin: 1e4}}}, ")
    choice = settle(load(damped, ("initial: {", "initial: {velocities: {pin: 1000 rad/s}, ")))[1]
    assert "lobatto_iiic" in [each.scheme for each in (choice.taken, *choice.others)]


def test_check_explains_and_effects_compare_at_the_chosen_step(load, tmp_path, capsys):
    scene, choice = settle(load())
    path = str(tmp_path / "bob.yaml")
    assert cli.main(["check", path, "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["accuracy"]["taken"] == choice.taken.model_dump(exclude_unset=True)
    assert told["step"]["size"] == scene.step.size
    assert cli.main(["check", path]) == 0
    out = capsys.readouterr().out
    assert "an error of at most 0.0001 m" in out
    assert all(each.scheme in out for each in (choice.taken, *choice.others))
    variant = SceneText.read(path).stepped(scene.step).build()
    assert variant.step == scene.step
    assert np.array_equal(variant.initial.q, scene.initial.q)
