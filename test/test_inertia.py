"""Mass properties: closed forms against integrals, parallel axes, composites, impossible inertias."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from physics_prior import inertia, rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties

positions = arrays(float, 3, elements=st.floats(-2.0, 2.0))
rotation_vectors = arrays(float, 3, elements=st.floats(-3.0, 3.0))
bodies = st.builds(
    lambda points, masses: inertia.combine(map(inertia.point_mass, masses, points)),
    st.lists(positions, min_size=4, max_size=4),
    st.lists(st.floats(0.1, 2.0), min_size=4, max_size=4),
)


def ball(points: np.ndarray, radius: float) -> np.ndarray:
    return np.sum(points**2, axis=1) <= radius**2


SOLIDS = {
    "box": (inertia.box(2.0, [0.2, 0.3, 0.4]), lambda p: np.all(np.abs(p) <= [0.1, 0.15, 0.2], axis=1)),
    "sphere": (inertia.sphere(2.0, 0.15), lambda p: ball(p, 0.15)),
    "ellipsoid": (inertia.ellipsoid(2.0, [0.1, 0.15, 0.2]), lambda p: ball(p / [0.1, 0.15, 0.2], 1.0)),
    "cylinder": (
        inertia.cylinder(2.0, 0.1, 0.35),
        lambda p: (np.hypot(p[:, 0], p[:, 1]) <= 0.1) & (np.abs(p[:, 2]) <= 0.175),
    ),
    "capsule": (
        inertia.capsule(2.0, 0.1, 0.2),
        lambda p: ball(np.stack([p[:, 0], p[:, 1], np.maximum(np.abs(p[:, 2]) - 0.1, 0.0)], axis=1), 0.1),
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_closed_forms_equal_the_integral_over_the_solid(name):
    body, inside = SOLIDS[name]
    integrated = inertia.from_density(inside, [-0.25] * 3, [0.25] * 3, cells=40).scaled(body.mass)
    np.testing.assert_allclose(integrated.center_of_mass, body.center_of_mass, atol=1e-15)
    scale = np.max(body.inertia)
    np.testing.assert_allclose(integrated.inertia, body.inertia, atol=2e-3 * scale)  # 1.0e-3 (sphere)


def test_mass_of_an_integrated_ball_is_as_accurate_as_stated():
    density, radius = 1000.0, 0.1
    mass = density * 4.0 / 3.0 * np.pi * radius**3
    body = inertia.from_density(lambda p: density * ball(p, radius), [-0.12] * 3, [0.11, 0.12, 0.13])
    assert abs(body.mass / mass - 1.0) < 2e-4  # 1.5e-4
    moment = inertia.sphere(mass, radius).inertia[0, 0]
    np.testing.assert_allclose(body.inertia, moment * np.eye(3), atol=3e-4 * moment)  # 2.5e-4


def test_polynomial_density_is_exact_in_a_single_cell():
    """rho = 1 + x^3 over [0, 1]^3, moments by hand; the box is moved far away, where moments would cancel."""
    far = np.array([1e4, -2e4, 3e4])
    body = inertia.from_density(lambda p: 1.0 + (p[:, 0] - far[0]) ** 3, far, far + 1.0, cells=1)
    mass, x, xx = 1.25, 0.5 + 0.2, 1.0 / 3.0 + 1.0 / 6.0  # integrals of rho, rho x and rho x^2
    assert body.mass == pytest.approx(mass, rel=1e-11)  # 1e-13
    np.testing.assert_allclose(body.center_of_mass - far, [x / mass, 0.5, 0.5], atol=1e-11)  # 5e-13
    along_x, along_y = xx - x**2 / mass, mass / 12.0
    expected = np.diag([2.0 * along_y, along_x + along_y, along_x + along_y])
    np.testing.assert_allclose(body.inertia, expected, atol=1e-11)  # 2e-14


def test_rod_is_the_thin_limit_of_cylinder_and_box():
    rod = inertia.rod(3.0, 2.0).inertia
    np.testing.assert_allclose(rod, np.diag([1.0, 1.0, 0.0]))
    np.testing.assert_allclose(inertia.cylinder(3.0, 1e-9, 2.0).inertia, rod, atol=1e-15)
    np.testing.assert_allclose(inertia.box(3.0, [1e-9, 1e-9, 2.0]).inertia, rod, atol=1e-15)


def test_limits_of_a_capsule_are_a_sphere_and_a_rod():
    np.testing.assert_allclose(inertia.capsule(2.0, 0.3, 1e-15).inertia, inertia.sphere(2.0, 0.3).inertia)
    np.testing.assert_allclose(inertia.capsule(2.0, 1e-15, 0.3).inertia, inertia.rod(2.0, 0.3).inertia, atol=1e-16)


@given(st.lists(positions, min_size=1, max_size=6), positions)
def test_parallel_axes_and_composites_are_sums_over_points(points, about):
    """Sum of m (r.r I - r r^T) over all points, about any point."""
    body = inertia.combine([inertia.point_mass(i + 1.0, point) for i, point in enumerate(points)])
    expected = sum(
        (i + 1.0) * -rotations.skew(point - about) @ rotations.skew(point - about) for i, point in enumerate(points)
    )
    np.testing.assert_allclose(body.about(about), expected, atol=1e-11)  # 1e-13


def test_composite_of_two_half_boxes_is_the_box():
    half = inertia.box(1.0, [0.2, 0.3, 0.2])
    halves = [half.transformed(np.eye(3), [0.0, 0.0, z]) for z in (-0.1, 0.1)]
    whole = inertia.combine(halves)
    assert whole.mass == 2.0
    np.testing.assert_allclose(whole.inertia, inertia.box(2.0, [0.2, 0.3, 0.4]).inertia, atol=1e-16)


def test_composite_of_massless_bodies_is_massless():
    nothing = inertia.combine([inertia.point_mass(0.0, [1.0, 2.0, 3.0])])
    assert nothing.mass == 0.0
    np.testing.assert_array_equal(nothing.inertia, np.zeros((3, 3)))


@given(bodies, rotation_vectors, positions)
def test_transformed_keeps_principal_moments_and_moves_the_centre(body, rotation_vector, translation):
    R = rotations.matrix_from_quaternion(rotations.exp(rotation_vector))
    moved = body.transformed(R, translation)
    np.testing.assert_allclose(moved.center_of_mass, R @ body.center_of_mass + translation, atol=1e-14)
    # about a point that moves along, the inertia only turns
    np.testing.assert_allclose(moved.about(translation), R @ body.about(np.zeros(3)) @ R.T, atol=1e-12)  # 4e-14
    back = moved.transformed(R.T, -R.T @ translation)
    np.testing.assert_allclose(back.inertia, body.inertia, atol=1e-11)  # 2e-13
    np.testing.assert_allclose(back.center_of_mass, body.center_of_mass, atol=1e-13)  # 2e-15


def test_moments_below_the_normal_numbers_are_none():
    # found by drawing: 0, 9.91677e-318, 9.91679e-318 are equal but for their few bits
    MassProperties(1.0, np.zeros(3), np.diag([0.0, 9.91677e-318, 9.91679e-318]))


@given(bodies)
def test_principal_axes_diagonalise_the_inertia(body):
    moments, q = body.principal_axes()
    R = rotations.matrix_from_quaternion(q)
    scale = max(1.0, np.max(body.inertia))
    np.testing.assert_allclose(R @ np.diag(moments) @ R.T, body.inertia, atol=1e-13 * scale)  # 2e-15
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    assert np.all(moments >= 0.0)
    again = body.principal_axes()
    np.testing.assert_array_equal(again[0], moments)
    np.testing.assert_array_equal(again[1], q)


@pytest.mark.parametrize("moments", [(1.0, 2.0, 2.5), (2.5, 1.0, 2.0), (2.0, 2.0, 1.0), (1.0, 1.0, 1.0), (0, 0, 0)])
def test_diagonal_inertia_keeps_its_axes(moments):
    found, q = MassProperties(1.0, np.zeros(3), np.diag(moments)).principal_axes()
    np.testing.assert_allclose(found, moments, atol=1e-15)
    np.testing.assert_allclose(q, [1.0, 0.0, 0.0, 0.0], atol=1e-15)


def test_scaled_changes_the_mass_only():
    body = inertia.box(2.0, [0.2, 0.3, 0.4]).transformed(np.eye(3), [1.0, 0.0, 0.0])
    heavier = body.scaled(6.0)
    np.testing.assert_allclose(heavier.inertia, 3.0 * body.inertia)
    np.testing.assert_array_equal(heavier.center_of_mass, body.center_of_mass)
    with pytest.raises(ModelError, match="massless body cannot be scaled to 1 kg"):
        inertia.point_mass(0.0).scaled(1.0)


def test_arrays_are_copied_and_read_only():
    given_inertia = np.eye(3)
    body = MassProperties(1.0, np.zeros(3), given_inertia)
    given_inertia[0, 0] = 9.0
    assert body.inertia[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        body.inertia[0, 0] = 2.0


@pytest.mark.parametrize(
    ("mass", "moments"),
    [
        (1.0, (0.0, 0.0, 0.0)),  # a point
        (0.0, (0.0, 0.0, 0.0)),  # nothing
        (1.0, (1.0, 1.0, 0.0)),  # a thin rod
        (1.0, (1.0, 1.0, 2.0)),  # a thin plate
        (1.0, (1.0, 1.0, 2.000001)),  # the same, its digits rounded
        (1e-9, (1e-18, 1e-18, 1e-30)),  # tiny and slender
        (1e20, (1e25, 1e25, 1e25)),
    ],
)
def test_valid_bodies_are_accepted(mass, moments):
    body = MassProperties(mass, np.zeros(3), np.diag(moments))
    np.testing.assert_array_equal(body.inertia, np.diag(moments))


ASYMMETRIC = [[1.0, 0.1, 0.0], [0.2, 1.0, 0.0], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("mass", "center_of_mass", "moments", "complaint"),
    [
        (-1.0, np.zeros(3), np.eye(3), "mass -1 kg is negative"),
        (0.0, np.zeros(3), np.eye(3), "mass is zero but inertia is"),
        (np.nan, np.zeros(3), np.eye(3), "mass nan is not valid: give a finite number"),
        ("heavy", np.zeros(3), np.eye(3), "mass 'heavy' is not valid"),
        (1.0, [0.0, np.inf, 0.0], np.eye(3), r"center_of_mass \[0.0, inf, 0.0\] is not valid"),
        (1.0, np.zeros(2), np.eye(3), "center_of_mass"),
        (1.0, np.zeros(3), np.full((3, 3), np.nan), "inertia"),
        (
            1.0,
            np.zeros(3),
            np.ones(3),
            r"inertia \[1.0, 1.0, 1.0\] is not valid: give \(3, 3\) finite numbers",
        ),
        (1.0, np.zeros(3), ASYMMETRIC, "not symmetric: it is off by 0.1"),
        (1.0, np.zeros(3), np.diag([1.0, 1.0, 2.1]), r"moments 1, 1, 2.1 .* triangle inequality: .* here 2$"),
        (1.0, np.zeros(3), np.diag([1.0, -0.1, 1.0]), "moments -0.1, 1, 1 .* not positive semi-definite"),
        (1.0, np.zeros(3), np.diag([1e-12, 0.0, 0.0]), "triangle inequality"),
    ],
)
def test_invalid_bodies_are_refused_by_name(mass, center_of_mass, moments, complaint):
    with pytest.raises(ModelError, match=complaint):
        MassProperties(mass, center_of_mass, moments)


@pytest.mark.parametrize(
    ("build", "complaint"),
    [
        (lambda: inertia.box(1.0, [1.0, 0.0, 1.0]), r"box size \[1.0, 0.0, 1.0\] m is not valid"),
        (lambda: inertia.box(1.0, [1.0, 1.0]), "box size"),
        (lambda: inertia.sphere(1.0, -0.1), "sphere radius -0.1 m"),
        (lambda: inertia.ellipsoid(1.0, [1.0, np.nan, 1.0]), "ellipsoid semi_axes"),
        (lambda: inertia.cylinder(1.0, 0.1, np.inf), "cylinder length inf"),
        (lambda: inertia.capsule(1.0, 0.0, 1.0), "capsule radius"),
        (lambda: inertia.rod(1.0, 0.0), "rod length"),
        (
            lambda: inertia.sphere(1.0, 1e200),
            "sphere radius 1e\\+200 is not valid: give a finite number up to 1e60",
        ),
        (lambda: inertia.box(1.0, [1e40, 1.0, 1.0]), r"inertia \[.*\] is not valid"),
        (lambda: inertia.sphere(1.0, 0.1).transformed(2.0 * np.eye(3), np.zeros(3)), "not orthonormal"),
        (lambda: inertia.sphere(1.0, 0.1).about([np.nan, 0.0, 0.0]), "point"),
    ],
)
def test_invalid_shapes_are_refused_by_name(build, complaint):
    with pytest.raises(ModelError, match=complaint):
        build()


@pytest.mark.parametrize(
    ("density", "upper", "cells", "complaint"),
    [
        (lambda p: np.ones(len(p)), [1.0, 0.0, 1.0], 4, "lower must be below upper"),
        (lambda p: np.ones(len(p)), np.ones(3), 0, "cells 0 is out of range: give 1 to 128"),
        (lambda p: np.ones(len(p)), np.ones(3), 10**9, "cells 1000000000 is out of range"),
        (lambda p: np.zeros(len(p)), np.ones(3), 4, "density is zero in the whole box"),
        (lambda p: p[:, 0] - 0.5, np.ones(3), 4, "is negative"),
        (lambda p: np.full(len(p), np.nan), np.ones(3), 4, r"density of shape \(144,\) is not valid"),
        (lambda p: np.ones(3), np.ones(3), 4, r"density \[1.0, 1.0, 1.0\] is not valid"),
    ],
)
def test_invalid_densities_are_refused_by_name(density, upper, cells, complaint):
    with pytest.raises(ModelError, match=complaint):
        inertia.from_density(density, np.zeros(3), upper, cells)
