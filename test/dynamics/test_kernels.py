"""Compiled kernels of trees without constraints equal the readable formulations, and keep what motion keeps."""

import numpy as np
import pytest

from physics_prior import inertia, rotations
from physics_prior.dynamics.arrays import within
from physics_prior.dynamics.formulations import generalized
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError, SimulationError
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree

FIELD = np.array([0.3, -0.2, -9.81])
GRAVITY = Gravity(acceleration=tuple(FIELD))
SEEDS = range(25)


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    expected = np.asarray(expected)
    return float(np.max(np.abs(actual - expected), initial=0.0) / max(1.0, np.max(np.abs(expected), initial=0.0)))


@pytest.fixture(params=SEEDS)
def case(request, random_tree, random_state):
    rng = np.random.default_rng(request.param)
    tree = random_tree(rng, massless=request.param % 3 == 0)
    return rng, tree, *random_state(rng, tree)


def test_forward_dynamics_equals_the_formulation(case):
    rng, tree, q, v = case
    tau = rng.normal(size=tree.nv)
    expected = generalized.accelerations(tree, q, v, tau, FIELD)
    assert off(Simulator(tree, [GRAVITY]).acceleration(q, v, tau), expected) < 1e-10  # measured 6e-15


def test_inverse_dynamics_and_mass_matrix_equal_the_formulation(case):
    rng, tree, q, v = case
    simulator, vdot = Simulator(tree, [GRAVITY]), rng.normal(size=tree.nv)
    expected = generalized.inverse_dynamics(tree, q, v, vdot, FIELD)
    assert off(simulator.inverse_dynamics(q, v, vdot), expected) < 1e-12  # measured 2e-15
    assert off(simulator.mass_matrix(q), generalized.mass_matrix(tree, q)) < 1e-12  # measured 2e-15


def test_forward_and_inverse_dynamics_are_inverse(case):
    rng, tree, q, v = case
    simulator, tau = Simulator(tree, [GRAVITY]), rng.normal(size=tree.nv)
    vdot = simulator.acceleration(q, v, tau)
    assert off(simulator.inverse_dynamics(q, v, vdot), tau) < 1e-10  # measured 5e-14


def test_poses_velocities_and_jacobians_equal_the_formulation(case):
    rng, tree, q, v = case
    simulator, k = Simulator(tree), kinematics(tree, q, v)
    simulator.move(q, v)
    for name, frame in tree.frames.items():
        position, R = simulator.pose(name)
        velocity, omega = simulator.velocity(name)
        turn = rotations.multiply(k.orientation[frame.link], frame.orientation)
        lever = rotations.rotate(k.orientation[frame.link], frame.position)
        assert off(R, rotations.matrix_from_quaternion(turn)) < 1e-13  # measured 2e-15
        assert off(position, k.position[frame.link] + lever) < 1e-13
        assert off(omega, k.angular_velocity[frame.link]) < 1e-13
        assert off(velocity, k.velocity[frame.link] + np.cross(k.angular_velocity[frame.link], lever)) < 1e-13
        point = rng.normal(size=3)
        jacobian = simulator.jacobian(name, point)
        assert off(jacobian[:3], k.angular_jacobian[frame.link]) < 1e-13
        assert off(jacobian[3:], generalized.point_jacobian(tree, q, name, point)) < 1e-13
        assert off(jacobian[3:] @ v, velocity + np.cross(omega, R @ point)) < 1e-12


def test_joint_wrenches_equal_the_formulation(case):
    rng, tree, q, v = case
    simulator, vdot = Simulator(tree, [GRAVITY]), rng.normal(size=tree.nv)
    for given in (vdot, None):
        motion = simulator.acceleration(q, v) if given is None else given
        forces, moments = generalized.joint_wrenches(tree, q, v, motion, FIELD)
        wrenches = simulator.wrenches(q, v, given)
        for link, force, moment in zip(tree.links, forces, moments, strict=True):
            wrench = wrenches[link.joint.name]
            assert off(wrench.force, force) < 1e-11  # measured 1e-13
            assert off(wrench.moment, moment) < 1e-11


def test_energy_equals_the_formulation_and_changes_by_the_work_of_forces(case):
    rng, tree, q, v = case
    simulator, tau = Simulator(tree, [GRAVITY]), rng.normal(size=tree.nv)
    simulator.move(q, v)
    assert off(simulator.energy(), sum(generalized.energy(tree, q, v, FIELD))) < 1e-13
    vdot, h = simulator.acceleration(q, v, tau), 1e-5

    def energy(t):
        simulator.move(tree.integrate(q, t * v), v + t * vdot)
        return simulator.energy()

    power = (energy(h) - energy(-h)) / (2.0 * h)
    assert off(power, v @ tau) < 1e-6  # of central differences; measured 3e-8


def test_momentum_of_a_free_tree_is_kept(random_tree, random_state):
    """Forces inside a tree change neither its momentum nor its angular momentum."""
    rng = np.random.default_rng(3)
    tree = random_tree(rng, size=6, root=JointKind.FREE)
    while any(link.parent < 0 for link in tree.links[1:]):
        tree = random_tree(rng, size=6, root=JointKind.FREE)
    q, v = random_state(rng, tree)
    simulator = Simulator(tree)

    def momenta():
        simulator.move(q, v)
        linear, angular = np.zeros(3), np.zeros(3)
        for part in tree.parts:
            body = part.mass_properties
            x, R = simulator.pose(part.name)
            rate, omega = simulator.velocity(part.name)
            lever = R @ body.center_of_mass
            push = body.mass * (rate + np.cross(omega, lever))
            linear += push
            angular += np.cross(x + lever, push) + R @ body.inertia @ R.T @ omega
        return np.concatenate([linear, angular])

    before = momenta()
    simulator.advance(q, v, 1e-4, 1000)
    assert off(momenta(), before) < 1e-9  # RK4 at 0.1 ms; measured 3e-15


def test_state_that_is_not_finite_is_seen(double_pendulum):
    simulator = Simulator(double_pendulum, [GRAVITY])
    q, v = np.array([0.1, np.nan]), np.zeros(2)
    with pytest.raises(SimulationError, match="'shoulder' is not finite: the state is not"):
        simulator.acceleration(q, v)
    with pytest.raises(SimulationError, match=r"not finite after a step of 0\.01 s"):
        simulator.advance(q, v, 0.01)


def test_joint_that_moves_no_inertia_is_refused_by_name():
    """A point mass on the axis of its own hinge: the hinge turns nothing."""
    bead = MassProperties(1.0, np.array([0.0, 0.0, -1.0]), np.zeros((3, 3)))
    swing = Joint("swing", JointKind.REVOLUTE, "world", "bead", axis=np.array([0.0, 1.0, 0.0]))
    Simulator(Tree([Part("bead", bead)], [swing]))
    spin = Joint("spin", JointKind.REVOLUTE, "world", "bead")
    with pytest.raises(ModelError, match="'spin' moves no inertia"):
        Simulator(Tree([Part("bead", bead)], [spin]))


def test_point_mass_on_a_ball_joint_is_refused_by_name():
    """Nothing to turn about the line to it; what rounding makes of zero, of either sign, does not count."""
    for place in ([0.0, 0.0, -1.0], [0.3, -0.2, 0.7]):
        bob = MassProperties(1.0, np.array(place), np.zeros((3, 3)))
        tree = Tree([Part("bob", bob)], [Joint("ball", JointKind.SPHERICAL, "world", "bob")])
        with pytest.raises(ModelError, match=r"'ball/[xyz]' moves no inertia"):
            Simulator(tree)


def test_posture_without_inertia_is_refused():
    """Two thin rods in line on a free root: nothing resists a turn about the line. Bent, as when it is built, all is well."""
    rod = inertia.rod(1.0, 1.0)
    free = Joint("root", JointKind.FREE, "world", "first")
    elbow = Joint(
        "elbow", JointKind.REVOLUTE, "first", "second", np.array([0.0, 0.0, 1.0]), axis=np.array([1.0, 0.0, 0.0])
    )
    simulator = Simulator(Tree([Part("first", rod), Part("second", rod)], [free, elbow]))
    q = simulator.tree.neutral()
    with pytest.raises(SimulationError, match="not finite"):
        simulator.acceleration(q, np.zeros(simulator.nv))
    with pytest.raises(SimulationError, match="not finite"):
        simulator.wrenches(q, np.zeros(simulator.nv))
    q[-1] = 1.0
    assert np.isfinite(simulator.acceleration(q, np.zeros(simulator.nv))).all()


def test_integrator_that_is_unknown_is_refused(double_pendulum):
    with pytest.raises(ModelError, match=r"'euler' is unknown.*rk4"):
        Simulator(double_pendulum, integrator="euler")


@pytest.mark.parametrize("place", [0, 9, 36])
def test_within_tells_what_is_too_large_or_no_number(place):
    numbers = np.linspace(-1.0, 1.0, 37)
    assert within(numbers, 1.0)
    for wrong in (1.1, -1.1, np.inf, np.nan):
        numbers[place] = wrong
        assert not within(numbers, 1.0)
