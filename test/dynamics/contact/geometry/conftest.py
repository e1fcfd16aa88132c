"""Shapes in plain NumPy: the supports and memberships that the compiled geometry is held against."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.contact.geometry.pairs import (
    ASKED,
    BOX,
    CAPSULE,
    ELLIPSOID,
    PLANE,
    ROW,
    SLOTS,
    SPHERE,
    finder,
    touch,
)


@dataclass(frozen=True)
class Shape:
    kind: int
    size: np.ndarray
    center: np.ndarray
    R: np.ndarray

    def support(self, n):
        """How far the shape reaches along n: the maximum of n . p over its points."""
        local = self.R.T @ n
        if self.kind == BOX:
            reach = np.abs(local) @ self.size
        elif self.kind == ELLIPSOID:
            reach = np.linalg.norm(self.size * local)
        else:
            reach = self.size[0] + (self.size[1] * abs(local[2]) if self.kind == CAPSULE else 0.0)
        return n @ self.center + reach

    def outside(self, p):
        """A length that is positive outside the shape, negative within and zero on its surface."""
        x = self.R.T @ (p - self.center)
        if self.kind == BOX:
            return np.max(np.abs(x) - self.size)
        if self.kind == ELLIPSOID:
            norm = np.linalg.norm(x / self.size)
            return (norm - 1.0) * norm / np.linalg.norm(x / self.size**2)
        axis = self.size[1] if self.kind == CAPSULE else 0.0
        return np.linalg.norm(x - [0.0, 0.0, np.clip(x[2], -axis, axis)]) - self.size[0]

    def moved(self, shift, turn):
        """The shape displaced, and turned about its centre by a rotation vector in world axes."""
        return replace(self, center=self.center + shift, R=matrix(turn) @ self.R)

    @property
    def radius(self):
        """The radius of a ball about the centre that holds the shape."""
        return {SPHERE: self.size[0], CAPSULE: self.size[0] + self.size[1]}.get(self.kind, np.linalg.norm(self.size))

    def arguments(self):
        size = self.size * [1.0, 0.0, 0.0] if self.kind == SPHERE else self.size
        return (
            tuple(map(float, size)),
            tuple(map(float, self.center)),
            tuple(map(float, self.R.ravel())),
        )


def matrix(rotation_vector):
    return rotations.matrix_from_quaternion(rotations.exp(np.asarray(rotation_vector, float)))


def manifold(a, b, reach=0.0):
    """The rows of the manifold of two shapes, copied."""
    out = np.full((SLOTS + ASKED, ROW), np.nan)
    return out[: touch(*finder(a.kind, b.kind), *a.arguments(), *b.arguments(), float(reach), out)]


def nearest(a, b):
    """The row of the least gap."""
    rows = manifold(a, b)
    return rows[np.argmin(rows[:, 9])]


def separation(a, b, n):
    """How far the shapes are apart along n; their signed distance is its maximum over all n."""
    return -b.support(-n) - a.support(n)


def random_shape(rng, kind, spread=0.7):
    quaternion = rotations.normalize(rng.normal(size=4))
    size = np.exp(rng.uniform(-spread, spread, 3))
    return Shape(kind, size, rng.normal(size=3), rotations.matrix_from_quaternion(quaternion))


def at_gap(a, b, direction, gap):
    """Shape b put where it has a gap from a, by bisection along a direction from a's centre."""
    low, high = 0.0, a.radius + b.radius + gap + 1.0
    for _ in range(45):
        middle = 0.5 * (low + high)
        if nearest(a, replace(b, center=a.center + middle * direction))[9] < gap:
            low = middle
        else:
            high = middle
    return replace(b, center=a.center + high * direction)


def random_pair(rng, kind_a, kind_b, gap, spread=0.7):
    direction = rng.normal(size=3)
    a, b = random_shape(rng, kind_a, spread), random_shape(rng, kind_b, spread)
    if kind_a == PLANE:
        return a, replace(b, center=b.center + a.R[:, 2] * (gap - nearest(a, b)[9]))
    return a, at_gap(a, b, direction / np.linalg.norm(direction), gap)


@pytest.fixture(scope="session")
def geometry():
    """The helpers of this file, by name."""
    return SimpleNamespace(
        Shape=Shape,
        matrix=matrix,
        manifold=manifold,
        nearest=nearest,
        separation=separation,
        random_shape=random_shape,
        random_pair=random_pair,
        at_gap=at_gap,
    )
