"""Measurements are refused where they are made, in one sentence that names the field."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from physics_prior.errors import MeasurementError
from physics_prior.estimation.measurement import (
    JointsMeasurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)

ONE = [1.0, 0.0, 0.0, 0.0]
anything = arrays(float, array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=6), elements=st.floats(width=64))


def test_values_are_copied_and_quaternions_normalised():
    position = np.ones(3)
    measurement = PoseMeasurement(5, "/pose", position, [2, 0, 0, 0], 4 * np.eye(6))
    position[:] = np.nan
    assert measurement.position.tolist() == [1, 1, 1]
    assert measurement.orientation.tolist() == ONE
    assert (measurement.stamp, measurement.topic) == (5, "/pose")


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: PoseMeasurement(0, "", [0, np.nan, 0], ONE), "position .* is not valid: give finite numbers up to 1e"),
        (lambda: PoseMeasurement(0, "", [0, np.inf, 0], ONE), "position .* is not valid: give finite numbers"),
        (lambda: PoseMeasurement(0, "", [0, 2e9, 0], ONE), "position .* is not valid: give finite numbers"),
        (lambda: PoseMeasurement(0, "", [0, 0], ONE), r"position has shape \(2,\): give \(3,\)"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], [0, 0, 0, 0]), "orientation .* finite quaternion that is not zero"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], [np.nan, 0, 0, 1]), "orientation .* finite quaternion"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], [1, 0, 0]), "orientation .* finite quaternion"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], ONE, np.eye(3)), r"covariance has shape \(3, 3\): give \(6, 6\)"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], ONE, np.full((6, 6), np.nan)), "covariance .* give finite numbers"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], ONE, np.triu(np.ones((6, 6)))), "covariance is not symmetric"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], ONE, np.zeros((6, 6))), "diagonal .* give variances above 0"),
        (lambda: PoseMeasurement(0, "", [0, 0, 0], ONE, np.ones((6, 6))), "eigenvalue .* give a positive definite one"),
        (lambda: OrientationMeasurement(0, "", [0, 0, 0, 0]), "orientation"),
        (lambda: OrientationMeasurement(0, "", ONE, -np.eye(3)), "diagonal .* give variances above 0"),
        (lambda: PointsMeasurement(0, "", [1.0, 2.0, 3.0]), r"points have shape \(3,\): give \(n, 3\)"),
        (lambda: PointsMeasurement(0, "", [[0, 0, np.inf]]), "points .* give finite numbers"),
        (lambda: JointsMeasurement(0, "", ("a", "b"), [0.0]), r"positions has shape \(1,\): give \(2,\)"),
        (lambda: JointsMeasurement(0, "", ("a",), [np.nan]), "positions .* give finite numbers"),
        (lambda: JointsMeasurement(0, "", ("a", "a"), [0.0, 1.0]), r"names \['a', 'a'\] .* give each joint once"),
    ],
)
def test_what_is_wrong_is_named(make, sentence):
    with pytest.raises(MeasurementError, match=sentence):
        make()


def test_a_covariance_may_mix_units_far_apart():
    covariance = np.diag([1e12, 1e12, 1e12, 1e-12, 1e-12, 1e-12])
    assert PoseMeasurement(0, "", np.zeros(3), ONE, covariance).covariance is not None


def test_markers_not_seen_stay_nan():
    points = PointsMeasurement(0, "", [[np.nan, np.inf, 0], [1, 2, 3]]).points
    assert np.isnan(points[0, 0])
    assert points[1].tolist() == [1, 2, 3]


@given(anything, anything, anything | st.none())
def test_whatever_comes_is_refused_or_can_be_used(position, orientation, covariance):
    try:
        measurement = PoseMeasurement(0, "", position, orientation, covariance)
    except MeasurementError:
        return
    assert np.isfinite(measurement.position).all()
    assert abs(np.linalg.norm(measurement.orientation) - 1.0) < 1e-15
    if measurement.covariance is not None:
        assert np.isfinite(np.linalg.cholesky(measurement.covariance)).all()


@given(arrays(float, (3, 3), elements=st.floats(width=64)))
def test_whatever_covariance_comes_has_a_factor_or_is_refused(half):
    with np.errstate(all="ignore"):
        covariance = half @ half.T
    try:
        measurement = OrientationMeasurement(0, "", ONE, covariance)
    except MeasurementError:
        return
    assert np.isfinite(np.linalg.cholesky(measurement.covariance)).all()
