"""Generalized coordinates against finite differences, invariants, analytic solutions and Pinocchio."""

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from physics_prior import rotations
from physics_prior.dynamics.formulations import constrained_motion, generalized
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.newton_euler import Bodies, C, Q, V, W
from physics_prior.effects.attachment import Hinge
from physics_prior.effects.effect import Anchor, PointPair
from physics_prior.errors import ModelError, SimulationError
from physics_prior.inertia import MassProperties, box
from physics_prior.model import Joint, JointKind, Part, Tree

GRAVITY = np.array([0.3, -0.2, -9.81])
DOWN = np.array([0.0, 0.0, -9.81])
STEP = 1e-5  # of central differences: errors of 1e-10 from the step and from rounding


@pytest.fixture(params=range(12))
def moving(request, random_tree, random_state):
    """A random tree, a state and joint forces; some with massless links."""
    rng = np.random.default_rng(request.param)
    tree = random_tree(rng, massless=request.param % 2 == 0)
    q, v = random_state(rng, tree)
    return rng, tree, q, v, rng.normal(size=tree.nv)


def central(function, tree, q, v):
    """Derivative of function(q) along v."""
    return (function(tree.integrate(q, STEP * v)) - function(tree.integrate(q, -STEP * v))) / (2 * STEP)


def test_velocities_and_rates_are_derivatives(moving):
    _, tree, q, v, _ = moving
    k = kinematics(tree, q, v)
    bodies = Bodies.of(tree)
    T, Tdot = bodies.velocity_map(k)
    state = bodies.state(kinematics(tree, q, v))
    zero = np.zeros(tree.nv)
    velocity = central(lambda q: kinematics(tree, q, zero).position, tree, q, v)
    turning = central(lambda q: kinematics(tree, q, zero).orientation, tree, q, v)
    rate = central(lambda q: bodies.velocity_map(kinematics(tree, q, zero))[0], tree, q, v)
    np.testing.assert_allclose(k.velocity, velocity, rtol=0.0, atol=5e-8)  # measured 4e-10
    spin = rotations.angular_velocity_world(k.orientation, turning)
    np.testing.assert_allclose(k.angular_velocity, spin, rtol=0.0, atol=5e-8)  # measured 4e-10
    np.testing.assert_allclose(Tdot, rate, rtol=0.0, atol=5e-8)  # measured 7e-10
    np.testing.assert_allclose(
        (T @ v).reshape(-1, 6), state[:, [*range(7, 13)]], rtol=0.0, atol=1e-12
    )  # measured 4e-15


def test_point_jacobian_is_a_derivative(moving):
    rng, tree, q, v, _ = moving
    point = rng.normal(size=3)

    def place(part, q):
        # where the point is, seen through a pair with the world's origin
        pair = PointPair(Anchor("world", np.zeros(3)), Anchor(part, point), np.eye(3))
        return generalized.constraint_jacobian(tree, q, [pair])[0]

    for part in tree.frames:
        if tree.frames[part].link >= 0:
            expected = central(lambda q, part=part: place(part, q), tree, q, v)
            actual = generalized.point_jacobian(tree, q, part, point) @ v
            np.testing.assert_allclose(actual, expected, rtol=0.0, atol=5e-8)  # measured 3e-9
    assert not np.any(generalized.point_jacobian(tree, q, "world", point))


def test_mass_matrix_is_kinetic_energy(moving):
    _, tree, q, v, _ = moving
    M = generalized.mass_matrix(tree, q)
    bodies = Bodies.of(tree)
    state = bodies.state(kinematics(tree, q, v))
    kinetic = 0.5 * np.sum(bodies.mass * np.sum(state[:, V] ** 2, axis=1))
    kinetic += 0.5 * np.sum(bodies.moments * state[:, W] ** 2)
    np.testing.assert_allclose(M, M.T, rtol=0.0, atol=1e-13)  # measured 9e-16
    np.testing.assert_allclose(0.5 * v @ M @ v, kinetic, rtol=1e-13)  # measured 3e-16
    assert generalized.energy(tree, q, v, GRAVITY)[0] == pytest.approx(kinetic, rel=1e-13)


def test_inverse_dynamics_inverts_forward_dynamics(moving):
    _, tree, q, v, tau = moving
    vdot = generalized.accelerations(tree, q, v, tau, GRAVITY)
    found = generalized.inverse_dynamics(tree, q, v, vdot, GRAVITY)
    np.testing.assert_allclose(found, tau, rtol=0.0, atol=1e-11)  # measured 7e-14


def test_power_is_the_rate_of_energy(moving):
    _, tree, q, v, tau = moving
    vdot = generalized.accelerations(tree, q, v, tau, GRAVITY)
    after = sum(generalized.energy(tree, tree.integrate(q, STEP * v), v + STEP * vdot, GRAVITY))
    before = sum(generalized.energy(tree, tree.integrate(q, -STEP * v), v - STEP * vdot, GRAVITY))
    scale = 1.0 + np.abs(vdot).max() ** 2
    assert (after - before) / (2 * STEP) == pytest.approx(tau @ v, abs=1e-7 * scale)


def test_constraints_stay_closed(moving, random_pairs, consistent_velocity):
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 2)
    e, J = generalized.constraint_jacobian(tree, q, pairs)
    np.testing.assert_allclose(e, 0.0, rtol=0.0, atol=1e-13)  # measured 8e-15
    approach = central(lambda q: generalized.constraint_jacobian(tree, q, pairs)[0], tree, q, v)
    np.testing.assert_allclose(J @ v, approach, rtol=0.0, atol=5e-8)  # measured 4e-9

    v = consistent_velocity(tree, q, v, pairs)
    motion = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs)

    def edot(t):
        moved = tree.integrate(q, t * v + 0.5 * t * t * motion.acceleration)
        return generalized.constraint_jacobian(tree, moved, pairs)[1] @ (v + t * motion.acceleration)

    scale = 1.0 + np.abs(motion.acceleration).max()
    np.testing.assert_allclose(
        (edot(STEP) - edot(-STEP)) / (2 * STEP), 0.0, rtol=0.0, atol=1e-7 * scale
    )  # measured 5e-9 of scale


def test_forces_do_the_work_of_the_multipliers(moving, random_pairs, consistent_velocity):
    """M vdot = tau - bias + (J_b - J_a)^T f, the force on a standing at b's place, in line with that on b."""
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 2)
    v = consistent_velocity(tree, q, v, pairs)
    motion = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs)
    total = tau.copy()
    k = kinematics(tree, q, v)
    for pair, force in zip(pairs, motion.forces, strict=True):
        a, b = tree.frame(pair.a.part), tree.frame(pair.b.part)
        on_b = b.position + rotations.rotate(b.orientation, pair.b.point)
        place = k.position[b.link] + rotations.rotate(k.orientation[b.link], on_b)
        on_a = rotations.rotate(rotations.conjugate(k.orientation[a.link]), place - k.position[a.link])
        point_a = rotations.rotate(rotations.conjugate(a.orientation), on_a - a.position)
        total += generalized.point_jacobian(tree, q, pair.b.part, pair.b.point).T @ force
        total -= generalized.point_jacobian(tree, q, pair.a.part, point_a).T @ force
    found = generalized.inverse_dynamics(tree, q, v, motion.acceleration, GRAVITY)
    scale = 1.0 + np.abs(motion.forces).max()
    np.testing.assert_allclose(found, total, rtol=0.0, atol=1e-10 * scale)  # measured 3e-14 of scale


def test_joint_wrenches_hold_the_joint_forces(moving, random_pairs, consistent_velocity):
    """Along its freedoms a joint passes on tau, pairs or not."""
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 2)
    v = consistent_velocity(tree, q, v, pairs)
    motion = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs)
    force, torque = generalized.joint_wrenches(tree, q, v, motion.acceleration, GRAVITY, pairs, motion.forces)
    orientation = kinematics(tree, q, v).orientation
    scale = 1.0 + np.abs(force).max() + np.abs(torque).max()
    for i, link in enumerate(tree.links):
        to_child = rotations.conjugate(orientation[i])
        turn, push = rotations.rotate(to_child, torque[i]), rotations.rotate(to_child, force[i])
        passed = {
            JointKind.REVOLUTE: turn[None] @ link.joint.axis,
            JointKind.PRISMATIC: push[None] @ link.joint.axis,
            JointKind.SPHERICAL: turn,
            JointKind.FREE: np.concatenate([force[i], turn]),
        }[link.joint.kind]
        np.testing.assert_allclose(
            passed,
            tau[link.v],
            rtol=0.0,
            atol=1e-11 * scale,  # measured 7e-15 of scale
        )


def test_joint_wrench_is_the_attachment_force_of_the_same_chain():
    """A chain of ball joints, and the same bodies free but pinned by point pairs, feel the same forces."""
    rng = np.random.default_rng(1)
    bodies = [MassProperties(m, rng.normal(size=3), np.diag(i)) for m, i in ((1.0, [1, 2, 2.5]), (2.0, [2, 1.5, 1]))]
    parts = [Part("one", bodies[0]), Part("two", bodies[1])]
    elbow = rng.normal(size=3)
    chain = Tree(
        parts,
        [
            Joint("a", JointKind.SPHERICAL, "world", "one"),
            Joint("b", JointKind.SPHERICAL, "one", "two", elbow),
        ],
    )
    loose = Tree([*parts], [Joint(p.name, JointKind.FREE, "world", p.name) for p in parts])
    pins = [
        PointPair(Anchor("world", np.zeros(3)), Anchor("one", np.zeros(3)), np.eye(3)),
        PointPair(Anchor("one", elbow), Anchor("two", np.zeros(3)), np.eye(3)),
    ]
    q = np.concatenate([rotations.normalize(rng.normal(size=4)) for _ in range(2)])
    v = rng.normal(size=6)
    vdot = generalized.accelerations(chain, q, v, np.zeros(6), GRAVITY)
    force, _ = generalized.joint_wrenches(chain, q, v, vdot, GRAVITY)
    k = kinematics(chain, q, v)
    free_q = np.concatenate([[*k.position[i], *k.orientation[i]] for i in range(2)])
    spins = rotations.rotate(rotations.conjugate(k.orientation), k.angular_velocity)
    free_v = np.concatenate([[*k.velocity[i], *spins[i]] for i in range(2)])
    pinned = generalized.mixed_accelerations(loose, free_q, free_v, np.zeros(12), GRAVITY, pins)
    np.testing.assert_allclose(pinned.forces, force, rtol=1e-12)  # measured 3e-15
    assert pinned.rank == 6


def test_redundant_pairs_move_alike_and_share_the_force(moving, random_pairs, consistent_velocity):
    rng, tree, q, v, tau = moving
    pairs = random_pairs(rng, tree, q, 1)
    v = consistent_velocity(tree, q, v, pairs)
    once = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs)
    twice = generalized.mixed_accelerations(tree, q, v, tau, GRAVITY, pairs + pairs)
    scale = 1.0 + np.abs(once.acceleration).max()
    assert twice.rank == once.rank
    np.testing.assert_allclose(
        twice.acceleration, once.acceleration, rtol=0.0, atol=1e-11 * scale
    )  # measured 1e-14 of scale
    half = 0.5 * once.forces[0]
    np.testing.assert_allclose(twice.forces, [half, half], rtol=0.0, atol=1e-10 * (1.0 + np.abs(half).max()))


def test_rows_that_contradict_each_other_leave_newton_intact():
    """Two accelerations for one freedom: their mean, and no force from nowhere."""
    M, f, A = np.diag([2.0, 3.0]), np.array([1.0, 1.0]), np.array([[1.0, 0.0], [1.0, 0.0]])
    xddot, multipliers, rank = constrained_motion.solve(M, f, A, np.array([1.0, 2.0]), np.diag(M))
    np.testing.assert_allclose(xddot, [1.5, 1.0 / 3.0], rtol=1e-14)  # measured 2e-16
    np.testing.assert_allclose(M @ xddot + A.T @ multipliers, f, rtol=0.0, atol=1e-14)  # measured 5e-16
    assert rank == 1


@pytest.mark.parametrize("seed", range(3))
def test_free_flight_conserves_energy_and_momenta(seed, random_tree, random_state, trajectory):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 3, JointKind.FREE, kinds=(JointKind.REVOLUTE, JointKind.SPHERICAL))
    while any(link.parent < 0 for link in tree.links[1:]):  # all of it must fly
        tree = random_tree(rng, 3, JointKind.FREE, kinds=(JointKind.REVOLUTE, JointKind.SPHERICAL))
    q, v = random_state(rng, tree)
    rest = np.zeros(tree.nv)
    qs, vs = trajectory(
        tree,
        q,
        v,
        np.linspace(0.0, 1.0, 6),
        lambda q, v: generalized.accelerations(tree, q, v, rest, np.zeros(3)),
    )
    bodies = Bodies.of(tree)

    def invariants(q, v):
        state = bodies.state(kinematics(tree, q, v))
        momentum = bodies.mass[:, None] * state[:, V]
        angular = np.cross(state[:, C], momentum) + rotations.rotate(state[:, Q], bodies.moments * state[:, W])
        return np.hstack([momentum.sum(0), angular.sum(0), generalized.energy(tree, q, v, np.zeros(3))[0]])

    start = invariants(qs[0], vs[0])
    for q, v in zip(qs, vs, strict=True):
        np.testing.assert_allclose(invariants(q, v), start, rtol=0.0, atol=1e-9)  # measured 3e-11


def test_pendulum_equals_the_analytic_solution(double_pendulum, trajectory):
    """A rod released from the horizontal: sin(theta/2) = k sn(K + w t), k = sin(45 deg) (Jacobi)."""
    rod = Tree(double_pendulum.parts[:1], double_pendulum.joints[:1])
    times = np.linspace(0.0, 3.0, 31)
    q, _ = trajectory(
        rod,
        np.array([0.5 * np.pi]),
        np.zeros(1),
        times,
        lambda q, v: generalized.accelerations(rod, q, v, np.zeros(1), DOWN),
    )
    frequency = np.sqrt(1.5 * 9.81)
    k = np.sin(0.25 * np.pi)
    expected = 2.0 * np.arcsin(k * ellipj(frequency * times + ellipk(k * k), k * k)[0])
    np.testing.assert_allclose(q[:, 0], expected, rtol=0.0, atol=1e-10)  # measured 2e-12


def test_double_pendulum_follows_the_reference(double_pendulum, trajectory, reference):
    expected = reference("double_pendulum_moderate.csv")[:101]
    times = expected["t"]
    q, v = trajectory(
        double_pendulum,
        np.array([0.5, 0.5]),
        np.zeros(2),
        times,
        lambda q, v: generalized.accelerations(double_pendulum, q, v, np.zeros(2), DOWN),
    )
    np.testing.assert_allclose(q[:, 0], expected["theta1"], rtol=0.0, atol=1e-10)  # measured 4e-13
    np.testing.assert_allclose(q.sum(axis=1), expected["theta2"], rtol=0.0, atol=1e-10)  # measured 9e-13
    np.testing.assert_allclose(v.sum(axis=1), expected["omega2"], rtol=0.0, atol=1e-9)  # measured 8e-12


def test_heavy_top_follows_the_reference(heavy_top, trajectory, reference):
    expected = reference("heavy_top_fast.csv")[:101]
    q, v = trajectory(
        heavy_top,
        heavy_top.neutral(),
        np.array([0.0, 150.0, -4.61538]),
        expected["t"],
        lambda q, v: generalized.accelerations(heavy_top, q, v, np.zeros(3), DOWN),
    )
    attitude = np.stack([expected[name] for name in ("qw", "qx", "qy", "qz")], axis=1)
    turn = rotations.log(rotations.multiply(rotations.conjugate(attitude), q))
    np.testing.assert_allclose(turn, 0.0, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(v[:, 1], expected["wy_body"], rtol=1e-10)


def test_bricard_closes_with_a_redundant_row(trajectory, reference):
    """Six hinges of which five rows close the loop and four would do: the motion is unique all the same."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]], dtype=float)
    axes = np.eye(3)[[1, 2, 0, 1, 2, 0]]
    parts, joints = [], []
    for i in range(5):
        reach = points[i + 1] - points[i]
        inertia = box(1.0, np.where(np.abs(reach) > 0.5, 1.0, 0.1)).inertia
        parts.append(Part(f"rod{i}", MassProperties(1.0, 0.5 * reach, inertia)))
        under = f"rod{i - 1}" if i else "world"
        place = points[i] - points[i - 1] if i else points[0]
        joints.append(Joint(f"hinge{i}", JointKind.REVOLUTE, under, f"rod{i}", place, axis=axes[i]))
    tree = Tree(parts, joints)
    end = points[5] - points[4]
    closing = Hinge(part="rod4", point=end, at=points[5], axis=axes[5], to_axis=axes[5])
    loop = closing.point_pairs(tree)
    gravity, rest = np.array([0.0, -9.81, 0.0]), np.zeros(5)

    def motion(q, v):
        return generalized.mixed_accelerations(tree, q, v, rest, gravity, loop)

    expected = reference("A04_bricard_10s.csv")[:21]
    qs, vs = trajectory(tree, rest, rest, expected["t"], lambda q, v: motion(q, v).acceleration)
    for q, v, row in zip(qs, vs, expected, strict=True):
        assert motion(q, v).rank == 4
        corner = kinematics(tree, q, v).position[3]
        np.testing.assert_allclose(corner, [row["P3x"], row["P3y"], row["P3z"]], rtol=0.0, atol=1e-10)  # measured 2e-12


def test_pinocchio_agrees(moving):
    pin = pytest.importorskip("pinocchio")
    rng, tree, q, v, _ = moving
    vdot = rng.normal(size=tree.nv)
    model = pin.Model()
    model.gravity.linear = GRAVITY
    q_pin, v_pin, a_pin = np.array(q), np.array(v), np.array(vdot)
    ids = []
    for link in tree.links:
        joint = link.joint
        kind = {
            JointKind.REVOLUTE: lambda joint: pin.JointModelRevoluteUnaligned(joint.axis),
            JointKind.PRISMATIC: lambda joint: pin.JointModelPrismaticUnaligned(joint.axis),
            JointKind.SPHERICAL: lambda _: pin.JointModelSpherical(),
            JointKind.FREE: lambda _: pin.JointModelFreeFlyer(),
        }[joint.kind](joint)
        place = pin.SE3(rotations.matrix_from_quaternion(joint.orientation), joint.position)
        ids.append(model.addJoint(ids[link.parent] if link.parent >= 0 else 0, kind, place, joint.name))
        body = link.mass_properties
        if body.mass > 0.0:
            inertia = pin.Inertia(body.mass, np.array(body.center_of_mass), np.array(body.inertia))
            model.appendBodyToJoint(ids[-1], inertia, pin.SE3.Identity())
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
            q_pin[link.q.stop - 4 : link.q.stop] = np.roll(q[link.q][-4:], -1)
        if joint.kind is JointKind.FREE:
            # Pinocchio takes the linear velocity in the child's own axes
            R = rotations.matrix_from_quaternion(q[link.q][3:])
            linear = slice(link.v.start, link.v.start + 3)
            spin = v[link.v][3:]
            v_pin[linear] = R.T @ v[linear]
            a_pin[linear] = R.T @ vdot[linear] - np.cross(spin, v_pin[linear])
    data = model.createData()
    expected = np.array(pin.rnea(model, data, q_pin, v_pin, a_pin))
    for link in tree.links:
        if link.joint.kind is JointKind.FREE:
            linear = slice(link.v.start, link.v.start + 3)
            expected[linear] = rotations.rotate(q[link.q][3:], expected[linear])
    found = generalized.inverse_dynamics(tree, q, v, vdot, GRAVITY)
    np.testing.assert_allclose(
        found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max()
    )  # measured 3e-15 relative


@pytest.mark.parametrize("index", range(3))
def test_states_that_are_not_finite_are_refused(index, double_pendulum):
    state = [np.zeros(2), np.zeros(2), np.zeros(2)]
    state[index] = np.array([0.0, np.nan])
    with pytest.raises(SimulationError, match="not finite"):
        generalized.accelerations(double_pendulum, *state, DOWN)


def test_a_rod_without_direction_is_refused(double_pendulum):
    rod = PointPair(Anchor("world", np.zeros(3)), Anchor("upper", np.zeros(3)), np.eye(1, 3), 1.0)
    with pytest.raises(SimulationError, match="no direction"):
        generalized.mixed_accelerations(double_pendulum, *np.zeros((3, 2)), DOWN, [rod])


def test_an_unknown_part_is_named(double_pendulum):
    with pytest.raises(ModelError, match="'leg' is unknown"):
        generalized.point_jacobian(double_pendulum, np.zeros(2), "leg", np.zeros(3))
