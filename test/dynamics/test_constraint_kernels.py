"""Compiled constrained dynamics equal the readable formulation: motion, forces and rank, redundant sets included."""

from typing import Any, ClassVar

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.formulations import generalized
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Hinge, Rod, Weld
from physics_prior.effects.effect import Effect
from physics_prior.effects.gravity import Gravity
from physics_prior.model import JointKind

FIELD = np.array([0.3, -0.2, -9.81])
GRAVITY = Gravity(acceleration=tuple(FIELD))


class Pairs(Effect):
    """Any point pairs, as an effect."""

    kind: ClassVar[str] = "pairs"
    pairs: Any

    def point_pairs(self, tree):
        return self.pairs


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    expected = np.asarray(expected)
    return float(np.max(np.abs(actual - expected), initial=0.0) / max(1.0, np.max(np.abs(expected), initial=0.0)))


def held_tree(rng, random_tree, random_state, effects_of):
    """A tree with a free root and what holds it, in a state that fits: (tree, effects, q, v)."""
    tree = random_tree(rng, size=6, root=JointKind.FREE)
    q, v = random_state(rng, tree)
    effects = effects_of(rng, tree, q)
    simulator = Simulator(tree, [GRAVITY, *effects])
    simulator.project(q, v)
    return tree, effects, simulator, q, v


def place(tree, q, part):
    simulator = Simulator(tree)
    simulator.move(q, np.zeros(tree.nv))
    return simulator.pose(part)


def two_parts(rng, tree):
    """Two parts on different links, or a part and the world."""
    links = {name: frame.link for name, frame in tree.frames.items()}
    part = [name for name, link in links.items() if link >= 0][int(rng.integers(len(tree.parts)))]
    others = [name for name, link in links.items() if link != links[part]]
    return part, others[int(rng.integers(len(others)))]


def attachment(rng, tree, q):
    part, to = two_parts(rng, tree)
    (x, R), (y, S), point = place(tree, q, part), place(tree, q, to), rng.normal(scale=0.3, size=3)
    return [Attachment(part=part, point=tuple(point), to=to, at=tuple(S.T @ (x + R @ point - y)))]


def weld(rng, tree, q):
    part, to = two_parts(rng, tree)
    (x, R), (y, S), point = place(tree, q, part), place(tree, q, to), rng.normal(scale=0.3, size=3)
    turn = tuple(rotations.quaternion_from_matrix(S.T @ R))
    return [Weld(part=part, point=tuple(point), to=to, at=tuple(S.T @ (x + R @ point - y)), orientation=turn)]


def hinge(rng, tree, q):
    part, to = two_parts(rng, tree)
    (x, R), (y, S), point = place(tree, q, part), place(tree, q, to), rng.normal(scale=0.3, size=3)
    axis = rng.normal(size=3)
    axes = {"axis": tuple(axis), "to_axis": tuple(S.T @ R @ axis)}
    return [Hinge(part=part, point=tuple(point), to=to, at=tuple(S.T @ (x + R @ point - y)), **axes)]


def rod(rng, tree, q):
    part, to = two_parts(rng, tree)
    (x, R), (y, S), (point, at) = place(tree, q, part), place(tree, q, to), rng.normal(scale=0.3, size=(2, 3))
    length = float(np.linalg.norm(x + R @ point - y - S @ at))
    return [Rod(part=part, point=tuple(point), to=to, at=tuple(at), length=length)]


def several(rng, tree, q):
    """An attachment, a rod and the same attachment again."""
    first = attachment(rng, tree, q)[0]
    return [first, first.model_copy(update={"name": "again"}), *rod(rng, tree, q)]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("effects_of", [attachment, weld, hinge, rod, several])
def test_effects_equal_the_formulation(seed, effects_of, random_tree, random_state):
    rng = np.random.default_rng(seed)
    tree, effects, simulator, q, v = held_tree(rng, random_tree, random_state, effects_of)
    tau = rng.normal(size=tree.nv)
    pairs = [pair for effect in effects for pair in effect.point_pairs(tree)]
    expected = generalized.mixed_accelerations(tree, q, v, tau, FIELD, pairs)
    assert np.max(np.abs(simulator.constraint_error(q, v))) < 1e-12
    assert off(simulator.acceleration(q, v, tau), expected.acceleration) < 1e-10  # measured 3e-12
    assert simulator.rank == expected.rank
    if effects_of is several:
        assert simulator.rank <= simulator.rows - 3


@pytest.mark.parametrize("seed", range(30))
def test_any_point_pairs_equal_the_formulation(seed, random_tree, random_state, random_pairs, consistent_velocity):
    """One to three directions or a rod, between any parts; points apart along directions that are free."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, size=7)
    q, v = random_state(rng, tree)
    pairs = random_pairs(rng, tree, q, 1 + seed % 3)
    v = consistent_velocity(tree, q, v, pairs)
    tau = rng.normal(size=tree.nv)
    expected = generalized.mixed_accelerations(tree, q, v, tau, FIELD, pairs)
    simulator = Simulator(tree, [GRAVITY, Pairs(pairs=pairs)])
    assert off(simulator.acceleration(q, v, tau), expected.acceleration) < 1e-9
    assert simulator.rank == expected.rank
    _, J = generalized.constraint_jacobian(tree, q, pairs)
    A, _ = simulator.tangent_rows(q, v)
    assert off(A, J) < 1e-12
