"""Mass, centre of mass and inertia of rigid bodies: shapes, composites and densities."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from physics_prior import rotations
from physics_prior.errors import ModelError

Array = NDArray[np.float64]

INERTIA_TOLERANCE = 1e-6  # of the largest entry: what rounded digits in a model file may do to a valid inertia
LARGEST_NUMBER = 1e60  # beyond any body in SI units, and far from where products of three overflow
GAUSS_POINTS = 3  # per cell and axis: integrates polynomials up to degree 5
MAXIMUM_CELLS = 128  # per axis: at most 57 million evaluations, in slabs of at most 147 456 points


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass properties of a rigid body, in the axes of the frame that they are given in; read-only arrays.

    Attributes:
        mass: kg, >= 0.
        center_of_mass: (3,) m, in that frame.
        inertia: (3, 3) kg m^2, about the CENTRE OF MASS. Zero is a point mass, if the mass is not zero.

    Raises:
        ModelError: a value is not finite or above 1e60; the mass is negative, or zero with an inertia; the
            inertia is not symmetric, or its principal moments are not those of a body: one is negative, or
            larger than the sum of the other two (each within 1e-6 of the largest moment).
    """

    mass: float
    center_of_mass: Array
    inertia: Array

    def __post_init__(self) -> None:
        mass = float(_finite("mass", self.mass, ()))
        center_of_mass = _finite("center_of_mass", self.center_of_mass, (3,))
        inertia = _finite("inertia", self.inertia, (3, 3))
        if mass < 0.0:
            raise ModelError(f"mass {mass:g} kg is negative: a body has a mass of zero or more")
        if mass == 0.0 and np.any(inertia):
            raise ModelError(f"mass is zero but inertia is {inertia.tolist()} kg m^2: a massless body has none")
        asymmetry = np.max(np.abs(inertia - inertia.T))
        if asymmetry > INERTIA_TOLERANCE * np.max(np.abs(inertia)):
            raise ModelError(f"inertia {inertia.tolist()} kg m^2 is not symmetric: it is off by {asymmetry:g}")
        inertia = 0.5 * inertia + 0.5 * inertia.T
        _require_moments_of_a_body(np.linalg.eigvalsh(inertia))
        for name, array in (("center_of_mass", center_of_mass), ("inertia", inertia)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "mass", mass)

    def about(self, point: ArrayLike) -> Array:
        """Inertia about a point, (3,) m, in the same frame: (3, 3) kg m^2 (parallel axis theorem)."""
        offset = _finite("point", point, (3,)) - self.center_of_mass
        return self.inertia + self.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))

    def transformed(self, rotation: ArrayLike, translation: ArrayLike) -> "MassProperties":
        """Return the same body seen from another frame, in which a point x becomes R x + t.

        rotation: R, (3, 3); translation: t, (3,) m. Raises ModelError if R is not a rotation.
        """
        R = rotations.require_rotation(rotation)
        center_of_mass = R @ self.center_of_mass + _finite("translation", translation, (3,))
        return MassProperties(self.mass, center_of_mass, R @ self.inertia @ R.T)

    def principal_axes(self) -> tuple[Array, Array]:
        """Return principal moments, (3,) kg m^2, and the quaternion, (4,), from principal axes to the frame.

        Of the 24 right-handed choices it is the one closest to the frame: a diagonal inertia keeps its axes.
        """
        vectors = np.linalg.eigh(self.inertia)[1]
        choices = [
            vectors[:, order] * signs for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3)
        ]
        # rounded, so that ties are settled by the order of the choices and not by the last bit
        axes = max((R for R in choices if np.linalg.det(R) > 0.0), key=lambda R: round(float(np.trace(R)), 9))
        moments = np.diag(axes.T @ self.inertia @ axes)
        return np.maximum(moments, 0.0), rotations.quaternion_from_matrix(axes)

    def scaled(self, mass: float) -> "MassProperties":
        """Return the same distribution of another mass, kg; ModelError if the body is massless now."""
        if self.mass == 0.0:
            raise ModelError(f"a massless body cannot be scaled to {mass:g} kg: it has no distribution of mass")
        return MassProperties(mass, self.center_of_mass, self.inertia * (mass / self.mass))


def point_mass(mass: float, position: ArrayLike = (0.0, 0.0, 0.0)) -> MassProperties:
    """All mass, kg, in one point at position, (3,) m."""
    return MassProperties(mass, np.asarray(position, dtype=float), np.zeros((3, 3)))


def box(mass: float, size: ArrayLike) -> MassProperties:
    """Uniform box about the origin; mass kg, size: edge lengths, (3,) m."""
    x, y, z = _positive("box size", size, (3,)) ** 2
    return _centered(mass, (y + z) / 12.0, (z + x) / 12.0, (x + y) / 12.0)


def ellipsoid(mass: float, semi_axes: ArrayLike) -> MassProperties:
    """Uniform ellipsoid about the origin; mass kg, semi_axes: (3,) m."""
    x, y, z = _positive("ellipsoid semi_axes", semi_axes, (3,)) ** 2
    return _centered(mass, (y + z) / 5.0, (z + x) / 5.0, (x + y) / 5.0)


def sphere(mass: float, radius: float) -> MassProperties:
    """Uniform ball about the origin; mass kg, radius m."""
    moment = 0.4 * float(_positive("sphere radius", radius, ())) ** 2
    return _centered(mass, moment, moment, moment)


def cylinder(mass: float, radius: float, length: float) -> MassProperties:
    """Uniform cylinder about the origin, its axis along z; mass kg, radius and length m."""
    radius = float(_positive("cylinder radius", radius, ()))
    length = float(_positive("cylinder length", length, ()))
    across = radius**2 / 4.0 + length**2 / 12.0
    return _centered(mass, across, across, radius**2 / 2.0)


def capsule(mass: float, radius: float, length: float) -> MassProperties:
    """Uniform capsule about the origin, its axis along z; mass kg, radius m.

    length is that of the cylindrical part, m: the capsule is length + 2 radius long.
    """
    radius = float(_positive("capsule radius", radius, ()))
    length = float(_positive("capsule length", length, ()))
    caps = (4.0 / 3.0 * radius) / (length + 4.0 / 3.0 * radius)  # share of the volume
    across = (1.0 - caps) * (radius**2 / 4.0 + length**2 / 12.0)
    # a half ball has its centre of mass 3/8 r beyond its flat side, and 2/5 m r^2 about that side's centre
    across += caps * (0.4 * radius**2 + 0.375 * radius * length + 0.25 * length**2)
    along = (1.0 - caps) * radius**2 / 2.0 + caps * 0.4 * radius**2
    return _centered(mass, across, across, along)


def rod(mass: float, length: float) -> MassProperties:
    """Uniform thin rod about the origin, along z; mass kg, length m."""
    across = float(_positive("rod length", length, ())) ** 2 / 12.0
    return _centered(mass, across, across, 0.0)


def combine(bodies: Iterable[MassProperties]) -> MassProperties:
    """One rigid body made of several, all given in the same frame; massless at the origin if all are."""
    bodies = list(bodies)
    mass = sum(body.mass for body in bodies)
    if mass == 0.0:
        return point_mass(0.0)
    center_of_mass = sum((body.mass / mass * body.center_of_mass for body in bodies), np.zeros(3))
    inertia = sum((body.about(center_of_mass) for body in bodies), np.zeros((3, 3)))
    return MassProperties(mass, center_of_mass, inertia)


def from_density(
    density: Callable[[Array], Array], lower: ArrayLike, upper: ArrayLike, cells: int = 32
) -> MassProperties:
    """Integrate a density over a box, by Gauss-Legendre quadrature with three points a cell and axis.

    Exact for densities that are polynomials up to degree 3 in each coordinate. Elsewhere the error falls with
    the sixth power of the cell size where the density is smooth, and a little faster than linearly where it
    jumps: a ball that fills most of its box is right to about 1e-3 with 32 cells.

    Args:
        density: maps points, (n, 3) m, to densities, (n,) kg/m^3, finite and >= 0.
        lower: (3,) m, corner of the box with the smallest coordinates.
        upper: (3,) m, corner of the box with the largest coordinates.
        cells: per axis, 1 to 128; memory stays below 30 MB besides what the density itself takes.

    Raises:
        ModelError: corners not in order, cells out of range, a density of wrong shape, not finite, negative
            or zero everywhere.
    """
    lower, upper = _finite("lower", lower, (3,)), _finite("upper", upper, (3,))
    if not np.all(lower < upper):
        raise ModelError(f"box from {lower.tolist()} to {upper.tolist()} is empty: lower must be below upper")
    if not 1 <= cells <= MAXIMUM_CELLS:
        raise ModelError(f"cells {cells} is out of range: give 1 to {MAXIMUM_CELLS} per axis")
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    fractions = ((np.arange(cells)[:, None] + 0.5 + 0.5 * nodes) / cells).ravel() - 0.5
    weights = np.tile(0.5 * weights / cells, cells)
    # coordinates from the middle of the box: far from the origin the second moments would cancel
    middle, size = 0.5 * (lower + upper), upper - lower
    x, y, z = (fractions * edge for edge in size)
    slab = np.stack([grid.ravel() for grid in np.meshgrid(0.0, y, z, indexing="ij")], axis=-1)
    slab_weights = np.prod(size) * np.outer(weights, weights).ravel()
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for x_i, weight in zip(x, weights, strict=True):
        slab[:, 0] = x_i
        masses = weight * slab_weights * _densities(density, slab + middle)
        mass += float(np.sum(masses))
        first += masses @ slab
        second += (slab.T * masses) @ slab
    if mass <= 0.0:
        raise ModelError(f"density is zero in the whole box from {lower.tolist()} to {upper.tolist()}")
    offset = first / mass
    second -= mass * np.outer(offset, offset)
    return MassProperties(mass, middle + offset, np.trace(second) * np.eye(3) - second)


def _centered(mass: float, *moments_per_mass: float) -> MassProperties:
    return MassProperties(mass, np.zeros(3), mass * np.diag(moments_per_mass))


def _densities(density: Callable[[Array], Array], points: Array) -> Array:
    values = _finite("density", density(points), (len(points),))
    if np.any(values < 0.0):
        worst = int(np.argmin(values))
        raise ModelError(f"density {values[worst]:g} kg/m^3 at {points[worst].tolist()} is negative")
    return values


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Copy a value into a float array of that shape; ModelError names it if it does not fit."""
    expected = f"{shape} finite numbers up to 1e60" if shape else "a finite number up to 1e60"
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"{name} {value!r} is not valid: give {expected}") from None
    # written so that NaN fails too
    if array.shape != shape or not np.all(np.abs(array) <= LARGEST_NUMBER):
        shown = array.tolist() if array.size <= 9 else f"of shape {array.shape}"
        raise ModelError(f"{name} {shown} is not valid: give {expected}")
    return array


def _positive(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = _finite(name, value, shape)
    if np.any(array <= 0.0):
        raise ModelError(f"{name} {array.tolist()} m is not valid: lengths are greater than zero")
    return array


def _require_moments_of_a_body(moments: NDArray[np.floating]) -> None:
    """Refuse principal moments, ascending, that no distribution of positive mass has."""
    smallest, middle, largest = moments
    shown = f"inertia with principal moments {smallest:g}, {middle:g}, {largest:g} kg m^2"
    # numbers below the smallest normal one keep no relative precision
    tolerance = INERTIA_TOLERANCE * max(abs(smallest), abs(largest)) + float(np.finfo(float).tiny)
    if smallest < -tolerance:
        raise ModelError(f"{shown} is not positive semi-definite: no moment may be negative")
    if largest - middle - smallest > tolerance:
        raise ModelError(
            f"{shown} breaks the triangle inequality: the largest may not exceed the sum of the other two,"
            f" here {middle + smallest:g}"
        )
