"""One prediction, one gate, one update."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from physics_prior import rotations
from physics_prior.errors import SimulationError
from physics_prior.estimation.filter import Posterior
from physics_prior.estimation.measurement import PointsMeasurement, PoseMeasurement
from physics_prior.estimation.process import steps
from physics_prior.estimation.start import posterior_at

NANOSECONDS = 10**9


def _posterior(filter, spread=1e-3, stamp=0):
    return posterior_at(filter, filter.scene.initial.q.copy(), spread * np.eye(filter.simulator.nv), stamp)


def test_prediction_is_the_scenes_own_step(shipped, filter_of):
    filter = filter_of(shipped("double_pendulum"))
    before = _posterior(filter)
    after = filter.predict(before, 123_456_789)
    q, v = before.state.q.copy(), before.state.v.copy()
    count, h = steps(0.123456789, filter.scene.step.size)
    filter.simulator.advance(q, v, h, count)
    np.testing.assert_allclose(after.state.q, q, atol=1e-14)
    np.testing.assert_allclose(after.state.v, v, atol=1e-13)
    assert before.state.q.tolist() == filter.scene.initial.q.tolist()  # untouched
    assert (after.stamp, after.accepted, after.used, after.start) == (123_456_789, 0, None, False)


def test_prediction_to_the_same_or_an_earlier_stamp_is_none(shipped, filter_of):
    filter = filter_of(shipped("double_pendulum"))
    before = _posterior(filter, stamp=7)
    assert filter.predict(before, 7) is before
    assert filter.predict(before, 3) is before


def test_a_prediction_that_leaves_the_numbers_is_not_passed_on(shipped, filter_of):
    filter = filter_of(shipped("double_pendulum"))
    before = _posterior(filter)
    before.state.v[:] = 1e200
    with pytest.raises(SimulationError, match="not finite"):
        filter.predict(before, NANOSECONDS)


@pytest.mark.parametrize(
    ("freedom", "of_most", "says"),
    [
        (0, 0.9, None),
        (0, 1.1, "'box/linear_x' slides by 1.1e+04 m in a step of 0.005 s, more than 10000 m: a smaller step"),
        (4, 0.9, None),
        (4, 1.1, "'box/angular_y' turns by 6.91 rad in a step of 0.005 s, more than one revolution: a smaller step"),
    ],
)
def test_a_prediction_faster_than_its_steps_can_follow_is_not_passed_on(shipped, filter_of, freedom, of_most, says):
    filter = filter_of(shipped("free_body"))
    before = _posterior(filter)
    h = filter.scene.step.size
    before.state.v[freedom] = of_most * (2.0 * np.pi if freedom > 2 else 1e4) / h
    if says is None:
        filter.predict(before, round(h * NANOSECONDS))
        return
    with pytest.raises(SimulationError, match=re.escape(says)):
        filter.predict(before, round(h * NANOSECONDS))


@pytest.mark.parametrize("name", ["double_pendulum", "free_body"])
def test_a_small_update_is_the_dense_one(shipped, filter_of, moments_of, name):
    scene = shipped(name)
    filter = filter_of(scene)
    moment = moments_of(scene)[0]
    prior = _posterior(filter, spread=1e-4, stamp=moment.stamp)
    measurement = moment.measurements[0]
    seen = filter.innovation(measurement, prior.state)
    after = filter.update(prior, measurement)
    n, m = len(prior.factor), len(seen.y)
    H = np.hstack([seen.H, np.zeros((m, n - seen.H.shape[1]))])
    P, R = prior.factor @ prior.factor.T, seen.noise @ seen.noise.T
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    np.testing.assert_allclose(filter.process.difference(prior.state, after.state), K @ seen.y, atol=1e-12)
    dense = (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T + K @ R @ K.T
    np.testing.assert_allclose(after.factor @ after.factor.T, dense, atol=1e-12)
    assert after.nis == pytest.approx(seen.y @ np.linalg.solve(H @ P @ H.T + R, seen.y), rel=1e-9)
    assert (after.dimension, after.used, after.refused, after.accepted) == (6, True, 0, moment.stamp)


def test_a_large_update_is_iterated(shipped, filter_of, moments_of):
    """An elbow seen 0.4 rad away turns the shoulder there: to 4e-9 rad, where one linearisation is off by 1e-2."""
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    moment = moments_of(scene)[0]
    prior = _posterior(filter, spread=1.0, stamp=moment.stamp)
    prior.state.q[0] = moment.q[0] + 0.4
    _, lower = _without_noise(filter, moment)
    position_alone = np.diag(np.repeat([1e-8, 1.0], 3))
    after = filter.update(prior, replace(lower, covariance=position_alone), gated=False)
    assert abs(after.state.q[0] - moment.q[0]) < 1e-7


def _without_noise(filter, moment):
    filter.simulator.move(moment.q, moment.v)
    for source in filter.scene.measurements:
        position, R = filter.simulator.pose(source.part)
        yield PoseMeasurement(moment.stamp, source.topic, position, rotations.quaternion_from_matrix(R))


def test_the_gate_refuses_what_does_not_fit(shipped, filter_of, moments_of):
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    moment = moments_of(scene)[0]
    prior = _posterior(filter, stamp=moment.stamp)
    good = moment.measurements[0]
    bad = replace(good, position=good.position + 1.0)
    refused = filter.update(prior, bad)
    assert (refused.used, refused.refused, refused.accepted) == (False, 1, prior.accepted)
    assert refused.nis > filter.gate_limit(6) == pytest.approx(chi2.ppf(scene.gate.probability, 6))
    assert refused.state is prior.state
    assert filter.update(refused, bad).refused == 2
    assert filter.update(refused, good).refused == 0


def test_a_measurement_that_says_nothing_changes_nothing(every_source, filter_of):
    """Nor does it take on what became of the one before it at the same stamp."""
    filter = filter_of(every_source)
    prior = replace(_posterior(filter), used=True, nis=5.0, dimension=6, start=True)
    after = filter.update(prior, PointsMeasurement(0, "/markers", np.full((3, 3), np.nan)))
    assert after.state is prior.state
    assert (after.used, after.nis, after.dimension, after.start) == (None, 0.0, 0, False)


@pytest.mark.parametrize("name", ["ball_on_rod", "four_bar"])
def test_state_and_covariance_stay_on_the_constraints(shipped, filter_of, moments_of, name):
    """Position rows below 1e-12 m (5e-14 seen); A S_q and A S_v + d(A v)/dq S_q within 1e-13 of the factor's size (2e-16)."""
    scene = shipped(name)
    filter = filter_of(scene)
    moments = moments_of(scene)
    posterior: Posterior = _posterior(filter, spread=0.03, stamp=moments[0].stamp)
    nv = filter.simulator.nv
    worst = 0.0
    for moment in moments[:20]:
        for measurement in moment.measurements:
            posterior = filter.update(filter.predict(posterior, moment.stamp), measurement, gated=False)
            state, S = posterior.state, posterior.factor
            assert np.max(np.abs(filter.simulator.constraint_error(state.q, state.v))) < 1e-12
            A, A_q = filter.simulator.tangent_rows(state.q, state.v)
            worst = max(worst, np.max(np.abs(A @ S[:nv])) / np.max(np.abs(S[:nv])))
            worst = max(worst, np.max(np.abs(A @ S[nv:] + A_q @ S[:nv])) / np.max(np.abs(S)))
    assert worst < 1e-13


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_covariance_is_one_for_ever(shipped, filter_of, seed):
    """Sharp and dull measurements, rightly or wrongly believed, gaps short and long."""
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    rng = np.random.default_rng(seed)
    posterior = _posterior(filter, spread=0.1)
    for _ in range(30):
        posterior = filter.predict(posterior, posterior.stamp + int(10.0 ** rng.uniform(0, 8)))
        covariance = np.diag(10.0 ** rng.uniform(-12, 12, size=6))
        measurement = PoseMeasurement(
            posterior.stamp, "/upper/pose", rng.normal(size=3), rng.normal(size=4), covariance
        )
        posterior = filter.update(posterior, measurement)
        P = posterior.factor @ posterior.factor.T
        assert np.isfinite(P).all()
        deviations = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(deviations, deviations))[0] > -1e-14
