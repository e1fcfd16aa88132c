"""Agreement with the trajectories of shared/reference, computed elsewhere; missing ones are skipped by name."""

from itertools import pairwise

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree

GRAVITY = Gravity(acceleration=(0.0, 0.0, -9.81))


def states(simulator, q, v, times, step):
    """The state at each of the times, from q and v at the first, in steps of about that size."""
    q, v = q.copy(), v.copy()
    yield q, v
    for start, end in pairwise(times):
        count = max(1, round((end - start) / step))
        simulator.advance(q, v, (end - start) / count, count)
        yield q, v


def attitude_error(row, quaternion):
    """Angle, rad, between a row's columns qw qx qy qz and a quaternion."""
    expected = np.array([row[name] for name in ("qw", "qx", "qy", "qz")])
    return np.linalg.norm(rotations.log(rotations.multiply(rotations.conjugate(expected), quaternion)))


@pytest.mark.parametrize(
    ("integrator", "tolerance", "step", "bound"),
    [("rk4", 1e-9, 1e-3, 1e-8), ("dop853", 1e-13, 0.05, 1e-12)],  # rad; measured 3e-10, 8e-15
)
def test_double_pendulum(integrator, tolerance, step, bound, double_pendulum, reference):
    """10 s of moderate motion, absolute angles."""
    table = reference("double_pendulum_moderate.csv")
    simulator, worst = Simulator(double_pendulum, [GRAVITY], integrator, tolerance), 0.0
    start = np.array([table["theta1"][0], table["theta2"][0] - table["theta1"][0]])
    for row, (q, _) in zip(table, states(simulator, start, np.zeros(2), table["t"], step), strict=True):
        worst = max(worst, abs(q[0] - row["theta1"]), abs(q[0] + q[1] - row["theta2"]))
    assert worst < bound


def test_simple_pendulum(reference):
    """A point mass on a massless rod, released level, 10 s."""
    table = reference("A01_simple_pendulum_10s.csv")
    bob = MassProperties(1.0, np.array([0.0, 0.0, -1.0]), np.zeros((3, 3)))
    pivot = Joint("pivot", JointKind.REVOLUTE, "world", "bob", axis=np.array([0.0, -1.0, 0.0]))
    simulator, worst = Simulator(Tree([Part("bob", bob)], [pivot]), [GRAVITY], "dop853", 1e-13), 0.0
    for row, (q, _) in zip(table, states(simulator, table["theta"][:1], np.zeros(1), table["t"], 0.05), strict=True):
        worst = max(worst, abs(q[0] - row["theta"]))
    assert worst < 1e-9  # m, the rod has 1 m; measured 1e-14


def test_four_bar(four_bar, reference):
    """RK4 at 0.5 ms over 10 s.

    Twice a turn all rods lie in one line: the rows lose rank and the mechanism could fold. What projection leaves there
    strays by its root, so that 1e-11 m left would cost 2e-4 m.
    """
    table = reference("A02_four_bar_N1_20s.csv")
    table = table[table["t"] <= 10.0]
    tree, effects, start, rate = four_bar
    simulator, worst = Simulator(tree, effects), 0.0
    for row, (q, _) in zip(table, states(simulator, start, rate, table["t"], 5e-4), strict=True):
        worst = max(worst, abs(np.sin(q[0]) - row["B0x"]), abs(np.cos(q[0]) - row["B0y"]))
    assert worst < 1e-9  # m; measured 3e-11


@pytest.mark.parametrize(
    ("integrator", "tolerance", "step", "seconds", "bound"),
    [("rk4", 1e-9, 1e-4, 0.2, 1e-6), ("dop853", 1e-12, 0.01, 1.0, 1e-7)],  # rad; measured 5e-9, 8e-13
)
def test_heavy_top(integrator, tolerance, step, seconds, bound, heavy_top, reference):
    """150 rad/s about its axis."""
    table = reference("heavy_top_fast.csv")
    table = table[table["t"] <= seconds + 1e-9]
    simulator, start = Simulator(heavy_top, [GRAVITY], integrator, tolerance), np.array([0.0, 150.0, -4.61538])
    moved = states(simulator, heavy_top.neutral(), start, table["t"], step)
    assert max(attitude_error(row, q) for row, (q, _) in zip(table, moved, strict=True)) < bound


def test_torque_free_top(free_top, reference):
    """50 s about the middle axis: the start amplifies rounding by 1e9."""
    table = reference("torque_free_asymmetric_top.csv")
    start = np.array([0.0, 0.0, 0.0, 1e-3, 5.0, 1e-3])
    simulator = Simulator(free_top, [], "dop853", 1e-14)
    moved = states(simulator, free_top.neutral(), start, table["t"], 0.05)
    assert max(attitude_error(row, q[3:]) for row, (q, _) in zip(table, moved, strict=True)) < 1e-5  # measured 5e-7
