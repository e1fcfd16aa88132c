"""Effects that push, on random trees in random states: derivatives against central differences, forces against potentials."""

import numpy as np
import pytest

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.spring import Spring
from physics_prior.inertia import box, combine, point_mass
from physics_prior.model import Joint, JointKind, Part, Tree

STEP = 1e-5  # of central differences


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    return float(np.max(np.abs(actual - expected)) / max(1.0, np.max(np.abs(expected))))


def central_differences(move, function, size):
    """Derivative (k, size) of function(move(d)) -> (k,) by d (size,) at zero."""
    columns = [(function(*move(d)) - function(*move(-d))) / (2.0 * STEP) for d in STEP * np.eye(size)]
    return np.array(columns).T


def point(rng):
    return tuple(rng.normal(scale=0.3, size=3))


def springs(rng, tree, damping):
    """A spring in every joint that takes one, one between any two parts and one of no length to the world."""
    joints = [link.joint for link in tree.links if link.joint.kind is not JointKind.FREE]
    rest = {}
    for joint in joints:
        turn = rng.normal(size=4)
        rest[joint.name] = tuple(turn) if joint.kind is JointKind.SPHERICAL else float(turn[0])
    moving = [part.name for part in tree.parts if tree.frame(part.name).link >= 0]
    b = moving[rng.integers(len(moving))]
    others = [name for name, frame in tree.frames.items() if frame.link != tree.frame(b).link]
    a = others[rng.integers(len(others))]
    return [
        JointSpring(
            stiffness={joint.name: float(rng.uniform(0.0, 30.0)) for joint in joints},
            rest=rest,
            damping={joints[0].name: 0.3 * damping},
        ),
        Spring(part=b, point=point(rng), to=a, at=point(rng), stiffness=50.0, rest_length=0.7, damping=damping),
        Spring(name="pull", part=b, point=point(rng), at=point(rng), stiffness=20.0),
    ]


@pytest.mark.parametrize("seed", range(12))
def test_derivatives_of_accelerations(random_tree, random_state, seed):
    """Everything that pushes at once: springs in joints and between points, dampers, drag in wind."""
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, size=int(rng.integers(2, 7)))
    q, v = random_state(rng, tree)
    drag = Drag(
        part=tree.links[-1].part, point=point(rng), linear=0.5, quadratic=0.7, angular=0.3, wind=(1.0, 2.0, -0.5)
    )
    simulator, nv = Simulator(tree, [*springs(rng, tree, 3.0), drag]), tree.nv
    expected = central_differences(
        lambda d: (tree.integrate(q, d[:nv]), v + d[nv:]), simulator.acceleration, 2 * tree.nv
    )
    assert off(np.hstack(simulator.acceleration_derivatives(q, v)), expected) < 2e-9  # measured 9e-11


def test_drag_at_rest_in_still_air_is_smooth(random_tree, random_state):
    """Its quadratic part has neither force nor slope there."""
    rng = np.random.default_rng(20)
    tree = random_tree(rng, size=4)
    q, still = random_state(rng, tree)[0], np.zeros(tree.nv)
    pull = springs(rng, tree, 3.0)
    accelerations, slopes = [], []
    for quadratic in (0.0, 0.7):
        simulator = Simulator(tree, [*pull, Drag(part=tree.links[-1].part, linear=0.5, quadratic=quadratic)])
        accelerations.append(simulator.acceleration(q, still))
        slopes.append(np.hstack(simulator.acceleration_derivatives(q, still)))
    assert np.array_equal(*accelerations)
    assert np.array_equal(*slopes)


@pytest.mark.parametrize("seed", range(6))
def test_springs_pull_down_the_gradient_of_their_energy(random_tree, random_state, seed):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, size=int(rng.integers(2, 7)))
    q, still = random_state(rng, tree)[0], np.zeros(tree.nv)
    simulator = Simulator(tree, springs(rng, tree, 3.0))

    def energy(posture):
        simulator.move(posture, still)
        return np.array([simulator.energy()])

    gradient = central_differences(lambda d: (tree.integrate(q, d),), energy, tree.nv)[0]
    force = simulator.mass_matrix(q) @ simulator.acceleration(q, still)
    assert off(force, -gradient) < 1e-9  # measured 4e-11


def test_stiff_governor_follows_the_reference(reference):
    """A05 of numerics.md: a slider on a shaft is hung from the middles of two arms by springs of 8e5 N/m and 4e4 N s/m."""
    table = reference("A05_flyball_governor_10s.csv")
    x, y, z = np.eye(3)
    bar = box(0.3, (1.0, 0.01, 0.01))
    joints = [
        Joint("spin", JointKind.REVOLUTE, "world", "shaft", axis=z),
        Joint("slide", JointKind.PRISMATIC, "shaft", "slider", axis=z),
        Joint("right", JointKind.REVOLUTE, "shaft", "right_arm", 0.05 * x + z, axis=y),
        Joint("left", JointKind.REVOLUTE, "shaft", "left_arm", -0.05 * x + z, axis=-y),
    ]
    arms = [combine([bar.transformed(np.eye(3), s * 0.5 * x), point_mass(5.0, s * x)]) for s in (1.0, -1.0)]
    masses = [box(0.3, (0.01, 0.01, 1.0)), box(3.0, (0.1, 0.1, 0.1)), *arms]
    tree = Tree([Part(joint.child, mass) for joint, mass in zip(joints, masses, strict=True)], joints)
    stiff = {"stiffness": 8e5, "damping": 4e4, "rest_length": 0.5, "to": "slider"}
    effects = [
        Gravity(acceleration=(0.0, 0.0, -9.81)),
        JointSpring(stiffness={"spin": 0.0}),
        Spring(part="right_arm", point=tuple(0.5 * x), at=tuple(0.05 * x), **stiff),
        Spring(name="left_spring", part="left_arm", point=tuple(-0.5 * x), at=tuple(-0.05 * x), **stiff),
    ]
    simulator = Simulator(tree, effects)
    q, v = np.array([0.0, 0.5, np.pi / 6.0, np.pi / 6.0]), np.array([2.0 * np.pi, 0.0, 0.0, 0.0])
    for n, row in enumerate(table[1:201], start=1):
        simulator.advance(q, v, 1e-4, 100)
        assert abs(q[1] - row["s"]) < 1e-11, f"at {0.01 * n:.2f} s"  # measured 2e-13
