"""Fast spin: the torque of the implicit midpoint rule keeps a free body's energy, the explicit one does not."""

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.gyroscopic import middle_correction, middle_rate, spin_matrix, take_at_middle
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties, box
from physics_prior.model import Joint, JointKind, Part, Tree

MOMENTS = np.array([1.0, 2.0, 3.0])
H = 1e-3


def six(matrix):
    return tuple(matrix[np.triu_indices(3)])


def test_midpoint_rule_keeps_energy_and_momentum_exactly():
    """I (w+ - w) + h wm x I wm = 0 conserves w.I w / 2 and |I w|: both are quadratic."""
    rng = np.random.default_rng(0)
    R = rotations.matrix_from_quaternion(rotations.normalize(rng.normal(size=4)))
    inertia = R @ np.diag(MOMENTS) @ R.T
    for size in (1e-3, 1.0, 150.0, 1000.0):
        omega = rng.normal(size=3)
        omega *= size / np.linalg.norm(omega)
        middle = np.array(middle_rate(six(inertia), tuple(omega), H))
        after = 2.0 * middle - omega
        residual = inertia @ (after - omega) + H * np.cross(middle, inertia @ middle)
        assert np.max(np.abs(residual)) < 1e-13 * size  # measured 2e-15
        assert abs(after @ inertia @ after / (omega @ inertia @ omega) - 1.0) < 1e-14
        assert abs(np.linalg.norm(inertia @ after) / np.linalg.norm(inertia @ omega) - 1.0) < 1e-14


def test_spin_matrix_and_correction_are_derivatives():
    rng = np.random.default_rng(1)
    inertia, omega, direction = np.diag(MOMENTS), 20.0 * rng.normal(size=3), rng.normal(size=3)

    def torques(w):
        middle = np.array(middle_rate(six(inertia), tuple(w), H))
        return np.cross(w, inertia @ w), np.cross(middle, inertia @ middle)

    ends = [torques(omega + sign * 1e-4 * direction) for sign in (1.0, -1.0)]
    explicit, middle = [(a - b) / 2e-4 for a, b in zip(*ends, strict=True)]
    K = np.reshape(spin_matrix(six(inertia), tuple(omega)), (3, 3))
    assert np.allclose(K @ direction, explicit, rtol=1e-9, atol=1e-9)
    correction = middle_correction(six(inertia), tuple(omega), H, tuple(direction))
    assert np.allclose(correction, middle - explicit, rtol=1e-7, atol=1e-7)  # measured 1e-9


@pytest.mark.parametrize("count", [1, 3, 4, 5, 8, 9])
def test_links_are_taken_four_at_once_as_one_by_one(count):
    """Beside hinges and a massless ball, which are left as they are."""
    rng = np.random.default_rng(count)
    parts, joints = [], []
    for i in range(count + 3):
        kind = JointKind.REVOLUTE if i in (0, 2) else JointKind.SPHERICAL
        R = rotations.matrix_from_quaternion(rotations.normalize(rng.normal(size=4)))
        body = MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))
        if i != 1:
            body = box(2.0, tuple(rng.uniform(0.1, 1.0, size=3))).transformed(R, rng.normal(size=3))
        parts.append(Part(f"part{i}", body))
        parent = "world" if i == 0 else f"part{i - 1}"
        joints.append(Joint(f"joint{i}", kind, parent, f"part{i}", rng.normal(size=3), axis=np.array([0.0, 0.0, 1.0])))
    tree = Tree(parts, joints)
    simulator = Simulator(tree)
    memory = simulator.memory
    simulator.move(tree.integrate(tree.neutral(), rng.normal(size=tree.nv)), rng.normal(size=tree.nv))
    explicit = memory.work["gyroscopic"].copy()
    take_at_middle(memory.links, memory.work, H)
    for i, (link, here) in enumerate(zip(memory.links, memory.work, strict=True)):
        if link["kind"] != JointKind.SPHERICAL or link["mass"] == 0.0:
            np.testing.assert_array_equal(here["gyroscopic"], explicit[i])
            continue
        turning = np.zeros((3, 3))
        turning[np.triu_indices(3)] = here["inertia"]
        c = here["center"]
        turning += np.triu(turning, 1).T + link["mass"] * (c @ c * np.eye(3) - np.outer(c, c))
        omega = here["omega"]
        middle = np.array(middle_rate(six(turning), tuple(omega), H))
        expected = explicit[i] + np.cross(middle, turning @ middle) - np.cross(omega, turning @ omega)
        np.testing.assert_allclose(
            here["gyroscopic"], expected, rtol=1e-12, atol=1e-12 * np.abs(explicit).max()
        )  # measured 3e-15


def test_free_top_keeps_its_energy_at_any_spin(free_top):
    """150 rad/s, 1 ms steps of semi-implicit Euler, 10 s: an explicit torque would feed it."""
    simulator = Simulator(free_top, integrator="semi_implicit_euler")
    q, v = free_top.neutral(), np.zeros(6)
    v[3:] = 150.0 * np.array([0.02, 1.0, 0.01]) / np.linalg.norm([0.02, 1.0, 0.01])
    energy = MOMENTS @ v[3:] ** 2
    worst = 0.0
    for _ in range(100):
        simulator.advance(q, v, H, 100)
        worst = max(worst, abs(MOMENTS @ v[3:] ** 2 / energy - 1.0))
    assert worst < 1e-11  # measured 2e-13
    assert abs(np.linalg.norm(q[3:]) - 1.0) < 1e-15


def test_heavy_top_does_not_blow_up(heavy_top):
    """Spinning at 150 rad/s under gravity, 10 s: the torque is taken about the pivot, not the centre."""
    simulator = Simulator(heavy_top, [Gravity(acceleration=(0.0, 0.0, -9.81))], "semi_implicit_euler")
    q, v = heavy_top.neutral(), np.array([0.0, 150.0, -4.61538])
    simulator.move(q, v)
    before, worst = simulator.energy(), 0.0
    for _ in range(100):
        simulator.advance(q, v, H, 100)
        simulator.move(q, v)
        worst = max(worst, abs(simulator.energy() - before))
    assert worst < 0.02 * before  # measured 80 J of 5436 J (explicit torques: not finite after 0.2 s)


def test_torque_that_carries_others_is_taken_at_the_middle_too():
    """A flywheel on a ball joint that carries a small arm keeps spinning stably for 5 s at 100 rad/s."""
    wheel = MassProperties(2.0, np.zeros(3), np.diag([0.01, 0.01, 0.02]))
    arm = MassProperties(0.1, np.array([0.05, 0.0, 0.0]), 1e-4 * np.eye(3))
    tree = Tree(
        [Part("wheel", wheel), Part("arm", arm)],
        [
            Joint("hub", JointKind.SPHERICAL, "world", "wheel"),
            Joint(
                "pin", JointKind.REVOLUTE, "wheel", "arm", np.array([0.05, 0.0, 0.0]), axis=np.array([0.0, 0.0, 1.0])
            ),
        ],
    )
    simulator = Simulator(tree, integrator="semi_implicit_euler")
    q, v = tree.neutral(), np.array([0.5, 0.0, 100.0, 0.0])
    simulator.move(q, v)
    before = simulator.energy()
    simulator.advance(q, v, H, 5000)
    simulator.move(q, v)
    assert simulator.energy() == pytest.approx(before, rel=0.05)
