"""Unit quaternions and rotation vectors.

A quaternion is q = (w, x, y, z) and turns body coordinates into world coordinates; q and -q are the same
rotation. The product o is Hamilton's. All functions but those that take a matrix have leading
batch dimensions. Formulas: the corrected equations 1 and 2 of docs/equations.md; exp, log and the Jacobians
as in Sola, "Quaternion kinematics for the error-state Kalman filter" (2017), sections 2 and 4.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from physics_prior.errors import ModelError

Array = NDArray[np.float64]

SMALLEST_NORM = 1e-100  # shorter quaternions lose their direction: the squares of their components underflow
ROTATION_TOLERANCE = 1e-6  # largest entry of R^T R - I that is still rounding, not a matrix of another kind
SMALL_ANGLE = 1e-4  # below it two terms of a series are exact to rounding, and 0 / 0 never happens


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Product p o q of quaternions, shapes (..., 4): first turn by q, then by p."""
    pw, px, py, pz = np.moveaxis(np.asarray(p, dtype=float), -1, 0)
    qw, qx, qy, qz = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def left_matrix(q: ArrayLike) -> Array:
    """Q(q), shape (..., 4, 4), with Q(q) p = q o p (equation 2)."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return _matrix([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def right_matrix(q: ArrayLike) -> Array:
    """Qbar(q), shape (..., 4, 4), with Qbar(q) p = p o q (equation 2)."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return _matrix([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]])


def conjugate(q: ArrayLike) -> Array:
    """Conjugate (w, -x, -y, -z), shape (..., 4): the inverse rotation of a unit quaternion."""
    return np.multiply(q, [1.0, -1.0, -1.0, -1.0])


def normalize(q: ArrayLike) -> Array:
    """Return the unit quaternion along q, shape (..., 4).

    Raises:
        ModelError: q is zero (shorter than 1e-100) or not finite, so it names no rotation.
    """
    q = np.asarray(q, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.isfinite(norm) & (norm > SMALLEST_NORM)):
        raise ModelError(f"quaternion {q.tolist()} is no rotation: it must be finite and not zero")
    return np.asarray(q / norm)


def exp(rotation_vector: ArrayLike) -> Array:
    """Return the quaternion, shape (..., 4), of a rotation vector, shape (..., 3), axis times angle, rad."""
    rotation_vector = np.asarray(rotation_vector, dtype=float)
    half_angle = 0.5 * np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
    # of the same argument as the cosine: NumPy's sinc rounds its own, by as much as many turns make of it
    zero = half_angle == 0.0
    sine_over = np.where(zero, 1.0, np.sin(half_angle) / np.where(zero, 1.0, half_angle))
    return np.concatenate([np.cos(half_angle), 0.5 * sine_over * rotation_vector], axis=-1)


def log(q: ArrayLike) -> Array:
    """Shortest rotation vector in rad, shape (..., 3) and length <= pi, of a quaternion, shape (..., 4).

    q and -q have the same one, except that a rotation by pi (w = 0) has two, v and -v. The length of q does
    not matter.

    Raises:
        ModelError: q is zero or not finite, as in `normalize`.
    """
    q = normalize(q)
    scalar, vector = q[..., :1], q[..., 1:]
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    zero = sine == 0.0
    # the arc tangent is exact at both ends: the arc cosine of w loses half the digits near w = 1
    angle_over_sine = np.where(zero, 2.0, 2.0 * np.arctan2(sine, np.abs(scalar)) / np.where(zero, 1.0, sine))
    signed = np.where(scalar < 0.0, -angle_over_sine, angle_over_sine)
    return np.asarray(signed * vector)


def matrix_from_quaternion(q: ArrayLike) -> Array:
    """Rotation matrix R(q), shape (..., 3, 3), body to world, of a unit quaternion (equation 1)."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return _matrix(
        [
            [ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), ww - xx + yy - zz, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), ww - xx - yy + zz],
        ]
    )


def require_rotation(R: ArrayLike) -> Array:
    """Return R as an array, shape (3, 3), if it is a rotation matrix to rounding.

    Raises:
        ModelError: R is not a rotation: not finite, R^T R further than 1e-6 from the identity, or mirrored.
    """
    R = np.asarray(R, dtype=float)
    if R.shape != (3, 3) or not np.all(np.isfinite(R)):
        raise ModelError(f"rotation matrix {R.tolist()} is not a finite 3x3 matrix")
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.max(np.abs(R.T @ R - np.eye(3)))
    if not error <= ROTATION_TOLERANCE:
        raise ModelError(f"rotation matrix {R.tolist()} is not orthonormal: R^T R is off by {error:.3g}")
    if np.linalg.det(R) < 0.0:
        raise ModelError(f"rotation matrix {R.tolist()} mirrors: its determinant must be +1, not -1")
    return R


def quaternion_from_matrix(R: ArrayLike) -> Array:
    """Return the unit quaternion, shape (4,), largest component positive, of a rotation matrix, shape (3, 3).

    Equation 1 is linear in the products of the components, so R gives the matrix 4 q q^T; its row with the
    largest diagonal is q times a number that is never small, for any axis and angle (Shepperd's method).

    Raises:
        ModelError: R is not a rotation, as in `require_rotation`.
    """
    R = require_rotation(R)
    products = np.empty((4, 4))
    trace = np.trace(R)
    products[0, 0] = 1.0 + trace
    products[1:, 1:] = R + R.T + (1.0 - trace) * np.eye(3)
    products[0, 1:] = products[1:, 0] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    return normalize(products[np.argmax(np.diag(products))])


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """R(q) v, shape (..., 3): a vector v in body axes seen in world axes, for a unit quaternion q."""
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    twice_cross = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice_cross + np.cross(q[..., 1:], twice_cross)


def skew(v: ArrayLike) -> Array:
    """Matrix [v]x, shape (..., 3, 3), with [v]x u = v x u."""
    x, y, z = np.moveaxis(np.asarray(v, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    return _matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def right_jacobian(rotation_vector: ArrayLike) -> Array:
    """J_r(phi), shape (..., 3, 3), with exp(phi + d) = exp(phi) o exp(J_r d) to first order in d."""
    angle, cross = _angle_and_skew(rotation_vector)
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    first = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # (1 - cos) / angle^2 without its cancellation
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) - first * cross + second * (cross @ cross)


def inverse_right_jacobian(rotation_vector: ArrayLike) -> Array:
    """Inverse of `right_jacobian`, shape (..., 3, 3), for |phi| < 2 pi.

    log(exp(phi) o exp(d)) = phi + J_r^-1 d to first order in d.
    """
    angle, cross = _angle_and_skew(rotation_vector)
    small = angle < SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    second = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2)
    return np.eye(3) + 0.5 * cross + second * (cross @ cross)


def angular_velocity_world(q: ArrayLike, qdot: ArrayLike) -> Array:
    """World-frame angular velocity, rad/s, shape (..., 3): (0; w) = 2 Qbar(q)^T qdot, unit q (equation 2)."""
    return 2.0 * multiply(qdot, conjugate(q))[..., 1:]


def angular_velocity_body(q: ArrayLike, qdot: ArrayLike) -> Array:
    """Body-frame angular velocity, rad/s, shape (..., 3): (0; w') = 2 Q(q)^T qdot, unit q (equation 2)."""
    return 2.0 * multiply(conjugate(q), qdot)[..., 1:]


def derivative(q: ArrayLike, omega_body: ArrayLike) -> Array:
    """Rate qdot = q o (0; w') / 2, 1/s, shape (..., 4), of a body-frame angular velocity, shape (..., 3)."""
    omega_body = np.asarray(omega_body, dtype=float)
    return 0.5 * multiply(q, np.concatenate([np.zeros_like(omega_body[..., :1]), omega_body], axis=-1))


def _matrix(rows: list[list[Array]]) -> Array:
    out = np.empty((*np.shape(rows[0][0]), len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, each in enumerate(row):
            out[..., i, j] = each
    return out


def _angle_and_skew(rotation_vector: ArrayLike) -> tuple[Array, Array]:
    """Length of the rotation vector, shape (..., 1, 1), and its cross product matrix, shape (..., 3, 3)."""
    rotation_vector = np.asarray(rotation_vector, dtype=float)
    return np.linalg.norm(rotation_vector, axis=-1)[..., None, None], skew(rotation_vector)
