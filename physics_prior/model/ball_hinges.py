"""A ball joint as three hinges about y, x and z in turn, for what knows no ball joints: R = Ry(a) Rx(b) Rz(c).

For a person's joints flexion, then ab- or adduction, then axial rotation, ISB's order for hips. It is singular at b = +-90
degrees, as every three angles are somewhere.
"""

import math

import numpy as np

AXES = (("y", np.array([0.0, 1.0, 0.0])), ("x", np.array([1.0, 0.0, 0.0])), ("z", np.array([0.0, 0.0, 1.0])))
"""What the hinges turn about, with what their names end on, as hip_y."""
SINGULAR = 1e-6  # cosine of the middle angle: nearer to it, rates are those at this one


def hinge_names(joint: str) -> tuple[str, ...]:
    """The hinges' names, as the URDF has them."""
    return tuple(f"{joint}_{letter}" for letter, _ in AXES)


def hinge_angles(q: np.ndarray) -> np.ndarray:
    """(3,) rad, the hinges' angles at the quaternion q (4,); the middle one in [-pi/2, pi/2]."""
    w, x, y, z = q.tolist()
    # column 2 of R is (sin a cos b, -sin b, cos a cos b), row 1 (cos b sin c, cos b cos c, -sin b)
    a = math.atan2(2.0 * (x * z + w * y), w * w - x * x - y * y + z * z)
    b = math.asin(min(max(2.0 * (w * x - y * z), -1.0), 1.0))
    return np.array([a, b, math.atan2(2.0 * (x * y + w * z), w * w - x * x + y * y - z * z)])


def rates_per_omega(angles: np.ndarray) -> np.ndarray:
    """(3, 3) T, the angles' rates per angular velocity in the child's axes: the inverse of ``omega_per_rates``."""
    b, c = angles[1], angles[2]
    cos_b, sin_b, cos_c, sin_c = max(math.cos(b), SINGULAR), math.sin(b), math.cos(c), math.sin(c)
    return np.array(
        [
            [sin_c / cos_b, cos_c / cos_b, 0.0],
            [cos_c, -sin_c, 0.0],
            [sin_b * sin_c / cos_b, sin_b * cos_c / cos_b, 1.0],
        ]
    )


def omega_per_rates(angles: np.ndarray) -> np.ndarray:
    """(3, 3) E, the hinges' axes in the child's axes, one a column: omega = E rates; torques are E^T of the ball's own."""
    b, c = angles[1], angles[2]
    cos_b, sin_b, cos_c, sin_c = max(math.cos(b), SINGULAR), math.sin(b), math.cos(c), math.sin(c)
    return np.array([[cos_b * sin_c, cos_c, 0.0], [cos_b * cos_c, -sin_c, 0.0], [-sin_b, 0.0, 1.0]])


def state_derivative(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """(6, 6) of angles and rates by the errors of orientation (about the child's axes) and of omega.

    From omega = E rates: d(omega) = E d(rates) + (dE/d(angles) rates) d(angles), and d(angles) = T times the turn.
    """
    b, c = angles[1], angles[2]
    cos_b, sin_b, cos_c, sin_c = math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    first, second, _ = rates.tolist()
    by_b = first * np.array([-sin_b * sin_c, -sin_b * cos_c, -cos_b])
    by_c = first * np.array([cos_b * cos_c, -cos_b * sin_c, 0.0]) + second * np.array([-sin_c, -cos_c, 0.0])
    T = rates_per_omega(angles)
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = T
    out[3:, :3] = -T @ np.stack([np.zeros(3), by_b, by_c], axis=1) @ T
    return out
