"""A ball joint as three hinges about y, x and z in turn, for what knows no ball joints: R = Ry(a) Rx(b) Rz(c).

For a person's joints flexion, then ab- or adduction, then axial rotation, ISB's order for hips. It is singular at b = +-90
degrees, as every three angles are somewhere.
"""

import numpy as np

AXES = (("y", np.array([0.0, 1.0, 0.0])), ("x", np.array([1.0, 0.0, 0.0])), ("z", np.array([0.0, 0.0, 1.0])))
"""What the hinges turn about, with what their names end on, as hip_y."""
SINGULAR = 1e-6  # cosine of the middle angle: nearer to it, rates are those at this one


def hinge_names(joint: str) -> tuple[str, ...]:
    """The hinges' names, as the URDF has them."""
    return tuple(f"{joint}_{letter}" for letter, _ in AXES)


def hinge_angles(q: np.ndarray) -> np.ndarray:
    """(..., 3) rad, the hinges' angles at quaternions q (..., 4); the middle one in [-pi/2, pi/2]."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    # column 2 of R is (sin a cos b, -sin b, cos a cos b), row 1 (cos b sin c, cos b cos c, -sin b)
    a = np.arctan2(2.0 * (x * z + w * y), w * w - x * x - y * y + z * z)
    b = np.arcsin(np.clip(2.0 * (w * x - y * z), -1.0, 1.0))
    return np.stack([a, b, np.arctan2(2.0 * (x * y + w * z), w * w - x * x + y * y - z * z)], axis=-1)


def rates_per_omega(angles: np.ndarray) -> np.ndarray:
    """(..., 3, 3) T, the angles' rates per angular velocity in the child's axes: the inverse of ``omega_per_rates``."""
    cos_b, sin_b, cos_c, sin_c = _of_turns(angles)
    out = np.zeros((*angles.shape, 3))
    out[..., 0, 0], out[..., 0, 1] = sin_c / cos_b, cos_c / cos_b
    out[..., 1, 0], out[..., 1, 1] = cos_c, -sin_c
    out[..., 2, 0], out[..., 2, 1], out[..., 2, 2] = sin_b * sin_c / cos_b, sin_b * cos_c / cos_b, 1.0
    return out


def omega_per_rates(angles: np.ndarray) -> np.ndarray:
    """(..., 3, 3) E, the hinges' axes in the child's axes, one a column: omega = E rates; torques are E^T of the ball's own."""
    cos_b, sin_b, cos_c, sin_c = _of_turns(angles)
    out = np.zeros((*angles.shape, 3))
    out[..., 0, 0], out[..., 1, 0], out[..., 2, 0] = cos_b * sin_c, cos_b * cos_c, -sin_b
    out[..., 0, 1], out[..., 1, 1], out[..., 2, 2] = cos_c, -sin_c, 1.0
    return out


def state_derivative(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """(..., 6, 6) of angles and rates by the errors of orientation (about the child's axes) and of omega.

    From omega = E rates: d(omega) = E d(rates) + (dE/d(angles) rates) d(angles), and d(angles) = T times the turn.
    """
    cos_b, sin_b, cos_c, sin_c = _of_turns(angles, 0.0)
    first, second = rates[..., 0], rates[..., 1]
    by_angles = np.zeros((*angles.shape, 3))
    by_angles[..., 0, 1], by_angles[..., 1, 1] = -first * sin_b * sin_c, -first * sin_b * cos_c
    by_angles[..., 2, 1] = -first * cos_b
    by_angles[..., 0, 2] = first * cos_b * cos_c - second * sin_c
    by_angles[..., 1, 2] = -first * cos_b * sin_c - second * cos_c
    T = rates_per_omega(angles)
    out = np.zeros((*angles.shape[:-1], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = T
    out[..., 3:, :3] = -T @ by_angles @ T
    return out


def _of_turns(angles: np.ndarray, singular: float = SINGULAR) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Cosine, of the middle angle no less than a singular one, and sine of the middle angle and of the last."""
    b, c = angles[..., 1], angles[..., 2]
    return np.maximum(np.cos(b), singular), np.sin(b), np.cos(c), np.sin(c)
