"""Cold start: a configuration from measurements alone, wherever it is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics_prior import rotations
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import OrientationMeasurement, PoseMeasurement
from physics_prior.estimation.start import start
from physics_prior.recording.simulate import motion

seeds = st.integers(0, 2**32 - 1)


def _measured_at(scene, filter, q, seed=0):
    """What the sources measure with the scene started at q."""
    moved = replace(scene, initial=replace(scene.initial, q=q))
    return next(motion(moved, filter.simulator, seed, 0.1))


@given(seeds, st.floats(-2, 6))
def test_a_free_body_anywhere(shipped, filter_of, seed, decade):
    """Any orientation, and positions from a centimetre to a thousand kilometres off the scene's own."""
    scene = shipped("free_body")
    filter = filter_of(scene)
    rng = np.random.default_rng(seed)
    position, orientation = 10.0**decade * rng.normal(size=3), rotations.normalize(rng.normal(size=4))
    measurement = PoseMeasurement(5, "/box/pose", position, orientation)
    found = start(filter, [measurement], 5)
    np.testing.assert_allclose(found.state.q[:3], position, rtol=1e-14, atol=1e-12)
    turn = rotations.log(rotations.multiply(rotations.conjugate(found.state.q[3:]), orientation))
    assert np.max(np.abs(turn)) < 1e-9
    assert (found.stamp, found.accepted, found.used, found.start) == (5, 5, True, True)


@pytest.mark.parametrize("axis", np.eye(3))
def test_a_free_body_turned_by_half_a_turn(shipped, filter_of, axis):
    scene = shipped("free_body")
    filter = filter_of(scene)
    start_q = scene.initial.q[3:]
    turned = rotations.multiply(start_q, rotations.exp(np.pi * axis))
    found = start(filter, [PoseMeasurement(0, "/box/pose", np.zeros(3), turned)], 0)
    turn = rotations.log(rotations.multiply(rotations.conjugate(found.state.q[3:]), turned))
    assert np.max(np.abs(turn)) < 1e-9


@settings(max_examples=30)
@given(seeds)
def test_pendulums_at_any_angles(shipped, filter_of, seed):
    """Within the noise of two poses: 4.5 standard deviations of either angle."""
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, size=2)
    moment = _measured_at(scene, filter, q, seed=7)
    found = start(filter, moment.measurements, moment.stamp)
    error = (found.state.q - q + np.pi) % (2 * np.pi) - np.pi
    assert np.all(np.abs(error) < 4.5 * np.sqrt(np.diag(found.factor @ found.factor.T))[:2])
    assert found.state.v.tolist() == [0.0, 0.0]


@settings(max_examples=20)
@given(seeds)
def test_every_joint_and_source_at_once(every_source, filter_of, seed):
    scene = replace(every_source, gate=every_source.gate.model_copy(update={"probability": 1.0 - 1e-9}))
    filter = filter_of(every_source)
    filter = type(filter)(scene, filter.simulator, filter.process)
    # hinges within half a turn of the scene's own: no measurement tells full turns
    turn = np.clip(np.random.default_rng(seed).normal(size=scene.tree.nv), -3.0, 3.0)
    q = scene.tree.integrate(scene.tree.neutral(), turn)
    moment = _measured_at(scene, filter, q, seed=seed)
    found = start(filter, moment.measurements, moment.stamp)
    nv = scene.tree.nv
    P = (found.factor @ found.factor.T)[:nv, :nv]
    error = scene.tree.difference(found.state.q, q)
    assert error @ np.linalg.solve(P, error) < 45.0  # chi-square of 11: 5e-6


@pytest.mark.parametrize(("name", "crank"), [("four_bar", 100.0), ("four_bar", 150.0), ("ball_on_rod", 0.0)])
def test_constrained_scenes_start_on_their_constraints(shipped, filter_of, name, crank):
    scene = shipped(name)
    filter = filter_of(scene)
    q = scene.initial.q.copy()
    if name == "four_bar":  # a parallelogram: the coupler stays level
        q[:] = np.radians([crank, 90.0 - crank, crank - 270.0])
    else:
        q[:3], q[3:] = [0.0, -1.1 / np.sqrt(2), 1.1 / np.sqrt(2)], rotations.exp(np.radians([225.0, 0.0, 0.0]))
    moment = _measured_at(scene, filter, q)
    found = start(filter, moment.measurements, moment.stamp)
    assert np.max(np.abs(filter.simulator.constraint_error(found.state.q, found.state.v))) < 1e-12
    error = scene.tree.difference(found.state.q, moment.q)
    deviations = np.sqrt(np.diag(found.factor @ found.factor.T))[: scene.tree.nv]
    assert np.all(np.abs(error) < 4.5 * deviations + 1e-3)  # 1e-3: what bends away from the tangent
    A, _ = filter.simulator.tangent_rows(found.state.q, found.state.v)
    assert np.max(np.abs(A @ found.factor[: scene.tree.nv])) < 1e-11


def test_the_covariance_is_the_measurements(shipped, filter_of, moments_of):
    """(H^T R^-1 H)^-1 of both poses; the velocity's is the scene's."""
    scene = shipped("double_pendulum")
    filter = filter_of(scene)
    moment = moments_of(scene)[0]
    found = start(filter, moment.measurements, moment.stamp)
    information = np.zeros((2, 2))
    for measurement in moment.measurements:
        seen = filter.innovation(measurement, found.state)
        information += seen.H.T @ np.linalg.solve(seen.noise @ seen.noise.T, seen.H)
    P = found.factor @ found.factor.T
    np.testing.assert_allclose(P[:2, :2], np.linalg.inv(information), rtol=1e-8)
    np.testing.assert_allclose(P[2:, 2:], np.diag(scene.noise.velocity**2))


def test_what_does_not_fix_the_configuration_is_no_start(shipped, filter_of, every_source, moments_of):
    scene = shipped("double_pendulum")
    moment = moments_of(scene)[0]
    assert start(filter_of(scene), moment.measurements[:1], moment.stamp) is None
    assert start(filter_of(scene), [], moment.stamp) is None
    orientation = OrientationMeasurement(0, "/base/imu", [1, 0, 0, 0])
    assert start(filter_of(every_source), [orientation], 0) is None


def test_measurements_that_contradict_each_other_are_no_start(shipped, filter_of, moments_of):
    scene = shipped("double_pendulum")
    upper, lower = moments_of(scene)[0].measurements
    wrong = replace(lower, position=lower.position + 0.3)
    assert start(filter_of(scene), [upper, wrong], upper.stamp) is None


def test_what_rounding_cannot_hold_is_refused_by_name_as_in_simulation(scene_file):
    """1 kg of 1e-12 kg m^2, held off its centre (test/properties/test_kept_scenes.py): the estimator went on with it."""
    scene = scene_file(
        """
        description: A speck that is held by a long arm.
        model: {parts: {speck: {mass: 1, inertia: 1e-12, joint: free}}}
        effects: [gravity, attachment: {name: hold, part: speck, point: [0, 0, 1], at: [0, 0, 1]}]
        measurements: [pose: {topic: /speck, part: speck, position_noise: 1 mm, orientation_noise: 1 deg}]
        noise: {force: 1e-3}
        """
    )
    estimator = Estimator(scene)
    for stamp in (0, 10_000_000, 20_000_000):
        estimator.add(PoseMeasurement(stamp, "/speck", np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    assert not estimator.ready
    assert "'hold' cannot take hold: the masses or inertias" in estimator.last_rejection
