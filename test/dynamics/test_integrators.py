"""Time stepping: its order, its agreement with reference trajectories, and constraints that hold for a million steps."""

import numpy as np
import pytest

from physics_prior import resources
from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.scene import load_scene

GRAVITY = Gravity(acceleration=(0.0, 0.0, -9.81))
COUNTS = {"semi_implicit_euler": 1000, "rk4": 25, "implicit_midpoint": 50, "lobatto_iiic": 50, "dop853": 12}
"""Steps before the first halving."""


def end_state(simulator, q, v, seconds, count):
    q, v = q.copy(), v.copy()
    simulator.advance(q, v, seconds / count, count)
    return q, v


def measured_order(tree, effects, integrator, q, v, seconds, count):
    """The slope of log error over log step over four halvings of the step, against dop853 at 1e-13.

    dop853 takes the steps that it is told: any error is tolerated.
    """
    best = Simulator(tree, effects, "dop853", 1e-13)
    exact = end_state(best, q, v, seconds, 2)
    simulator = Simulator(tree, effects, integrator, 1e6)
    errors = []
    for halvings in range(5):
        a, b = end_state(simulator, q, v, seconds, count * 2**halvings)
        errors.append(np.linalg.norm(np.concatenate([tree.difference(exact[0], a), b - exact[1]])))
    return -np.polyfit(np.arange(5), np.log2(errors), 1)[0]


@pytest.fixture(scope="module")
def ball_chain():
    """Three uneven bodies on ball joints."""
    rng = np.random.default_rng(5)
    body = MassProperties(1.0, np.array([0.02, 0.01, -0.15]), np.diag([0.01, 0.012, 0.004]))
    joints = []
    for i in range(3):
        place = np.array([0.0, 0.0, -0.3]) if i else np.zeros(3)
        joints.append(Joint(f"ball{i}", JointKind.SPHERICAL, f"body{i - 1}" if i else "world", f"body{i}", place))
    tree = Tree([Part(f"body{i}", body) for i in range(3)], joints)
    return tree, tree.integrate(tree.neutral(), rng.normal(size=9)), rng.normal(scale=2.0, size=9)


@pytest.mark.parametrize(("integrator", "count"), COUNTS.items())
def test_order_on_the_double_pendulum(integrator, count, double_pendulum):
    q, v = np.array([1.0, 0.5]), np.array([0.5, -1.0])
    order = measured_order(double_pendulum, [GRAVITY], integrator, q, v, 2.0, count)
    assert order >= INTEGRATORS[integrator].order - 0.2  # measured 1.0, 4.5, 2.0, 2.2, 9.2


@pytest.mark.parametrize(("integrator", "count"), {**COUNTS, "dop853": 6}.items())
def test_order_on_a_chain_of_balls(integrator, count, ball_chain):
    """On the manifold of rotations the order is the same."""
    tree, q, v = ball_chain
    order = measured_order(tree, [GRAVITY], integrator, q, v, 0.25, count)
    assert order >= INTEGRATORS[integrator].order - 0.2  # measured 1.0, 4.1, 2.0, 2.0, 9.4


@pytest.mark.parametrize(("integrator", "count"), {**COUNTS, "dop853": 1}.items())
def test_order_on_a_four_bar_linkage(integrator, count, four_bar):
    """Projection after each step costs no order, short of where the mechanism folds at 0.71 s."""
    tree, effects, q, v = four_bar
    order = measured_order(tree, effects, integrator, q, v, 0.6, count)
    assert order >= INTEGRATORS[integrator].order - 0.2  # measured 1.0, 4.0, 2.0, 2.0, 7.9


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_time_moves_by_the_step(integrator, ball_chain):
    """And a step that is differentiated moves it too."""
    tree, q, v = ball_chain
    simulator = Simulator(tree, [GRAVITY], integrator)
    simulator.time = 1.0
    q, v = end_state(simulator, q, v, 4 / 128, 4)
    assert simulator.time == 1.0 + 4 / 128
    simulator.linearise(q, v, 1 / 128, np.zeros(tree.nv))
    assert simulator.time == 1.0 + 5 / 128


def test_steps_in_one_call_are_steps_one_by_one(ball_chain):
    """Bit for bit, what the workspace keeps from step to step included."""
    tree, q, v = ball_chain
    for effects in ([GRAVITY], [GRAVITY, Attachment(part="body2", at=(0.3, 0.0, -0.3))]):
        for integrator in INTEGRATORS:
            simulator = Simulator(tree, effects, integrator)
            start, rate = q.copy(), v.copy()
            simulator.project(start, rate)
            a, b = end_state(simulator, start, rate, 0.02, 20)
            other = Simulator(tree, effects, integrator)
            c, d = start.copy(), rate.copy()
            for _ in range(20):
                other.mass_matrix(tree.neutral())  # spoils the workspace
                other.advance(c, d, 0.001)
            assert np.array_equal(a, c)
            assert np.array_equal(b, d)


def residuals(name, count, calls):
    """Position rows, velocity rows and quaternion norms of a shipped scene, the worst of each of `calls` calls."""
    scene = load_scene(resources.scene_path(name))
    simulator = Simulator(scene.tree, scene.effects, scene.step.integrator)
    q, v = scene.initial.q.copy(), scene.initial.v.copy()
    simulator.project(q, v)
    out = []
    for _ in range(calls):
        simulator.advance(q, v, scene.step.size, count // calls)
        position = np.max(np.abs(simulator.constraint_error(q, v)))
        A, _ = simulator.tangent_rows(q, v)
        norms = [
            abs(np.linalg.norm(q[link.q.stop - 4 : link.q.stop]) - 1.0)
            for link in scene.tree.links
            if link.joint.nq - link.joint.nv == 1
        ]
        out.append((position, np.max(np.abs(A @ v)), max(norms, default=0.0)))
    return np.array(out)


@pytest.mark.parametrize(
    ("count", "calls"),
    [(20_000, 200), pytest.param(1_000_000, 1000, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize("name", ["ball_on_rod", "four_bar"])
def test_constraints_hold(name, count, calls):
    """No residual grows: the second half's is the first half's.

    Measured over a million steps: ball_on_rod 9.9e-12 m, 3.9e-16 m/s, norms 2.2e-16; four_bar 1.0e-15 m, 1.1e-15 m/s.
    """
    found = residuals(name, count, calls)
    assert np.max(found[:, 0]) <= 1e-9
    assert np.max(found[:, 1]) <= 1e-9
    assert np.max(found[:, 2]) <= 1e-12
    first, second = np.max(found[: calls // 2, 0]), np.max(found[calls // 2 :, 0])
    assert second <= 10.0 * max(first, 1e-13)
