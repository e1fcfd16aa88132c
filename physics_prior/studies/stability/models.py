"""Models at the edge of what a body can be: massless links, point masses, inertias that no body has."""

from collections.abc import Callable

import numpy as np

from physics_prior import inertia
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties, point_mass
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.chain import GRAVITY
from physics_prior.studies.problems.mechanism import Mechanism
from physics_prior.studies.stability.case import Check, Measurements, case
from physics_prior.studies.stability.ratios import energies


def refused(make: Callable[[], object], *named: str) -> float:
    """0 if making something is refused with an error that names all the words; 1 if not."""
    try:
        make()
    except ModelError as error:
        return 0.0 if all(word in str(error) for word in named) else 1.0
    return 1.0


@case(
    23,
    "Massless links: between joints, and at the end",
    "drake #17081, #16992",
)
def massless_links(thorough: bool) -> Measurements:
    """A universal joint's cross without mass moves as one of 1e-9 kg does; a massless end is refused by its name."""
    light, none = (_universal(mass).run() for mass in (1e-9, 0.0))
    for run in (light, none):
        run.to(1.0, 1e-4)
    yield Check(
        "universal joint's angles less those with a cross of 1e-9 kg",
        float(np.max(np.abs(light.q - none.q))),
        1e-6,
        "rad",
    )
    _, error, moving = energies(_universal(0.0).run(), 5.0, 1e-3)
    yield Check("its energy over 5 s, relative", float(np.max(np.abs(error))) / moving, 1e-8)
    yield Check(
        "massless end that is not refused by name",
        refused(lambda: _ending(MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))), "'tip'"),
        0.0,
    )
    yield Check(
        "point mass on its own axis that is not refused by name",
        refused(lambda: Simulator(_ending(point_mass(1.0))), "'wrist'"),
        0.0,
    )


def _universal(mass: float) -> Mechanism:
    """A rod on a universal joint whose cross has a mass, kg."""
    cross = inertia.box(mass, (0.1, 0.1, 0.1)) if mass else MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))
    rod = inertia.box(1.0, (0.05, 0.05, 1.0)).transformed(np.eye(3), np.array([0.0, 0.0, -0.5]))
    tree = Tree(
        [Part("cross", cross), Part("rod", rod)],
        [
            Joint("first", JointKind.REVOLUTE, "world", "cross", axis=np.array([1.0, 0.0, 0.0])),
            Joint("second", JointKind.REVOLUTE, "cross", "rod", axis=np.array([0.0, 1.0, 0.0])),
        ],
    )
    return Mechanism(tree, (GRAVITY,), np.array([0.8, 0.5]), np.array([0.3, 1.0]))


def _ending(tip: MassProperties) -> Tree:
    """A rod that carries a tip on a hinge."""
    rod = inertia.box(1.0, (0.05, 0.05, 1.0))
    return Tree(
        [Part("arm", rod), Part("tip", tip)],
        [Joint("shoulder", JointKind.REVOLUTE, "world", "arm"), Joint("wrist", JointKind.REVOLUTE, "arm", "tip")],
    )


@case(24, "Inertias: point masses, and those that no body has", "drake #11094, #13903")
def invalid_inertias(thorough: bool) -> Measurements:
    """A point mass off its axis swings as it must; what breaks the triangle inequality or is negative is refused."""
    tree = Tree([Part("bob", point_mass(1.0, (0.0, 0.0, -1.0)))], [Joint("ball", JointKind.SPHERICAL, "world", "bob")])
    yield Check(
        "point mass on a ball joint that is not refused by name", refused(lambda: Simulator(tree), "'ball/z'"), 0.0
    )
    free = Tree([Part("bob", point_mass(2.0))], [Joint("rail", JointKind.PRISMATIC, "world", "bob")])
    run = Mechanism(free, (GRAVITY,), np.zeros(1), np.zeros(1)).run()
    run.to(1.0, 1e-3)
    yield Check("fall of a point mass on a rail for 1 s less g/2", abs(float(run.q[0]) + 0.5 * 9.81), 1e-12, "m")
    origin = np.zeros(3)
    wrong: dict[str, Callable[[], object]] = {
        "triangle": lambda: MassProperties(1.0, origin, np.diag([1.0, 1.0, 3.0])),
        "negative": lambda: MassProperties(-1.0, origin, np.eye(3)),
        "semi-definite": lambda: MassProperties(1.0, origin, np.diag([1.0, 1.0, -0.5])),
        "symmetric": lambda: MassProperties(1.0, origin, np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])),
        "massless": lambda: MassProperties(0.0, origin, np.eye(3)),
        "finite": lambda: MassProperties(1.0, origin, np.full((3, 3), np.inf)),
    }
    yield Check(
        f"not refused by name, of {', '.join(wrong)}", sum(refused(make, word) for word, make in wrong.items()), 0.0
    )
