"""Things that touch."""

import numpy as np
import pytest

from physics_prior import inertia
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.contact import Contact
from physics_prior.effects.gravity import Gravity
from physics_prior.model import Joint, JointKind, Part, Shape, Tree

G = 9.80665


@pytest.fixture(scope="session")
def g():
    return G


def _free(name, properties, shape):
    return Part(name, properties, shape), Joint(f"{name}_joint", JointKind.FREE, "world", name)


@pytest.fixture(scope="session")
def cube():
    """Factory: a free cube of an edge, m, and mass, kg, over the ground, with the contact's fields."""

    def build(edge=0.2, mass=1.0, integrator="rk4", effects=(), **fields):
        size = np.full(3, edge)
        part, joint = _free("cube", inertia.box(mass, size), Shape("box", size))
        return Simulator(Tree([part], [joint]), [Gravity(), Contact(part="cube", **fields), *effects], integrator)

    return build


@pytest.fixture(scope="session")
def ball():
    """Factory: a free ball of a radius, m, and mass, kg, over the ground, with the contact's fields."""

    def build(radius=0.1, mass=1.0, **fields):
        part, joint = _free("ball", inertia.sphere(mass, radius), Shape("sphere", np.full(3, 2.0 * radius)))
        return Simulator(Tree([part], [joint]), [Gravity(), Contact(part="ball", **fields)])

    return build


@pytest.fixture(scope="session")
def at():
    """Factory: a free body's q at a position, upright, and v."""

    def state(position, velocity=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
        return np.array([*position, 1.0, 0.0, 0.0, 0.0]), np.array([*velocity, *turn], dtype=float)

    return state
