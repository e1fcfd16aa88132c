"""What sources see of a state, how it changes with the state, and how noisy it is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from physics_prior import rotations
from physics_prior.errors import MeasurementError
from physics_prior.estimation.measurement import (
    JointsMeasurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.estimation.observation import check
from physics_prior.estimation.process import State
from physics_prior.recording.simulate import motion

seeds = st.integers(0, 2**32 - 1)


def _state(scene, seed, spread=1.0):
    return scene.tree.integrate(scene.tree.neutral(), spread * np.random.default_rng(seed).normal(size=scene.tree.nv))


def _see(filter, measurement, q):
    return filter.innovation(measurement, State(q, np.zeros(filter.simulator.nv), np.zeros(0)))


@pytest.fixture(scope="module")
def measured(every_source, moments_of):
    """One measurement of each kind, at the scene's initial configuration."""
    return moments_of(every_source, seed=1, duration=0.01)[0].measurements


def test_the_scene_has_every_kind_of_source(measured):
    kinds = [PoseMeasurement, OrientationMeasurement, PointsMeasurement, JointsMeasurement]
    assert [type(measurement) for measurement in measured] == kinds


@given(seeds)
def test_jacobians_are_derivatives(every_source, filter_of, measured, seed):
    """Central differences; rotations to where their logarithm bends, so near the measured one."""
    filter, nv = filter_of(every_source), every_source.tree.nv
    q = _state(every_source, seed, spread=0.05)
    for measurement in measured:
        seen = _see(filter, measurement, q)
        numeric = np.empty_like(seen.H)
        for k, direction in enumerate(1e-6 * np.eye(nv)):
            ahead = _see(filter, measurement, every_source.tree.integrate(q, direction)).y
            behind = _see(filter, measurement, every_source.tree.integrate(q, -direction)).y
            numeric[:, k] = (behind - ahead) / 2e-6
        # y = log(R^T R_measured) changes by the left Jacobian's inverse, I + O(y): H is its value at y = 0
        size = np.linalg.norm(seen.y[-3:]) if len(seen.y) in (3, 6) else 0.0
        np.testing.assert_allclose(seen.H, numeric, atol=1e-8 + size * np.max(np.abs(seen.H)))


@given(seeds)
def test_jacobians_are_exact_where_the_measurement_is(every_source, filter_of, seed):
    """At y = 0, anywhere: a measurement made of the state itself. Worst seen 3e-10."""
    filter, tree = filter_of(every_source), every_source.tree
    q = _state(every_source, seed)
    for measurement in _exact(every_source, filter, q):
        seen = _see(filter, measurement, q)
        assert np.max(np.abs(seen.y)) < 1e-13
        for k, direction in enumerate(1e-6 * np.eye(tree.nv)):
            ahead = _see(filter, measurement, tree.integrate(q, direction)).y
            behind = _see(filter, measurement, tree.integrate(q, -direction)).y
            np.testing.assert_allclose((behind - ahead) / 2e-6, seen.H[:, k], atol=3e-9)


def _exact(scene, filter, q):
    """Measurements without noise, from first principles."""
    simulator = filter.simulator
    simulator.move(q, np.zeros(simulator.nv))
    out = []
    for source in scene.measurements:
        if source.topic == "/markers":
            points = []
            for marker in source.markers:
                position, R = simulator.pose(marker.part)
                points.append(position + R @ marker.point)
            out.append(PointsMeasurement(0, source.topic, points))
        elif source.topic == "/encoders":
            positions = [q[scene.tree.link(joint).q][0] for joint in ("elbow", "slide")]
            out.append(JointsMeasurement(0, source.topic, ("e1", "e2"), positions))
        else:
            position, R = simulator.pose(source.part)
            turned = R @ rotations.matrix_from_quaternion(source.frame.orientation)
            orientation = rotations.quaternion_from_matrix(turned)
            if source.topic == "/base/imu":
                out.append(OrientationMeasurement(0, source.topic, orientation))
            else:
                out.append(PoseMeasurement(0, source.topic, (position + R @ source.frame.position) / 1.5, orientation))
    return out


@pytest.mark.parametrize("turns", [-3, -1, 1, 2])
def test_an_encoder_may_wrap_where_it_likes(every_source, filter_of, turns):
    """Of a revolute joint; whole turns of a prismatic one's metres are metres."""
    filter, q = filter_of(every_source), _state(every_source, 0)
    joints = [q[every_source.tree.link(joint).q][0] for joint in ("elbow", "slide")]
    shifted = np.array(joints) + 2.0 * np.pi * turns
    seen = _see(filter, JointsMeasurement(0, "/encoders", ("e1", "e2"), shifted), q)
    assert abs(seen.y[0]) < 1e-13  # 4e-15
    assert abs(seen.y[1] - 2.0 * np.pi * turns) < 1e-13  # 0


@given(seeds)
def test_a_quaternion_and_its_negative_are_one_measurement(every_source, filter_of, seed):
    filter, q = filter_of(every_source), _state(every_source, seed)
    orientation = rotations.normalize(np.random.default_rng(seed).normal(size=4))
    for topic in ("/arm/pose", "/base/imu"):
        pair = []
        for sign in (1.0, -1.0):
            if topic == "/base/imu":
                measurement = OrientationMeasurement(0, topic, sign * orientation)
            else:
                measurement = PoseMeasurement(0, topic, np.zeros(3), sign * orientation)
            pair.append(_see(filter, measurement, q).y)
        assert np.max(np.abs(pair[0] - pair[1])) <= 1e-14  # 0


def test_noise_of_the_simulated_measurements_is_the_sources(every_source, filter_of):
    """Whitened by the source's covariance, innovations against the truth are white: axes and scales agree."""
    scene = replace(every_source, initial=replace(every_source.initial, q=_state(every_source, 4)))
    scene = replace(scene, simulation=scene.simulation.model_copy(update={"rate": 1000.0}))
    filter = filter_of(scene)
    whitened = {}
    for moment in motion(scene, filter.simulator, 3, 0.5):
        for measurement in moment.measurements:
            seen = _see(filter, measurement, moment.q)
            whitened.setdefault(measurement.topic, []).append(np.linalg.solve(seen.noise, seen.y))
    for rows in map(np.array, whitened.values()):
        low, high = chi2.ppf([0.001, 0.999], rows.shape[0]) / rows.shape[0]
        assert np.all((low < np.mean(rows**2, axis=0)) & (np.mean(rows**2, axis=0) < high))
        assert np.max(np.abs(np.corrcoef(rows.T) - np.eye(rows.shape[1]))) < 0.2  # 501 samples: 4.5 deviations


def test_the_covariance_of_the_message_holds(every_source, filter_of):
    """Of the scaled position, and only where there is one."""
    filter, q = filter_of(every_source), _state(every_source, 0)
    half = np.random.default_rng(0).normal(size=(6, 6))
    covariance = half @ half.T + np.eye(6)
    scale = np.diag([1.5] * 3 + [1.0] * 3)
    pose = PoseMeasurement(0, "/arm/pose", np.zeros(3), [1, 0, 0, 0], covariance)
    noise = _see(filter, pose, q).noise
    np.testing.assert_allclose(noise @ noise.T, scale @ covariance @ scale, rtol=1e-13)
    assert np.array_equal(np.triu(noise, 1), np.zeros((6, 6)))
    turn = OrientationMeasurement(0, "/base/imu", [1, 0, 0, 0], covariance[:3, :3])
    np.testing.assert_allclose(np.square(_see(filter, turn, q).noise).sum(), np.trace(covariance[:3, :3]), rtol=1e-13)
    plain = _see(filter, replace(pose, covariance=None), q).noise
    np.testing.assert_allclose(np.diag(plain), [5e-3] * 3 + [np.radians(2.0)] * 3)


def test_markers_not_seen_are_left_out(every_source, filter_of, measured):
    filter, q = filter_of(every_source), _state(every_source, 5)
    whole = measured[2]
    points = whole.points.copy()
    points[1] = np.nan
    part, seen = _see(filter, replace(whole, points=points), q), _see(filter, whole, q)
    keep = [0, 1, 2, 6, 7, 8]
    assert part.y.tolist() == seen.y[keep].tolist()
    assert part.H.tolist() == seen.H[keep].tolist()
    assert part.noise.shape == (6, 6)
    none = _see(filter, replace(whole, points=np.full((3, 3), np.nan)), q)
    assert (none.y.shape, none.H.shape, none.noise.shape) == ((0,), (0, every_source.tree.nv), (0, 0))


@pytest.mark.parametrize(
    ("measurement", "sentence"),
    [
        (
            OrientationMeasurement(0, "/arm/pose", [1, 0, 0, 0]),
            "is a PoseSource: a OrientationMeasurement does not fit",
        ),
        (PointsMeasurement(0, "/markers", np.zeros((2, 3))), "brought 2 points: the scene names 3"),
        (JointsMeasurement(0, "/encoders", ("e1", "knee"), [0, 0]), r"joint 'knee' is not one .* \['e1', 'e2'\]"),
    ],
)
def test_what_does_not_fit_is_named(every_source, filter_of, measurement, sentence):
    with pytest.raises(MeasurementError, match=sentence):
        check(filter_of(every_source).sources[measurement.topic], measurement)
