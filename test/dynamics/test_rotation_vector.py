"""The compiled rotation vectors against NumPy's, near zero and near half a turn too."""

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.rotation_vector import inverse_right_jacobian, logarithm

ANGLES = [0.0, 1e-12, 1e-8, 9e-4, 1.1e-3, 0.3, 2.0, 3.1, np.pi - 1e-7]


@pytest.mark.parametrize("angle", ANGLES)
def test_logarithm_is_the_inverse_of_the_exponential(angle):
    theta = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    q = rotations.exp(theta)
    for each in (q, -q):
        assert np.allclose(logarithm(*each), theta, rtol=1e-14, atol=1e-15)  # measured 5e-16


@pytest.mark.parametrize("angle", ANGLES)
def test_inverse_right_jacobian(angle):
    theta = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    J = np.reshape(inverse_right_jacobian(tuple(theta)), (3, 3))
    assert np.allclose(J, rotations.inverse_right_jacobian(theta), rtol=0.0, atol=1e-14)
    assert np.allclose(J @ rotations.right_jacobian(theta), np.eye(3), rtol=0.0, atol=1e-13)
