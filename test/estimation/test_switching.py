"""The filter through events: what takes hold and lets go inside the estimate leaves it consistent."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from physics_prior.errors import SceneError
from physics_prior.estimation import switching
from physics_prior.estimation.estimate import Level
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import ForceMeasurement
from physics_prior.estimation.smoother import smooth
from physics_prior.estimation.square_root import normalised_error
from physics_prior.estimation.start import posterior_at
from physics_prior.recording.simulate import EPOCH
from physics_prior.scene import load_scene

CAUGHT = """
description: A double pendulum whose elbow is caught and released.
model:
  parts:
    upper:
      mass: 1 kg
      center_of_mass: [0, 0, -0.5]
      inertia: {rod: 1 m}
      joint: {kind: revolute, axis: -y, name: shoulder}
    lower:
      mass: 1 kg
      center_of_mass: [0, 0, -0.5]
      inertia: {rod: 1 m}
      joint: {kind: revolute, parent: upper, position: [0, 0, -1], axis: -y, name: elbow}
effects:
  - gravity
  - attachment: {name: hand, part: upper, point: [0, 0, -1], AT, WHEN}
noise: {force: 5e-2, velocity: 2}
measurements:
  - pose: {topic: /lower/pose, part: lower, position_noise: 5 mm, orientation_noise: 2 deg}
  MORE
initial: {positions: {shoulder: 80 deg, elbow: 30 deg}}
step: {size: 5 ms}
simulation: {duration: 2 s, rate: 50 Hz}
"""
WHEN = "when: [{from: 0.5 s, until: 0.905 s}, {from: 1.3 s, until: 1.7 s}]"
SWITCHES = ((0.5, True), (0.905, False), (1.3, True), (1.7, False))  # s
HELD, FREE = (0.5, 0.7, 0.9, 1.3, 1.5, 1.7), (0.48, 0.92, 1.2, 1.8, 2.0)  # s; at 1.7 s it has let go and not yet moved


@pytest.fixture(scope="module")
def caught_scene(tmp_path_factory):
    """The scene, with some of its text changed; the hand catches the elbow where it is."""

    def load(when="initially: off", at="at: here", more=""):
        path = tmp_path_factory.mktemp("scene") / "caught.yaml"
        path.write_text(CAUGHT.replace("AT", at).replace("WHEN", when).replace("MORE", more))
        return load_scene(path)

    return load


@pytest.fixture(scope="module")
def scheduled(caught_scene):
    return caught_scene(WHEN)


@pytest.fixture(scope="module")
def commanded(caught_scene):
    return caught_scene()


def time_of(stamp):
    return (stamp - EPOCH) * 1e-9


def run(scene, moments, **options):
    """All nodes of an estimator that was given the measurements of moments, and the estimator."""
    nodes = []
    estimator = Estimator(scene, **options)
    estimator.on_settled = nodes.append
    for moment in moments:
        for measurement in moment.measurements:
            estimator.add(measurement)
    return estimator, nodes


def test_errors_are_as_large_as_said_through_switching(scheduled, moments_of):
    """NEES of the freedoms that are left, while held and while not, filtered and smoothed; NIS near switching and elsewhere."""
    runs = 40
    filtered = {time: [] for time in (*HELD, *FREE)}
    smoothed = {time: [] for time in (*HELD, *FREE)}
    near, elsewhere = np.zeros(2), np.zeros(2)
    for seed in range(runs):
        moments = moments_of(scheduled, seed=2000 + seed, duration=2.0)
        estimator, nodes = run(scheduled, moments)
        estimator.reset()
        for node in nodes:
            time = time_of(node.measurement.stamp)
            if time > 0.2:
                total = near if min(abs(time - at) for at, _ in SWITCHES) < 0.1 else elsewhere
                total += node.posterior.nis, node.posterior.dimension
        outcomes = [(filtered, [node.posterior for node in nodes])]
        if seed % 2:
            outcomes.append((smoothed, smooth(estimator.filter, nodes, 1.0)))
        for nees, posteriors in outcomes:
            by_stamp = {posterior.stamp: posterior for posterior in posteriors}
            for moment in moments:
                time = round(time_of(moment.stamp), 9)
                if time in nees:
                    posterior, process = by_stamp[moment.stamp], estimator.filter.process
                    error = process.difference(posterior.state, process.start(moment.q, moment.v))
                    value, rank = normalised_error(posterior.factor, error)
                    assert rank == (3 if time in HELD else 4)
                    nees[time].append(value)
    for nees in (filtered, smoothed):
        for times, freedoms in ((HELD, 3), (FREE, 4)):
            count = len(nees[times[0]])
            # filtered 2.950 held, 3.876 free; smoothed 3.004, 3.511; errors within a run are correlated: it counts once
            low, high = chi2.ppf([0.025, 0.975], count * freedoms) / count
            assert low < np.mean([nees[time] for time in times]) < high
            for time in times:
                low, high = chi2.ppf([0.0005, 0.9995], count * freedoms) / count
                assert low < np.mean(nees[time]) < high, time
    for nis, dimension in (near, elsewhere):  # 0.9886 in [0.9719, 1.0285]; 0.9839 in [0.9749, 1.0255]
        low, high = chi2.ppf([0.025, 0.975], dimension) / dimension
        assert low < nis / dimension < high


def test_a_place_that_is_told_sharpens_the_state_as_much_as_it_says(commanded, scheduled, moments_of, filter_of):
    """The estimator is told where the truth was caught: its covariance is conditioned on that, and NEES stays in its band."""
    runs, times = 40, {0.5: 2, 0.7: 2, 0.96: 4}
    simulator = filter_of(scheduled).simulator
    gravity, hand = commanded.effects
    nees, sharper = {time: [] for time in times}, []
    for seed in range(runs):
        moments = moments_of(scheduled, seed=3000 + seed, duration=1.0)
        held = next(moment for moment in moments if time_of(moment.stamp) >= 0.5)
        simulator.move(held.q, held.v)
        position, R = simulator.pose("upper")
        place = hand.caught(position + R @ np.array(hand.point), np.array([1.0, 0.0, 0.0, 0.0]))
        told = place.model_copy(update={"when": scheduled.effects[1].when})
        estimator, nodes = run(replace(commanded, effects=(gravity, told)), moments, history_length=10.0)
        estimator.reset()
        by_time = {round(time_of(node.measurement.stamp), 9): node for node in nodes}
        moved = {round(time_of(moment.stamp), 9): moment for moment in moments}
        for time, freedoms in times.items():
            posterior, moment, process = by_time[time].posterior, moved[time], estimator.filter.process
            error = process.difference(posterior.state, process.start(moment.q, moment.v))
            value, rank = normalised_error(posterior.factor, error)
            assert rank == freedoms
            nees[time].append(value)
        before, after = (np.linalg.norm(by_time[time].posterior.factor[1]) for time in (0.48, 0.5))
        sharper.append(after / before)
    assert max(sharper) < 1.0  # measured 0.84: the other joint, by what it has to do with the one that is held
    for time, freedoms in times.items():
        low, high = chi2.ppf([0.005, 0.995], runs * freedoms) / runs
        assert low < np.mean(nees[time]) < high  # measured 2.053, 2.299, 3.937


MOVING = """
description: A body that is caught by what moves.
model:
  parts:
    ball: {mass: 1 kg, inertia: {sphere: 0.1}, joint: {kind: free, name: flight}}
effects:
  - gravity
  - EFFECT
noise: {force: 5e-2, velocity: 1}
measurements:
  - pose: {topic: /ball/pose, part: ball, position_noise: 5 mm, orientation_noise: 2 deg}
initial: {velocities: {flight: {linear: [0, 0.5, 0], angular: [0.5, 0.2, 0.1]}}}
step: {size: 5 ms}
simulation: {rate: 50 Hz}
"""
BELT = "attachment: {part: ball, point: [0.1, 0, 0], at: here, motion: {velocity: [0.3, 0, 0.1]}, when: {from: 0.3, until: 0.6}}"
SHAKER = (
    "weld: {part: ball, point: [0.1, 0, 0], at: here, motion: {sine: {amplitude: [0.1, 0, 0.05], frequency: 2 Hz}},"
    " when: {from: 0.3, until: 0.6}}"
)


@pytest.mark.parametrize(("effect", "freedoms"), [(BELT, 9), (SHAKER, 6)], ids=["belt", "shaker"])
def test_what_moves_catches_consistently(effect, freedoms, scene_file, moments_of):
    scene, runs = scene_file(MOVING.replace("EFFECT", effect)), 20
    times = {0.3: freedoms, 0.5: freedoms, 0.7: 12}
    nees = {time: [] for time in times}
    for seed in range(runs):
        moments = moments_of(scene, seed=seed, duration=0.7)
        estimator, nodes = run(scene, moments)
        estimator.reset()
        for node, moment in zip(nodes, moments, strict=True):
            time = round(time_of(moment.stamp), 9)
            if time in nees:
                process, posterior = estimator.filter.process, node.posterior
                error = process.difference(posterior.state, process.start(moment.q, moment.v))
                value, rank = normalised_error(posterior.factor, error)
                assert rank == times[time]
                nees[time].append(value)
    for time, rank in times.items():
        low, high = chi2.ppf([0.005, 0.995], runs * rank) / runs
        assert (
            low < np.mean(nees[time]) < high
        )  # measured on the belt 9.215, 10.030, 10.933; shaken 6.077, 5.686, 11.064


def test_commands_are_as_good_as_a_schedule_and_may_come_late(scheduled, commanded, moments_of, fingerprint):
    """Any order of arrival, the same bits; and those of the schedule."""
    moments = moments_of(scheduled, seed=1, duration=1.5)
    by_schedule, _ = run(scheduled, moments, history_length=10.0)
    commands = [(EPOCH + round(time * 1e9), on) for time, on in SWITCHES if time < 1.5]
    expected = None
    rng = np.random.default_rng(0)
    for trial in range(3):
        estimator = Estimator(commanded, history_length=10.0)
        tasks = [(stamp, "command", on) for stamp, on in commands]
        tasks += [(each.stamp, "measurement", each) for moment in moments for each in moment.measurements]
        tasks.sort(key=lambda task: task[:2])
        if trial == 1:  # commands last of all, the newest first
            tasks.sort(key=lambda task: (task[1] == "command", -task[0] if task[1] == "command" else task[0]))
        if trial == 2:
            head, tail = tasks[:10], tasks[10:]
            tasks = head + [tail[index] for index in rng.permutation(len(tail))]
        for stamp, what, content in tasks:
            estimator.switch("hand", content, stamp) if what == "command" else estimator.add(content)
        assert estimator.last_rejection == ""
        expected = fingerprint(estimator) if expected is None else expected
        assert fingerprint(estimator) == expected
        ours, theirs = estimator.estimate(), by_schedule.estimate()
        assert ours.holding == theirs.holding == ("hand",)
        assert ours.rows == 3
        assert np.max(np.abs(ours.q - theirs.q)) < 1e-10
        assert np.max(np.abs(ours.covariance - theirs.covariance)) < 1e-10


def test_a_command_before_the_start_holds_at_the_start(commanded, moments_of):
    moments = moments_of(commanded, seed=1, duration=0.1)
    estimator = Estimator(commanded)
    estimator.switch("hand", True, EPOCH - 3 * 10**9)
    for moment in moments:
        for measurement in moment.measurements:
            estimator.add(measurement)
    estimate = estimator.estimate()
    assert estimate.holding == ("hand",)
    assert np.abs(estimate.v[0]) < 1e-12
    assert estimate.velocity_deviation[0] < 1e-12


def test_a_command_to_an_unknown_effect_is_rejected(commanded):
    estimator = Estimator(commanded)
    assert not estimator.switch("foot", True, EPOCH)
    assert "'effects/foot' is not measured" in estimator.last_rejection


def test_a_measured_force_switches_with_hysteresis(caught_scene, scheduled, moments_of):
    """The truth is caught as scheduled and its hand's force is measured; the estimator knows of no schedule."""
    scene = caught_scene(more="- switch: {topic: /hand/force, effect: hand, above: 2 N, below: 0.5 N}")
    moments = moments_of(scheduled, seed=3, duration=2.0)
    estimator, when = Estimator(scene, history_length=10.0), {}
    for moment in moments:
        for measurement in moment.measurements:
            estimator.add(measurement)
        time = time_of(moment.stamp)
        held = any(on and time >= at for at, on in SWITCHES) and not any(
            not on and time >= at and time < (1.3 if at < 1.0 else 9.0) for at, on in SWITCHES
        )
        # what the sensor shows: a firm grip, then a slack one, then nothing
        size = (3.0 if time < 0.6 or 1.3 <= time < 1.35 else 1.0) if held else 0.1
        estimator.add(ForceMeasurement(moment.stamp, "/hand/force", np.array([0.0, 0.0, size])))
        if estimator.ready:
            when[round(time, 3)] = estimator.estimate().holding == ("hand",)
    assert [time for time, now in when.items() if now != when.get(round(time - 0.02, 3), now)] == [0.5, 0.92, 1.3, 1.7]
    last, moment = estimator.history.nodes[-1].posterior, moments[-1]
    process = estimator.filter.process
    value, rank = normalised_error(last.factor, process.difference(last.state, process.start(moment.q, moment.v)))
    assert value < chi2.ppf(0.999, rank)


def test_a_switch_names_an_effect_that_holds_something(caught_scene):
    with pytest.raises(SceneError, match=r"'gravity' is not an effect that can be switched.*\['hand'\]"):
        caught_scene(more="- switch: {topic: /hand/force, effect: gravity, above: 2 N, below: 0.5 N}")
    with pytest.raises(SceneError, match="below 3 N is not valid: give at most above, 2 N"):
        caught_scene(more="- switch: {topic: /hand/force, effect: hand, above: 2 N, below: 3 N}")


@pytest.fixture
def filter(caught_scene, filter_of):
    """A filter of the scene whose hand holds the elbow at a place that it was told."""
    return filter_of(caught_scene(at="at: [0.8, 0, -0.6]"))


def random_posterior(filter, seed):
    rng = np.random.default_rng(seed)
    q = np.array([0.92, 0.5]) + 0.01 * rng.normal(size=2)
    posterior = posterior_at(filter, q, 0.02 * np.tril(rng.normal(size=(2, 2))), EPOCH)
    posterior.state.v[:] = rng.normal(size=2)
    factor = np.tril(0.02 * rng.normal(size=(4, 4)))
    return replace(posterior, factor=factor)


def test_a_place_that_is_told_is_an_exact_measurement(filter):
    """Before the impulse, the state is what a Kalman update by e = 0 gives; afterwards nothing of the covariance is forbidden."""
    hand = filter.simulator.switches.index("hand")
    for seed in range(5):
        prior = random_posterior(filter, seed)
        grip = switching.take_hold(filter, prior, hand)
        assert abs(grip.state.q[0] - np.arctan2(0.8, 0.6)) < 1e-10
        P = prior.factor @ prior.factor.T
        H = np.array([[1.0, 0.0, 0.0, 0.0]])
        K = P @ H.T / (H @ P @ H.T)
        x = K @ (grip.state.q[:1] - prior.state.q[:1])
        assert np.max(np.abs(filter.process.difference(prior.state, grip.state) - x)) < 1e-9
        expected = P - K @ H @ P
        assert np.max(np.abs(grip.factor @ grip.factor.T - expected)) < 1e-12


@pytest.mark.parametrize("at", ["at: here", "at: [0.8, 0, -0.6]"])
def test_the_impulse_maps_errors_by_its_derivative(at, caught_scene, filter_of):
    """F of taking hold against central differences of the velocity after, of states that take hold where they are."""
    filter = filter_of(caught_scene(at=at))
    simulator, hand = filter.simulator, filter.simulator.switches.index("hand")
    prior = random_posterior(filter, 7)
    prior.state.q[0] = np.arctan2(0.8, 0.6)
    grip = switching.take_hold(filter, prior, hand)

    def after(error):
        state = filter.process.displace(grip.state, error)
        v = state.v.copy()
        simulator.project_velocity(state.q, v)
        return np.concatenate([error[:2], v])

    for k, one in enumerate(np.eye(4)):
        difference = (after(1e-5 * one) - after(-1e-5 * one)) / 2e-5
        assert np.max(np.abs(grip.F[:, k] - difference)) < 1e-8
    A, A_q = simulator.tangent_rows(grip.after.q, grip.after.v)
    assert np.max(np.abs(A @ grip.after.v)) < 1e-12
    allowed = grip.factor_after
    assert np.max(np.abs(A @ allowed[2:] + A_q @ allowed[:2])) < 1e-12
    assert (np.max(np.abs(A @ allowed[:2])) < 1e-12) == (at != "at: here")


def test_what_cannot_take_hold_stays_off_and_is_said(caught_scene, moments_of):
    scene = caught_scene(at="at: [3, 0, 0]")
    estimator, _ = run(scene, moments_of(scene, seed=1, duration=0.2))
    estimator.switch("hand", True, EPOCH + 150_000_000)
    estimate = estimator.estimate()
    assert estimate.holding == ()
    assert estimate.health.level is Level.DEGRADED
    assert "'hand' could not take hold" in estimate.health.cause
    assert np.all(np.isfinite(estimate.covariance))
    estimator.switch("hand", False, EPOCH + 160_000_000)
