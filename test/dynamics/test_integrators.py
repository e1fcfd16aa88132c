"""Time stepping: its order, its agreement with reference trajectories, and constraints that hold for a million steps."""

import numpy as np
import pytest

from physics_prior import resources
from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties, rod
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.scene import load_scene

GRAVITY = Gravity(acceleration=(0.0, 0.0, -9.81))


def end_state(simulator, q, v, seconds, count):
    q, v = q.copy(), v.copy()
    simulator.advance(q, v, seconds / count, count)
    return q, v


def slope(simulator, q, v, seconds, counts):
    """Order of convergence: between two step counts, against ten times as many steps of RK4."""
    tree = simulator.tree
    exact = end_state(Simulator(tree, simulator.effects, "rk4"), q, v, seconds, 10 * counts[-1])
    errors = [
        np.linalg.norm(tree.difference(exact[0], end_state(simulator, q, v, seconds, count)[0])) for count in counts
    ]
    return float(np.log(errors[0] / errors[-1]) / np.log(counts[-1] / counts[0]))


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


@pytest.mark.parametrize(
    ("integrator", "least", "counts"),
    [("rk4", 3.8, (100, 400)), ("semi_implicit_euler", 0.8, (1000, 4000))],
)
def test_order_on_the_double_pendulum(integrator, least, counts, double_pendulum):
    """Measured 4.0 and 1.0."""
    simulator = Simulator(double_pendulum, [GRAVITY], integrator)
    order = slope(simulator, np.array([1.0, 0.5]), np.array([0.5, -1.0]), 1.0, counts)
    assert order >= least


@pytest.mark.parametrize(
    ("integrator", "least", "counts"),
    [("rk4", 3.8, (200, 800)), ("semi_implicit_euler", 0.8, (2000, 8000))],
)
def test_order_on_a_chain_of_balls(integrator, least, counts, ball_chain):
    """On the manifold of rotations the order is the same. Measured 4.0 and 1.0."""
    tree, q, v = ball_chain
    assert slope(Simulator(tree, [GRAVITY], integrator), q, v, 0.5, counts) >= least


@pytest.mark.parametrize(
    ("integrator", "least", "counts"),
    [("rk4", 3.8, (200, 800)), ("semi_implicit_euler", 0.8, (2000, 8000))],
)
def test_order_of_a_held_chain(integrator, least, counts, ball_chain):
    """Projection after each step costs no order: the chain's end is held. Measured 4.0 and 1.0."""
    tree, q, v = ball_chain
    free = Simulator(tree)
    free.move(q, v)
    position, R = free.pose("body2")
    point = np.array([0.0, 0.0, -0.3])
    simulator = Simulator(
        tree, [GRAVITY, Attachment(part="body2", point=tuple(point), at=tuple(position + R @ point))], integrator
    )
    q, v = q.copy(), v.copy()
    simulator.project(q, v)
    assert slope(simulator, q, v, 0.3, counts) >= least


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


def test_double_pendulum_reference(double_pendulum, reference):
    """RK4 at 1 ms over 10 s of moderate motion, absolute angles."""
    table = reference("double_pendulum_moderate.csv")
    simulator, worst = Simulator(double_pendulum, [GRAVITY]), 0.0
    q, v = np.array([table["theta1"][0], table["theta2"][0] - table["theta1"][0]]), np.zeros(2)
    times = table["t"]
    for start, end, first, second in zip(times[:-1], times[1:], table["theta1"][1:], table["theta2"][1:], strict=True):
        count = round((end - start) / 1e-3)
        simulator.advance(q, v, (end - start) / count, count)
        worst = max(worst, abs(q[0] - first), abs(q[0] + q[1] - second))
    assert worst < 1e-8  # rad; measured 3e-10


def test_four_bar_reference(reference):
    """RK4 at 0.5 ms over 10 s: three rods of 1 m and 1 kg, the verticals upright and pushed at 1 m/s.

    Twice a turn all rods lie in one line: the rows lose rank and the mechanism could fold. What projection leaves there
    strays by its root, so that 1e-11 m left would cost 2e-4 m.
    """
    table = reference("A02_four_bar_N1_20s.csv")
    body = rod(1.0, 1.0).transformed(np.eye(3), np.array([0.0, 0.0, 0.5]))
    axis, up = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    tree = Tree(
        [Part(name, body) for name in ("left", "top", "right")],
        [
            Joint("a", JointKind.REVOLUTE, "world", "left", axis=axis),
            Joint("b", JointKind.REVOLUTE, "left", "top", up, axis=axis),
            Joint("c", JointKind.REVOLUTE, "top", "right", up, axis=axis),
        ],
    )
    simulator = Simulator(tree, [GRAVITY, Attachment(part="right", point=(0.0, 0.0, 1.0), at=(1.0, 0.0, 0.0))])
    q, v = np.array([0.0, np.pi / 2, np.pi / 2]), np.array([1.0, -1.0, 1.0])
    simulator.project(q, v)
    worst, times = 0.0, table["t"]
    for start, end, x, y in zip(times[:-1], times[1:], table["B0x"][1:], table["B0y"][1:], strict=True):
        if end > 10.0:
            break
        count = round((end - start) / 5e-4)
        simulator.advance(q, v, (end - start) / count, count)
        simulator.move(q, v)
        position, R = simulator.pose("left")
        worst = max(worst, float(np.max(np.abs(position + R @ up - [x, 0.0, y]))))
    assert worst < 1e-9  # m; measured 5e-11


def test_heavy_top_reference(heavy_top, reference):
    """RK4 at 0.1 ms over 0.2 s, 150 rad/s: position of the centre of mass and attitude."""
    table = reference("heavy_top_fast.csv")
    simulator, worst = Simulator(heavy_top, [GRAVITY]), 0.0
    q, v = heavy_top.neutral(), np.array([0.0, 150.0, -4.61538])
    for row, start in zip(table[1:], table["t"], strict=False):
        if row["t"] > 0.2 + 1e-9:
            break
        simulator.advance(q, v, (row["t"] - start) / 10, 10)
        expected = np.array([row["qw"], row["qx"], row["qy"], row["qz"]])
        worst = max(worst, float(np.min([np.max(np.abs(q - expected)), np.max(np.abs(q + expected))])))
    assert worst < 1e-6  # measured 2e-9


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
