"""Rotation vectors, compiled: the exponential map of a ball joint's tangent space, its inverse and their Jacobians.

Source: Sola 2017, "Quaternion kinematics for the error-state Kalman filter", equations in brackets.
"""

import math
from typing import Any

from physics_prior.dynamics.algebra import dots
from physics_prior.dynamics.blocks import at_most, either, root
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.trigonometry import EIGHTH, cosine_of, sine_and_cosine, sine_over
from physics_prior.dynamics.types import Matrix, Vector


@inline_kernel
def exponential(x: Any, y: Any, z: Any) -> tuple[Any, Any, Any, Any]:
    """The unit quaternion of a rotation vector, safe at zero; or those of a block of four."""
    quarter = 0.25 * dots(x, y, z, x, y, z)
    s, cosine = 0.5 * sine_over(quarter), cosine_of(quarter)
    if not at_most(quarter, EIGHTH):
        half = root(quarter)
        sine, other = sine_and_cosine(half)
        s, cosine = either(quarter, EIGHTH, s, 0.5 * sine / half), either(quarter, EIGHTH, cosine, other)
    return cosine, s * x, s * y, s * z


@inline_kernel
def _skew_polynomial(theta: Vector, first: float, second: float) -> Matrix:
    """The matrix I + first [theta]x + second [theta]x^2."""
    x, y, z = theta
    return (
        1.0 - second * (y * y + z * z),
        -first * z + second * x * y,
        first * y + second * x * z,
        first * z + second * x * y,
        1.0 - second * (x * x + z * z),
        -first * x + second * y * z,
        -first * y + second * x * z,
        first * x + second * y * z,
        1.0 - second * (x * x + y * y),
    )


@inline_kernel
def rotation_back(theta: Vector) -> Matrix:
    """The matrix exp(theta)^T: how an error before a turn by theta reads after it."""
    square = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    if square < 1e-8:
        return _skew_polynomial(theta, -1.0 + square / 6.0, 0.5 - square / 24.0)
    angle = math.sqrt(square)
    return _skew_polynomial(theta, -math.sin(angle) / angle, (1.0 - math.cos(angle)) / square)


@inline_kernel
def right_jacobian(theta: Vector) -> Matrix:
    """The right Jacobian of the exponential map (183)."""
    square = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    if square < 1e-6:
        return _skew_polynomial(theta, -0.5 + square / 24.0, 1.0 / 6.0 - square / 120.0)
    angle = math.sqrt(square)
    return _skew_polynomial(theta, -(1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle))


@inline_kernel
def second_coefficient(square: float) -> tuple[float, float]:
    """The coefficient of theta x (theta x omega) in the inverse right Jacobian, and its slope, by the square of the angle.

    (1 - a/2 cot a/2) / a^2 (184), near zero by its series of Bernoulli numbers.
    """
    s = square
    if s < 0.25:
        return (
            1 / 12 + s * (1 / 720 + s * (1 / 30240 + s * (1 / 1209600 + s * (1 / 47900160 + s * 691 / 1307674368000)))),
            1 / 720 + s * (2 / 30240 + s * (3 / 1209600 + s * (4 / 47900160 + s * 3455 / 1307674368000))),
        )
    half = 0.5 * math.sqrt(s)
    cotangent = math.cos(half) / math.sin(half)
    value = (1.0 - half * cotangent) / s
    slope = 0.125 * (half * (1.0 + cotangent * cotangent) - cotangent) / (half * s) - value / s
    return value, slope


@inline_kernel
def inverse_right_jacobian(theta: Vector) -> Matrix:
    """The inverse of the right Jacobian (184): the rate of theta per angular velocity in the turned axes."""
    square = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    return _skew_polynomial(theta, 0.5, second_coefficient(square)[0])


@inline_kernel
def logarithm(w: float, x: float, y: float, z: float) -> Vector:
    """The rotation vector, at most half a turn, of a unit quaternion, safe at zero; q and -q give the same."""
    sign = 1.0 if w >= 0.0 else -1.0
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return sign * 2.0 * x, sign * 2.0 * y, sign * 2.0 * z
    s = sign * 2.0 * math.atan2(size, sign * w) / size
    return s * x, s * y, s * z


@inline_kernel
def vector_of(R: Matrix) -> Vector:
    """The rotation vector, at most half a turn, of a rotation matrix.

    By the row of 4 q q^T with the largest diagonal, which is never small (Shepperd's method).
    """
    trace = R[0] + R[4] + R[8]
    largest = max(trace, R[0], R[4], R[8])
    a, b, c = R[7] - R[5], R[2] - R[6], R[3] - R[1]
    d, e, f = R[1] + R[3], R[2] + R[6], R[5] + R[7]
    if largest == trace:
        w, x, y, z = 1.0 + trace, a, b, c
    elif largest == R[0]:
        w, x, y, z = a, 1.0 + 2.0 * R[0] - trace, d, e
    elif largest == R[4]:
        w, x, y, z = b, d, 1.0 + 2.0 * R[4] - trace, f
    else:
        w, x, y, z = c, e, f, 1.0 + 2.0 * R[8] - trace
    size = math.sqrt(w * w + x * x + y * y + z * z)
    return logarithm(w / size, x / size, y / size, z / size)
