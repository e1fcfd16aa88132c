"""The corrected equations: ours pass a check that the form printed with a slip fails.

Every test states a law that does not depend on the formula (a conserved quantity, a constraint that stays
closed, a finite difference), holds our formula to it, and shows that the printed or otherwise wrong form
breaks it by far. Numbers as in docs/equations.md.
"""

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.formulations import generalized, maximal, point_pairs, quaternion
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.newton_euler import Bodies, Q, V, W
from physics_prior.effects.effect import Anchor, PointPair
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree

MOMENTS = np.array([1.0, 2.0, 2.5])
DOWN = np.array([0.0, 0.0, -9.81])
STEP = 1e-5  # of central differences
BROKEN = 1e-2  # what a wrong form is off by at least, all quantities being of size one


@pytest.fixture(params=range(3))
def rng(request):
    return np.random.default_rng(request.param)


@pytest.fixture
def arm():
    """Three links, a ball joint and two hinges out of line: velocities meet every term."""
    rng = np.random.default_rng(7)
    parts = [Part(name, MassProperties(1.5, rng.normal(size=3), np.diag(MOMENTS))) for name in "abc"]
    hinge = {"axis": rng.normal(size=3)}
    joints = [
        Joint("shoulder", JointKind.SPHERICAL, "world", "a"),
        Joint("elbow", JointKind.REVOLUTE, "a", "b", rng.normal(size=3), **hinge),
        Joint("wrist", JointKind.REVOLUTE, "b", "c", rng.normal(size=3), rng.normal(size=4), **hinge),
    ]
    return Tree(parts, joints)


def off(actual, expected):
    return float(np.max(np.abs(actual - expected)))


def test_equation_1_rotation_matrix(rng):
    """R(q) p = q o p o q*; the printed entry (1, 3) is 2 (xz - wy)."""
    q, p = rotations.normalize(rng.normal(size=4)), rng.normal(size=3)
    expected = rotations.multiply(rotations.multiply(q, [0.0, *p]), rotations.conjugate(q))[1:]
    R = rotations.matrix_from_quaternion(q)
    assert off(R @ p, expected) < 1e-14  # measured 4e-16
    w, x, y, z = q
    printed = R.copy()
    printed[0, 2] = 2.0 * (x * z - w * y)
    assert off(printed @ p, expected) > BROKEN
    assert off(printed.T @ printed, np.eye(3)) > BROKEN


def test_equation_2_quaternion_products_and_angular_velocities(rng):
    """Q multiplies from the left and gives the body's w', Qbar from the right and the world's w."""
    q, p = rotations.normalize(rng.normal(size=(2, 4)))
    Q, Qbar = rotations.left_matrix(q), rotations.right_matrix(q)
    assert off(Q @ p, rotations.multiply(q, p)) < 1e-15
    assert off(Qbar @ p, rotations.multiply(p, q)) < 1e-15
    assert off(Qbar @ p, rotations.multiply(q, p)) > BROKEN

    spin = rng.normal(size=3)  # in body axes: q turns on the right
    ahead, behind = (rotations.multiply(q, rotations.exp(sign * STEP * spin)) for sign in (1.0, -1.0))
    qdot = (ahead - behind) / (2.0 * STEP)
    assert off(2.0 * Q.T @ qdot, [0.0, *spin]) < 1e-9  # measured 2e-11
    assert off(2.0 * Qbar.T @ qdot, [0.0, *rotations.rotate(q, spin)]) < 1e-9
    assert off(2.0 * Qbar.T @ qdot, [0.0, *spin]) > BROKEN


def test_equation_3_newton_euler(rng, free_top):
    """The angular momentum R I' w' about the centre of mass changes by (p - c) x f, in the world's axes."""
    system = maximal.MaximalCoordinates(free_top, np.zeros(3))
    c, q, spin = rng.normal(size=3), rotations.normalize(rng.normal(size=4)), rng.normal(size=3)
    force, point = rng.normal(size=(2, 3))
    torque = np.cross(point - c, force)
    state = system.state(np.concatenate([c, q]), np.concatenate([rng.normal(size=3), spin]))
    moments = system.bodies.moments[0]

    def momentum_rate(spin_rate):
        def momentum(t):
            turned = rotations.multiply(state[0, Q], rotations.exp(t * spin))
            return rotations.rotate(turned, moments * (spin + t * spin_rate))

        return (momentum(STEP) - momentum(-STEP)) / (2.0 * STEP)

    in_body = rotations.rotate(rotations.conjugate(q), torque)
    rate = system.derivative(state, np.concatenate([force, in_body]))[0]
    assert off(rate[V], force / system.bodies.mass[0]) < 1e-14
    assert off(momentum_rate(rate[W]), torque) < 1e-8  # measured 4e-10
    gyroscopic = np.cross(spin, moments * spin)
    for wrong in (torque - gyroscopic, in_body + gyroscopic, in_body):
        assert off(momentum_rate(wrong / moments), torque) > BROKEN


def test_equation_4_right_hand_side_is_the_rate_of_the_rows(arm):
    """A pinned point stays where it is: edot does not change. Printed without the dot, A xdot, it does."""
    rng = np.random.default_rng(1)
    q = arm.integrate(arm.neutral(), rng.normal(size=arm.nv))
    v = rng.normal(size=arm.nv)
    system = maximal.MaximalCoordinates(arm, DOWN)
    state = system.state(q, v)
    A, gamma = point_pairs.rows(system.joints, state)
    xdot = state[:, 7:].ravel()
    xddot, _, _ = system.solve(state, np.zeros(arm.nv))

    def edot(t, xddot):
        moved = state.copy()
        half = 0.5 * t * t * xddot.reshape(-1, 6)
        moved[:, :3] += t * state[:, V] + half[:, :3]
        moved[:, Q] = rotations.multiply(state[:, Q], rotations.exp(t * state[:, W] + half[:, 3:]))
        return point_pairs.rows(system.joints, moved)[0] @ (xdot + t * xddot.ravel())

    def change(xddot):
        return (edot(STEP, xddot) - edot(-STEP, xddot)) / (2.0 * STEP)

    assert off(A @ xdot, 0.0) < 1e-13
    assert off(change(xddot), 0.0) < 1e-7  # measured 7e-10
    M = np.diag(system.bodies.diagonal)
    f = system.bodies.gravity_and_gyroscopic(state[:, W], DOWN)
    block = np.block([[M, A.T], [A, np.zeros((len(A), len(A)))]])
    ours = np.linalg.solve(block, np.concatenate([f, gamma]))[: len(f)]
    assert off(ours, xddot.ravel()) < 1e-11  # measured 5e-15: the block system as it stands
    printed = np.linalg.solve(block, np.concatenate([f, -A @ xdot]))[: len(f)]
    assert off(change(printed), 0.0) > BROKEN


def test_equation_4_sign_of_the_constraint_force(free_top):
    """What hangs at rest by its centre is carried: f_c = -A^T lambda is its weight upwards."""
    pin = PointPair(Anchor("world", np.zeros(3)), Anchor("top", np.zeros(3)), np.eye(3))
    rest = np.zeros(6)
    motion = maximal.accelerations(free_top, free_top.neutral(), rest, rest, DOWN, [pin])
    weight = free_top.mass * DOWN
    assert off(motion.acceleration, 0.0) < 1e-14
    assert off(motion.forces[0], -weight) < 1e-13
    # M xddot = f + f_c: with f_c = +A^T lambda it would fall twice as fast
    assert off(weight + motion.forces[0], 0.0) < 1e-13
    assert off(weight - motion.forces[0], 0.0) > BROKEN


def test_equation_5_norm_constraint(rng):
    """|q| stays one: q . qddot = -|qdot|^2. The printed -2 |q|^2 pulls the quaternion off the sphere."""
    q, spin, torque = rotations.normalize(rng.normal(size=4)), rng.normal(size=3), rng.normal(size=3)
    qdot = rotations.derivative(q, spin)
    qddot, multiplier = quaternion.rotational_motion(q, qdot, MOMENTS, torque)

    def bend(qddot):
        """Return half the second derivative of |q|^2."""
        return q @ qddot + qdot @ qdot

    block = np.block([[quaternion.rotational_mass(q, MOMENTS), 2.0 * q[:, None]], [2.0 * q[None], np.zeros((1, 1))]])
    force = quaternion.rotational_force(q, qdot, MOMENTS, torque)
    ours = np.linalg.solve(block, [*force, -2.0 * qdot @ qdot])
    printed = np.linalg.solve(block, [*force, -2.0 * q @ q])
    assert off(ours, [*qddot, multiplier]) < 1e-13  # measured 3e-15
    assert abs(bend(qddot)) < 1e-14  # measured 7e-16
    assert abs(bend(printed[:4])) > BROKEN


def test_equation_5_multiplier_is_no_force(rng):
    """A body that nothing touches has lambda = w'^T I' w': twice its kinetic energy, and no force at all."""
    q, spin = rotations.normalize(rng.normal(size=4)), rng.normal(size=3)
    _, multiplier = quaternion.rotational_motion(q, rotations.derivative(q, spin), MOMENTS, np.zeros(3))
    assert multiplier == pytest.approx(spin @ (MOMENTS * spin), rel=1e-13)
    assert multiplier > BROKEN


def test_equation_6_sign_of_the_velocity_term(arm):
    """Energy changes by the power of the joint forces alone. With g = +T^T M Tdot v it comes from nowhere."""
    rng = np.random.default_rng(2)
    q = arm.integrate(arm.neutral(), rng.normal(size=arm.nv))
    v, tau = rng.normal(size=(2, arm.nv))
    bodies = Bodies.of(arm)
    k = kinematics(arm, q, v)
    T, Tdot = bodies.velocity_map(k)
    M = np.diag(bodies.diagonal)
    f = bodies.gravity_and_gyroscopic(bodies.state(k)[:, W], DOWN)

    def acceleration(sign):
        g = sign * T.T @ M @ Tdot @ v
        return np.linalg.solve(T.T @ M @ T, tau + T.T @ f + g)

    def power(vdot):
        ahead, behind = (
            sum(generalized.energy(arm, arm.integrate(q, t * v + 0.5 * t * t * vdot), v + t * vdot, DOWN))
            for t in (STEP, -STEP)
        )
        return (ahead - behind) / (2.0 * STEP)

    assert off(generalized.accelerations(arm, q, v, tau, DOWN), acceleration(-1.0)) < 1e-12
    assert abs(power(acceleration(-1.0)) - tau @ v) < 1e-7  # measured 3e-9
    assert abs(power(acceleration(+1.0)) - tau @ v) > BROKEN


def test_equation_6_gyroscopic_term_only_once(rng):
    """Either -w' x I'w' (velocities w') or 8 Qd J Qd^T q (quaternions): both at once, or none, is wrong."""
    q, spin = rotations.normalize(rng.normal(size=4)), rng.normal(size=3)
    qdot = rotations.derivative(q, spin)
    gyroscopic = -np.cross(spin, MOMENTS * spin)

    def momentum_rate(torque):
        """Rate of R I' w' of a body without load, but for a torque put into the quaternion equations."""
        qddot, _ = quaternion.rotational_motion(q, qdot, MOMENTS, torque)
        spin_rate = rotations.angular_velocity_body(q, qddot)
        return rotations.rotate(q, MOMENTS * spin_rate + np.cross(spin, MOMENTS * spin))

    assert off(momentum_rate(np.zeros(3)), 0.0) < 1e-13  # measured 3e-15
    assert off(momentum_rate(gyroscopic), 0.0) > BROKEN  # both
    assert off(momentum_rate(-gyroscopic), 0.0) > BROKEN  # none: the quaternion term is taken out again


def test_equation_7_constraints_beside_the_joints(arm):
    """A loop stays closed only if its rows account for how T and the rows themselves change."""
    rng = np.random.default_rng(3)
    q = arm.integrate(arm.neutral(), rng.normal(size=arm.nv))
    tip = rng.normal(size=3)
    k = kinematics(arm, q, np.zeros(arm.nv))
    place = k.position[2] + rotations.rotate(k.orientation[2], tip)
    loop = [PointPair(Anchor("world", place), Anchor("c", tip), np.eye(3))]
    _, J = generalized.constraint_jacobian(arm, q, loop)
    v = rng.normal(size=arm.nv)
    v -= np.linalg.pinv(J) @ J @ v
    motion = generalized.mixed_accelerations(arm, q, v, np.zeros(arm.nv), DOWN, loop)

    def change(vdot):
        def edot(t):
            moved = arm.integrate(q, t * v + 0.5 * t * t * vdot)
            return generalized.constraint_jacobian(arm, moved, loop)[1] @ (v + t * vdot)

        return (edot(STEP) - edot(-STEP)) / (2.0 * STEP)

    bodies = Bodies.of(arm)
    k = kinematics(arm, q, v)
    T, Tdot = bodies.velocity_map(k)
    A, gamma = point_pairs.rows(point_pairs.body_pairs(bodies, loop), bodies.state(k))
    M = generalized.mass_matrix(arm, q)
    force = -generalized.inverse_dynamics(arm, q, v, np.zeros(arm.nv), DOWN)
    block = np.block([[M, (A @ T).T], [A @ T, np.zeros((3, 3))]])

    def acceleration(right_side):
        return np.linalg.solve(block, np.concatenate([force, right_side]))[: arm.nv]

    ours = gamma - A @ Tdot @ v
    assert off(acceleration(ours), motion.acceleration) < 1e-11
    assert off(change(motion.acceleration), 0.0) < 1e-7  # measured 5e-10
    for wrong in (gamma, -A @ Tdot @ v, np.zeros(3)):
        assert off(change(acceleration(wrong)), 0.0) > BROKEN


def test_equation_9_attachment_is_an_impulse(arm):
    """Momentum changes by the impulses alone, the attached point stops, and the lost energy is Carnot's."""
    rng = np.random.default_rng(4)
    q = arm.integrate(arm.neutral(), rng.normal(size=arm.nv))
    v = rng.normal(size=arm.nv)
    tip = rng.normal(size=3)
    k = kinematics(arm, q, v)
    place = k.position[2] + rotations.rotate(k.orientation[2], tip)
    pin = [PointPair(Anchor("world", place), Anchor("c", tip), np.eye(3))]
    after, impulses, rank = generalized.attach(arm, q, v, pin)
    M, J = generalized.mass_matrix(arm, q), generalized.point_jacobian(arm, q, "c", tip)
    lost = generalized.energy(arm, q, v, DOWN)[0] - generalized.energy(arm, q, after, DOWN)[0]
    assert rank == 3
    assert off(J @ after, 0.0) < 1e-13  # measured 7e-16
    assert off(M @ (after - v), J.T @ impulses[0]) < 1e-12  # measured 4e-15
    assert lost == pytest.approx(0.5 * (v - after) @ M @ (v - after), rel=1e-12)

    # the accelerations of equation 4 alone do not stop the point, however long they hold it
    held = generalized.mixed_accelerations(arm, q, v, np.zeros(arm.nv), DOWN, pin)
    assert off(J @ (v + STEP * held.acceleration), 0.0) > BROKEN
    # the other sign of the impulse balances no momentum, nor does stopping the point without regard to mass
    assert off(M @ (after - v), -J.T @ impulses[0]) > BROKEN
    nearest = v - np.linalg.pinv(J) @ J @ v
    reaction = np.linalg.lstsq(J.T, M @ (nearest - v), rcond=None)[0]
    assert off(M @ (nearest - v), J.T @ reaction) > BROKEN
