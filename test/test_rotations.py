"""Rotations: group axioms, both ends of exp and log, the corrected equations 1 and 2, SciPy as an oracle."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from physics_prior import rotations
from physics_prior.errors import ModelError

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
AXES = [np.array(axis) / np.linalg.norm(axis) for axis in product((-1.0, 0.0, 1.0), repeat=3) if any(axis)]
NEAR_PI = [0.0, 1e-16, 1e-15, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4]

vectors = arrays(float, 3, elements=st.floats(-10.0, 10.0))
quaternions = arrays(float, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)
unit_quaternions = quaternions.map(rotations.normalize)


def from_scipy(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1)


def to_scipy(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1))


@given(unit_quaternions, unit_quaternions, unit_quaternions)
def test_unit_quaternions_are_a_group(p, q, r):
    left = rotations.multiply(rotations.multiply(p, q), r)
    right = rotations.multiply(p, rotations.multiply(q, r))
    np.testing.assert_allclose(left, right, atol=5e-15)  # 4e-16
    np.testing.assert_array_equal(rotations.multiply(q, IDENTITY), q)
    np.testing.assert_array_equal(rotations.multiply(IDENTITY, q), q)
    np.testing.assert_allclose(rotations.multiply(q, rotations.conjugate(q)), IDENTITY, atol=5e-15)  # 6e-16
    assert abs(np.linalg.norm(left) - 1.0) < 5e-15  # 6e-16


@given(quaternions, quaternions)
def test_left_and_right_matrices_are_the_product(p, q):
    np.testing.assert_allclose(rotations.left_matrix(q) @ p, rotations.multiply(q, p), atol=5e-15)
    np.testing.assert_allclose(rotations.right_matrix(q) @ p, rotations.multiply(p, q), atol=5e-15)


@given(unit_quaternions, unit_quaternions, vectors)
def test_scipy_agrees(p, q, v):
    R = rotations.matrix_from_quaternion(q)
    np.testing.assert_allclose(R, to_scipy(q).as_matrix(), atol=1e-14)  # 7e-16
    np.testing.assert_allclose(rotations.rotate(q, v), to_scipy(q).apply(v), atol=1e-13)  # 1e-14
    np.testing.assert_allclose(
        rotations.matrix_from_quaternion(rotations.multiply(p, q)),
        (to_scipy(p) * to_scipy(q)).as_matrix(),
        atol=1e-14,
    )
    back = rotations.quaternion_from_matrix(R)
    assert min(np.max(np.abs(back - q)), np.max(np.abs(back + q))) < 5e-15  # 3e-16


@given(vectors)
def test_exp_and_log_agree_with_scipy(v):
    np.testing.assert_allclose(
        rotations.matrix_from_quaternion(rotations.exp(v)), Rotation.from_rotvec(v).as_matrix(), atol=1e-14
    )
    shortest = rotations.log(rotations.exp(v))
    assert np.linalg.norm(shortest) <= np.pi
    if np.linalg.norm(v) < np.pi:
        np.testing.assert_allclose(shortest, v, atol=1e-14)  # 4e-16


def test_corrected_matrix_and_not_the_printed_one():
    """Equation 1: R13 = 2 (xz + wy). The printed 2 (xz - wy) is no rotation."""
    q = from_scipy(Rotation.from_euler("y", 30.0, degrees=True))
    w, x, y, z = q
    corrected = rotations.matrix_from_quaternion(q)
    printed = corrected.copy()
    printed[0, 2] = 2.0 * (x * z - w * y)
    assert corrected[0, 2] == pytest.approx(0.5, abs=5e-15)  # sin 30 degrees: z tips towards +x
    np.testing.assert_allclose(corrected.T @ corrected, np.eye(3), atol=5e-15)
    assert np.max(np.abs(printed.T @ printed - np.eye(3))) > 0.8  # 0.87
    with pytest.raises(ModelError, match="not orthonormal"):
        rotations.quaternion_from_matrix(printed)


@pytest.mark.parametrize("distance", NEAR_PI)
def test_log_and_exp_near_pi_on_all_axes(distance):
    for axis in AXES:
        v = (np.pi - distance) * axis
        R = rotations.matrix_from_quaternion(rotations.exp(v))
        back = rotations.log(rotations.quaternion_from_matrix(R))
        again = rotations.matrix_from_quaternion(rotations.exp(back))
        assert np.max(np.abs(again - R)) < 1e-12  # 7e-16
        # at pi itself v and -v are the same rotation, and pi - 1e-16 is pi in float64
        error = min(np.linalg.norm(back - v), np.linalg.norm(back + v) if distance < 1e-15 else np.inf)
        assert error < 1e-9  # 9e-16
        assert np.linalg.norm(back) <= np.pi * (1.0 + 2e-16)


@pytest.mark.parametrize("length", [0.0, 1e-300, 1e-170, 1e-160, 1e-100, 1e-16, 1e-8, 1e-4, 0.1])
def test_exp_and_log_near_zero(length):
    for axis in AXES:
        v = length * axis
        q = rotations.exp(v)
        assert np.all(np.isfinite(q))
        np.testing.assert_allclose(rotations.log(q), v, rtol=1e-14, atol=0.0)
        np.testing.assert_allclose(rotations.log(-q), v, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("length", [1e2, 14134.4, 1e6, 1e9])
def test_exp_of_many_turns_is_a_rotation(length):
    for axis in AXES:
        assert abs(np.linalg.norm(rotations.exp(length * axis)) - 1.0) < 1e-15  # 2e-16


@given(unit_quaternions, vectors)
def test_a_quaternion_and_its_negative_are_one_rotation(q, v):
    np.testing.assert_array_equal(rotations.matrix_from_quaternion(q), rotations.matrix_from_quaternion(-q))
    np.testing.assert_allclose(rotations.rotate(q, v), rotations.rotate(-q, v), atol=1e-14)
    if q[0] != 0.0:
        np.testing.assert_array_equal(rotations.log(q), rotations.log(-q))


@pytest.mark.parametrize("size", [1e-16, 1e-14, 1e-12, 1e-10, 1e-8])
def test_matrices_slightly_off_are_accepted(size):
    rng = np.random.default_rng(0)
    for axis, angle in product(AXES, (0.0, 1e-8, 1.0, np.pi - 1e-8, np.pi)):
        R = rotations.matrix_from_quaternion(rotations.exp(angle * axis))
        q = rotations.quaternion_from_matrix(R + size * rng.uniform(-1.0, 1.0, (3, 3)))
        v = rotations.log(q)
        assert np.all(np.isfinite(v))
        assert abs(np.linalg.norm(q) - 1.0) < 5e-15  # 2e-16
        assert np.max(np.abs(rotations.matrix_from_quaternion(q) - R)) < 4.0 * size + 1e-14  # 1.6 size


@pytest.mark.parametrize(
    ("matrix", "complaint"),
    [
        (np.diag([1.0, 1.0, -1.0]), "mirrors"),
        (2.0 * np.eye(3), "not orthonormal"),
        (np.zeros((3, 3)), "not orthonormal"),
        (np.full((3, 3), 1e300), "not orthonormal"),
        (np.full((3, 3), np.nan), "not a finite 3x3 matrix"),
        (np.eye(4), "not a finite 3x3 matrix"),
    ],
)
def test_matrices_that_are_no_rotations_are_refused(matrix, complaint):
    with pytest.raises(ModelError, match=complaint):
        rotations.quaternion_from_matrix(matrix)


@given(quaternions)
def test_normalize_has_unit_length_and_changes_no_direction(q):
    unit = rotations.normalize(q)
    assert abs(np.linalg.norm(unit) - 1.0) < 5e-15  # 2e-16
    np.testing.assert_allclose(unit * np.linalg.norm(q), q, atol=5e-15)
    np.testing.assert_allclose(rotations.log(1.001 * unit), rotations.log(unit), atol=1e-14)


@pytest.mark.parametrize(
    "q",
    [
        np.zeros(4),
        np.full(4, 1e-200),
        np.full(4, 1e300),
        [np.nan, 0, 0, 1],
        [1, np.inf, 0, 0],
        [IDENTITY, 0 * IDENTITY],
    ],
)
def test_quaternions_that_are_no_rotations_are_refused(q):
    for function in (rotations.normalize, rotations.log):
        with pytest.raises(ModelError, match="finite and not zero"):
            function(q)


def right_jacobian_by_differences(v: np.ndarray, step: float) -> np.ndarray:
    inverse = rotations.conjugate(rotations.exp(v))
    columns = [
        rotations.log(rotations.multiply(inverse, rotations.exp(v + step * e)))
        - rotations.log(rotations.multiply(inverse, rotations.exp(v - step * e)))
        for e in np.eye(3)
    ]
    return np.stack(columns, axis=-1) / (2.0 * step)


@given(vectors)
def test_right_jacobian_is_the_derivative_of_exp(v):
    np.testing.assert_allclose(rotations.right_jacobian(v), right_jacobian_by_differences(v, 1e-5), atol=1e-9)  # 2e-10


@pytest.mark.parametrize("length", [0.0, 1e-300, 1e-8, 0.99e-4, 1.01e-4, 1e-3, 1.0, 3.0, np.pi, 5.0])
def test_jacobians_are_inverse_and_smooth_where_the_series_takes_over(length):
    for axis in AXES:
        v = length * axis
        J = rotations.right_jacobian(v)
        np.testing.assert_allclose(J @ rotations.inverse_right_jacobian(v), np.eye(3), atol=1e-14)  # 1e-15
        # J_r = sum_k (-[v]x)^k / (k + 1)!
        term = series = np.eye(3)
        for k in range(1, 60):
            term = term @ -rotations.skew(v) / (k + 1)
            series = series + term
        np.testing.assert_allclose(J, series, atol=1e-13)  # 7e-16


@given(vectors, vectors)
def test_skew_is_the_cross_product(u, v):
    np.testing.assert_allclose(rotations.skew(u) @ v, np.cross(u, v), atol=1e-13)


@given(unit_quaternions, vectors)
def test_angular_velocity_and_derivative_are_inverse(q, omega_body):
    """Equation 2: (0; w') = 2 Q(q)^T qdot and (0; w) = 2 Qbar(q)^T qdot."""
    qdot = rotations.derivative(q, omega_body)
    np.testing.assert_allclose(2.0 * rotations.left_matrix(q).T @ qdot, [0.0, *omega_body], atol=1e-13)
    np.testing.assert_allclose(rotations.angular_velocity_body(q, qdot), omega_body, atol=1e-13)  # 5e-15
    omega_world = rotations.angular_velocity_world(q, qdot)
    np.testing.assert_allclose(2.0 * rotations.right_matrix(q).T @ qdot, [0.0, *omega_world], atol=1e-13)
    np.testing.assert_allclose(omega_world, rotations.rotate(q, omega_body), atol=1e-13)  # 7e-15


@given(unit_quaternions, vectors)
def test_derivative_is_the_rate_of_a_turning_body(q, omega_body):
    step = 1e-5
    ahead = rotations.multiply(q, rotations.exp(step * omega_body))
    behind = rotations.multiply(q, rotations.exp(-step * omega_body))
    np.testing.assert_allclose(
        rotations.derivative(q, omega_body), (ahead - behind) / (2.0 * step), atol=1e-6
    )  # 8e-9 at |w| = 17 rad/s


def test_batches_equal_single_calls():
    rng = np.random.default_rng(1)
    p, q = rotations.normalize(rng.normal(size=(2, 5, 6, 4)))
    v = rng.normal(size=(5, 6, 3))
    for function, arguments in [
        (rotations.multiply, (p, q)),
        (rotations.left_matrix, (q,)),
        (rotations.right_matrix, (q,)),
        (rotations.conjugate, (q,)),
        (rotations.normalize, (q,)),
        (rotations.exp, (v,)),
        (rotations.log, (q,)),
        (rotations.matrix_from_quaternion, (q,)),
        (rotations.rotate, (q, v)),
        (rotations.skew, (v,)),
        (rotations.right_jacobian, (v,)),
        (rotations.inverse_right_jacobian, (v,)),
        (rotations.angular_velocity_world, (q, p)),
        (rotations.angular_velocity_body, (q, p)),
        (rotations.derivative, (q, v)),
    ]:
        batch = function(*arguments)
        single = function(*(argument[2, 3] for argument in arguments))
        np.testing.assert_allclose(batch[2, 3], single, rtol=1e-14, atol=1e-16, err_msg=function.__name__)


def test_repeated_products_stay_unit_and_keep_their_angle():
    step = rotations.exp([0.01, -0.02, 0.03])
    q = IDENTITY
    for _ in range(2000):
        q = rotations.normalize(rotations.multiply(q, step))
    assert abs(np.linalg.norm(q) - 1.0) < 5e-15  # 0
    expected = rotations.exp(2000 * np.array([0.01, -0.02, 0.03]))
    angle = np.linalg.norm(rotations.log(rotations.multiply(rotations.conjugate(expected), q)))
    assert angle < 1e-12  # 5e-15
