"""The estimator as the node and the replay use it: streams in order, late, doubled, repeated, odd."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics_prior.errors import MeasurementError
from physics_prior.estimation.estimate import Level
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import (
    JointsMeasurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)

SECOND = 10**9
seeds = st.integers(0, 2**32 - 1)


def _stream(moments):
    return [measurement for moment in moments for measurement in moment.measurements]


def _run(scene, stream, **options):
    estimator = Estimator(scene, **options)
    for measurement in stream:
        estimator.add(measurement)
    return estimator


def _truth_error(estimator, moment):
    """Largest error of the newest estimate, in its own standard deviations."""
    estimate = estimator.estimate()
    error = estimator.simulator.tree.difference(estimate.q, moment.q)
    return np.max(np.abs(error) / estimate.position_deviation)


# Order


@settings(max_examples=15)
@given(seed=seeds, name=st.sampled_from(["double_pendulum", "free_body"]))
def test_late_and_doubled_measurements_change_no_bit(shipped, moments_of, fingerprint, name, seed):
    """Arrivals late by up to 60 ms, a fifth of them twice: the same posterior in the end, cold start included."""
    scene = shipped(name)
    stream = _stream(moments_of(scene))
    expected = _run(scene, stream)
    rng = np.random.default_rng(seed)
    doubled = [*stream, *(each for each in stream if rng.random() < 0.2)]
    arrivals = [each.stamp + rng.uniform(0, 0.06 * SECOND) for each in doubled]
    late = _run(scene, [doubled[index] for index in np.argsort(arrivals)])
    assert fingerprint(late) == fingerprint(expected)
    counts = late.counts
    assert (counts.used, counts.gated) == (expected.counts.used, expected.counts.gated)
    assert counts.rejected == len(doubled) - len(stream)
    assert counts.late > 0


@settings(max_examples=20)
@given(seed=seeds)
def test_the_start_does_not_depend_on_the_order_within_a_stamp(shipped, moments_of, fingerprint, seed):
    """Nor on which topic is ahead by a stamp: queues of several subscriptions are emptied in any order."""
    scene = shipped("four_bar")
    moments = moments_of(scene)[:5]
    expected = _run(scene, _stream(moments))
    rng = np.random.default_rng(seed)
    stream = [moment.measurements[index] for moment in moments for index in rng.permutation(3)]
    assert fingerprint(_run(scene, stream)) == fingerprint(expected)
    by_topic = [moment.measurements[index] for index in rng.permutation(3) for moment in moments]
    assert fingerprint(_run(scene, by_topic)) == fingerprint(expected)


def test_topics_that_never_share_a_stamp_start_it_too(shipped, moments_of):
    scene = shipped("double_pendulum")
    shifted = [
        replace(each, stamp=each.stamp + 3_000_000) if each.topic == "/lower/pose" else each
        for each in _stream(moments_of(scene))
    ]
    estimator = _run(scene, shifted)
    assert estimator.ready
    assert _truth_error(estimator, moments_of(scene)[-1]) < 5.0


def test_the_start_waits_for_all_that_it_needs(shipped, moments_of):
    scene = shipped("double_pendulum")
    moments = moments_of(scene)
    estimator = Estimator(scene)
    for moment in moments[:10]:
        assert not estimator.add(moment.measurements[0])
    assert not estimator.ready
    assert estimator.health_at(0).level is Level.LOST
    with pytest.raises(MeasurementError, match="there is no estimate yet"):
        estimator.estimate()
    for moment in moments[10:12]:
        for measurement in moment.measurements:
            estimator.add(measurement)
    assert estimator.ready


@pytest.mark.parametrize("laps", [2, 3])
def test_every_lap_is_the_first(shipped, moments_of, fingerprint, laps):
    scene = shipped("double_pendulum")
    stream = _stream(moments_of(scene, duration=1.5))
    first = fingerprint(_run(scene, stream))
    estimator = Estimator(scene)
    for lap in range(laps):
        for measurement in stream:
            estimator.add(measurement)
        assert fingerprint(estimator) == first, lap
    counts = estimator.counts
    assert counts.read == laps * len(stream)
    assert counts.used + counts.gated + counts.rejected == counts.read
    assert counts.rejected == 0
    assert "time jumped" in estimator.last_rejection


def test_reset_starts_cold(shipped, moments_of, fingerprint):
    scene = shipped("double_pendulum")
    stream = _stream(moments_of(scene))
    estimator = _run(scene, stream)
    first, used = fingerprint(estimator), estimator.counts.used
    settled = []
    estimator.on_settled = settled.append
    estimator.reset()
    assert not estimator.ready
    assert len(settled) == used == estimator.counts.used
    for measurement in stream:
        estimator.add(measurement)
    assert fingerprint(estimator) == first


def test_one_stamp_far_ahead_costs_nothing(shipped, moments_of, fingerprint):
    """A year ahead: neither a year of prediction nor the estimate."""
    scene = shipped("double_pendulum")
    stream = _stream(moments_of(scene))
    strange = replace(stream[30], stamp=stream[30].stamp + 365 * 86400 * SECOND)
    estimator = _run(scene, [*stream[:30], strange, *stream[30:]])
    assert fingerprint(estimator) == fingerprint(_run(scene, stream))
    assert estimator.counts.rejected == 1


@pytest.mark.parametrize("offset", [3600, -3600])
def test_a_clock_that_jumps_is_followed(shipped, moments_of, fingerprint, offset):
    scene = shipped("double_pendulum")
    stream = _stream(moments_of(scene))
    jumped = [replace(each, stamp=each.stamp + offset * SECOND) for each in stream]
    estimator = _run(scene, [*stream, *jumped])
    assert fingerprint(estimator) == fingerprint(_run(scene, jumped))
    assert estimator.counts.rejected == 0


def test_a_strange_stamp_first_does_not_stop_the_start(shipped, moments_of):
    scene = shipped("double_pendulum")
    stream = _stream(moments_of(scene))
    estimator = _run(scene, [replace(stream[0], stamp=2 * stream[0].stamp), *stream[1:]])
    assert estimator.ready
    assert estimator.stamp == stream[-1].stamp


# The gate


def test_the_gate_lets_the_good_pass_and_refuses_outliers(shipped, moments_of):
    """Of 1002 good poses 0.999 may pass (all did); of 60 outliers none may."""
    scene = shipped("double_pendulum", rate=100.0)
    stream = _stream(moments_of(scene, seed=5, duration=5.0))
    good = _run(scene, stream).counts
    assert good.gated <= 6  # mean 1: more is one in ten thousand
    rng = np.random.default_rng(0)
    spoiled = set(rng.choice(np.arange(20, len(stream)), size=60, replace=False).tolist())
    mixed = [
        replace(each, position=each.position + rng.normal(scale=0.3, size=3)) if index in spoiled else each
        for index, each in enumerate(stream)
    ]
    estimator = Estimator(scene)
    nodes = []
    estimator.on_settled = nodes.append
    for measurement in mixed:
        estimator.add(measurement)
    estimator.reset()
    gated = {index for index, node in enumerate(nodes) if node.posterior.used is False}
    assert len(nodes) == len(stream)
    assert len(spoiled - gated) <= 1  # an outlier may be a small one
    assert len(gated - spoiled) <= 6


def test_after_a_wrong_start_the_measurements_win(shipped, moments_of):
    """Two moments of a wrong place, then the right one: believed after the scene's count of refusals."""
    scene = shipped("double_pendulum")
    moments = moments_of(scene)
    other = moments_of(replace(scene, initial=replace(scene.initial, q=np.array([-2.0, 1.0]))))
    wrong = [
        replace(theirs, stamp=ours.stamp)
        for moment, foreign in zip(moments[:2], other[:2], strict=True)
        for ours, theirs in zip(moment.measurements, foreign.measurements, strict=True)
    ]
    estimator = _run(scene, wrong)
    refused = 0
    for moment in moments[2:]:
        for measurement in moment.measurements:
            estimator.add(measurement)
        refused = max(refused, estimator.history.nodes[-1].posterior.refused)
    # the first may be refused or, the velocity being open, drag it along: what counts is the end
    assert refused < scene.gate.recover_after
    assert _truth_error(estimator, moments[-1]) < 5.0


def test_a_certain_but_wrong_estimate_recovers(shipped, moments_of):
    """Settled on one motion, then measurements of quite another: DEGRADED, then the other."""
    scene = shipped("double_pendulum")
    moments = moments_of(scene, duration=2.0)
    other = moments_of(replace(scene, initial=replace(scene.initial, q=np.array([-1.5, 1.5]))), duration=2.0)
    estimator = _run(scene, _stream(moments[:50]))
    levels, refused = [], 0
    for moment in other[50:]:
        for measurement in moment.measurements:
            estimator.add(measurement)
            refused = max(refused, estimator.history.nodes[-1].posterior.refused)
            levels.append(estimator.health_at(measurement.stamp).level)
    assert Level.DEGRADED in levels
    assert levels[-1] is Level.OK
    assert refused < scene.gate.recover_after
    assert _truth_error(estimator, other[-1]) < 5.0


# Odd measurements


def test_markers_not_seen(every_source, moments_of):
    """Any of them, or all, at any time: the estimate goes on by the others."""
    moments = moments_of(every_source, duration=0.3)
    rng = np.random.default_rng(0)
    estimator = Estimator(every_source)
    for moment in moments:
        for measurement in moment.measurements:
            if isinstance(measurement, PointsMeasurement):
                points = np.where(rng.random((3, 1)) < 0.5, np.nan, measurement.points)
                measurement = replace(measurement, points=points)
            estimator.add(measurement)
    assert estimator.counts.rejected == 0
    assert _truth_error(estimator, moments[-1]) < 5.0


@pytest.mark.parametrize(
    ("measurement", "sentence"),
    [
        (
            PoseMeasurement(1, "/nobody", np.zeros(3), [1, 0, 0, 0]),
            r"topic '/nobody' is not measured: the scene reads \['/arm",
        ),
        (OrientationMeasurement(1, "/arm/pose", [1, 0, 0, 0]), "a OrientationMeasurement does not fit"),
        (PointsMeasurement(1, "/markers", np.zeros((4, 3))), "brought 4 points"),
        (JointsMeasurement(1, "/encoders", ("x",), [0.0]), "joint 'x' is not one"),
    ],
)
def test_what_does_not_fit_is_rejected_with_a_sentence(every_source, measurement, sentence):
    estimator = Estimator(every_source)
    assert not estimator.add(measurement)
    assert re.search(sentence, estimator.last_rejection)
    assert (estimator.counts.read, estimator.counts.rejected) == (1, 1)


def test_a_strange_stamp_right_after_the_first_costs_nothing(every_source, moments_of):
    """Three years ahead of measurements that a start is waiting in: it must not be predicted to from there."""
    moments = moments_of(every_source, duration=0.3)
    estimator = Estimator(every_source)
    for measurement in moments[0].measurements:
        estimator.add(measurement)
    estimator.add(replace(moments[1].measurements[0], stamp=moments[0].stamp + 10**17))
    assert not estimator.ready
    for measurement in _stream(moments[1:6]):
        estimator.add(measurement)
    assert estimator.ready
    assert estimator.stamp == moments[5].stamp


@settings(max_examples=12)
@given(seeds)
def test_no_measurement_makes_it_raise_or_leave_the_numbers(every_source, moments_of, seed):
    """Good ones among nonsense: any stamp, place, covariance, topic."""
    rng = np.random.default_rng(seed)
    stream = _stream(moments_of(every_source, duration=0.3)[:12])
    estimator = Estimator(every_source)
    start = stream[0].stamp
    for good in stream:
        estimator.add(good)
        if rng.random() < 0.5:
            estimator.add(_nonsense(rng, start))
        if estimator.ready:
            posterior = estimator.history.nodes[-1].posterior
            assert all(np.isfinite(array).all() for array in (posterior.state.q, posterior.state.v, posterior.factor))
    counts = estimator.counts
    assert counts.used + counts.gated + counts.rejected <= counts.read


def _nonsense(rng, start):
    stamp = int(start + rng.choice([0, 1e7, -1e9, 1e10, 1e17]) * rng.normal())
    topic = str(rng.choice(["/arm/pose", "/base/imu", "/markers", "/encoders", "/nobody"]))
    size = 10.0 ** rng.uniform(-12, 8)
    covariance = None
    if rng.random() < 0.5:
        covariance = np.diag(10.0 ** rng.uniform(-12, 12, size=6))
    place = size * rng.normal(size=3)
    return [
        PoseMeasurement(stamp, topic, place, rng.normal(size=4), covariance),
        OrientationMeasurement(stamp, topic, rng.normal(size=4)),
        PointsMeasurement(stamp, topic, size * rng.normal(size=(3, 3))),
        JointsMeasurement(stamp, topic, ("e1",), size * rng.normal(size=1)),
    ][rng.integers(4)]


def test_a_measurement_that_drives_the_state_out_of_the_numbers_starts_it_anew(every_source, moments_of):
    estimator = _run(every_source, _stream(moments_of(every_source, duration=0.3)[:5]))
    estimator.history.nodes[-1].posterior.state.v[:] = 1e200
    late = moments_of(every_source, duration=0.3)[6:]
    estimator.add(late[0].measurements[0])
    assert "not finite" in estimator.last_rejection
    for measurement in _stream(late):
        estimator.add(measurement)
    assert _truth_error(estimator, late[-1]) < 5.0


# Covariance and health


def test_the_covariance_of_the_message_is_used(shipped, moments_of):
    """A thousandth of the scene's deviations: the configuration is known a thousand times better."""
    scene = shipped("free_body")
    stream = _stream(moments_of(scene)[:2])  # a third would contradict such sharp ones
    deviations = np.repeat([5e-6, np.radians(2e-3)], 3)
    sharp = [replace(each, covariance=np.diag(deviations**2)) for each in stream]
    own, theirs = (_run(scene, each).estimate().position_deviation for each in (stream, sharp))
    assert np.all(theirs < 2e-3 * own)
    assert np.all(theirs > 5e-4 * own)


def test_health_in_a_gap_and_after_it(shipped, moments_of):
    """OK, DEGRADED from degraded_after, LOST from lost_after on; OK again with the first measurement that is accepted."""
    scene = shipped("double_pendulum")
    moments = moments_of(scene, duration=2.0)
    estimator = _run(scene, _stream(moments[:50]))
    last = moments[49].stamp
    expected = {0.0: Level.OK, 0.149: Level.OK, 0.151: Level.DEGRADED, 4.99: Level.DEGRADED, 5.01: Level.LOST}
    for seconds, level in expected.items():
        stamp = last + round(seconds * SECOND)
        assert estimator.health_at(stamp).level is level
        if seconds < 1.0:
            assert estimator.estimate(stamp).health.level is level
    assert "no measurement was accepted for 0.15 s" in estimator.health_at(last + 151_000_000).cause
    after = moments[99:]  # a gap of one second
    levels = []
    for moment in after:
        for measurement in moment.measurements:
            estimator.add(measurement)
        levels.append(estimator.health_at(moment.stamp).level)
    assert levels[0] is Level.OK
    assert _truth_error(estimator, after[-1]) < 5.0


def test_estimates_carry_forces_and_their_uncertainty(shipped, moments_of):
    scene = shipped("four_bar")
    moments = moments_of(scene)
    estimator = _run(scene, _stream(moments))
    estimate = estimator.estimate()
    assert set(estimate.wrenches) == {"crank", "coupler", "rocker", "ground_pin"} == set(estimate.wrench_deviations)
    true = estimator.simulator.wrenches(moments[-1].q, moments[-1].v)
    for name, wrench in estimate.wrenches.items():
        deviation = estimate.wrench_deviations[name][:3]
        assert np.all(np.abs(wrench.force - true[name].force) < 5.0 * deviation + 1e-6)
    assert estimate.constraint_error < 1e-12
    assert estimate.rank == 2
    assert estimate.counts.used == len(_stream(moments)) - estimate.counts.gated


def test_prediction_leaves_the_estimate_alone(shipped, moments_of, fingerprint):
    scene = shipped("double_pendulum")
    estimator = _run(scene, _stream(moments_of(scene)))
    before = fingerprint(estimator)
    ahead = estimator.estimate(estimator.stamp + SECOND // 10)
    assert ahead.stamp == estimator.stamp + SECOND // 10
    assert np.all(ahead.velocity_deviation > 0.0)
    assert fingerprint(estimator) == before
