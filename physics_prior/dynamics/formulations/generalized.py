"""Generalized coordinates: only what the joints allow (equation 6), loops beside it (equation 7).

The velocities (v, w') of all bodies are T(u) v, so joints need no multipliers: projecting Newton-Euler on T
removes what they carry. T is not the Jacobian of coordinates, so its rate is dT/dt and the gyroscopic term
-w' x I'w' stands in the force.
"""

from collections.abc import Sequence

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.formulations import constrained_motion, point_pairs
from physics_prior.dynamics.formulations.constrained_motion import ConstrainedMotion
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.newton_euler import Bodies, C, Q, W
from physics_prior.effects.effect import PointPair
from physics_prior.model import Tree


def mass_matrix(tree: Tree, q: np.ndarray) -> np.ndarray:
    """T^T M T, (nv, nv), at configuration q (nq,)."""
    bodies = Bodies.of(tree)
    T, _ = bodies.velocity_map(kinematics(tree, q, np.zeros(tree.nv)))
    return np.asarray(T.T @ (bodies.diagonal[:, None] * T))


def inverse_dynamics(tree: Tree, q: np.ndarray, v: np.ndarray, vdot: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Return the forces tau (nv,) that accelerate the tree by vdot (nv,): equation 6 from left to right.

    At vdot = 0 they are the bias: Coriolis, centrifugal and gravity terms. gravity: (3,) m/s^2, world.
    """
    bodies = Bodies.of(tree)
    T, Tdot = bodies.velocity_map(kinematics(tree, q, v))
    f = bodies.gravity_and_gyroscopic((T @ v).reshape(-1, 6)[:, 3:], gravity)
    return np.asarray(T.T @ (bodies.diagonal * (T @ vdot + Tdot @ v) - f))


def accelerations(tree: Tree, q: np.ndarray, v: np.ndarray, tau: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Forward dynamics: vdot (nv,) under joint forces tau (nv,) and gravity (3,) m/s^2.

    Raises:
        SimulationError: the state is not finite, or a joint moves nothing that has inertia.
    """
    return mixed_accelerations(tree, q, v, tau, gravity, ()).acceleration


def mixed_accelerations(
    tree: Tree,
    q: np.ndarray,
    v: np.ndarray,
    tau: np.ndarray,
    gravity: np.ndarray,
    pairs: Sequence[PointPair],
) -> ConstrainedMotion:
    """Forward dynamics of a tree with loops and attachments (equation 7).

    (T^T M T) vdot + (A T)^T lambda = tau + T^T (f - M Tdot v) and A T vdot = gamma - A Tdot v, with A and
    gamma those of the bodies (equation 4), f gravity and the gyroscopic terms.

    Args:
        tree: the model.
        q: (nq,) configuration.
        v: (nv,) velocity; it should fulfil the constraints, which are held at acceleration level.
        tau: (nv,) generalized forces.
        gravity: (3,) m/s^2, world axes.
        pairs: the constraints.

    Raises:
        SimulationError: as ``constrained_motion.solve``, and a rod without direction.
    """
    bodies = Bodies.of(tree)
    k = kinematics(tree, q, v)
    T, Tdot = bodies.velocity_map(k)
    state = bodies.state(k)
    f = bodies.gravity_and_gyroscopic(state[:, W], gravity)
    mass = bodies.diagonal[:, None] * T
    closed = point_pairs.body_pairs(bodies, pairs)
    A, gamma = point_pairs.rows(closed, state)
    M = T.T @ mass
    vdot, multipliers, rank = constrained_motion.solve(
        M, tau + T.T @ f - mass.T @ (Tdot @ v), A @ T, gamma - A @ (Tdot @ v), np.diag(M)
    )
    return ConstrainedMotion(vdot, point_pairs.forces(closed, state, multipliers), rank)


def attach(tree: Tree, q: np.ndarray, v: np.ndarray, pairs: Sequence[PointPair]) -> tuple[np.ndarray, np.ndarray, int]:
    """Velocity after making attachments at once, the impulses that it takes and their rank (equation 9).

    [M A^T; A 0] [v+; L] = [M v-; 0]: the impact is plastic, v+ is the velocity nearest to v- in the mass
    metric that fulfils the constraints. Returns v+ (nv,), impulses (pairs, 3) N s on b's parts at b, world
    axes, and the rank.
    """
    bodies = Bodies.of(tree)
    k = kinematics(tree, q, v)
    T, _ = bodies.velocity_map(k)
    state = bodies.state(k)
    closed = point_pairs.body_pairs(bodies, pairs)
    A, _ = point_pairs.rows(closed, state)
    M = T.T @ (bodies.diagonal[:, None] * T)
    after, multipliers, rank = constrained_motion.solve(M, M @ v, A @ T, np.zeros(len(A)), np.diag(M))
    return after, point_pairs.forces(closed, state, multipliers), rank


def constraint_jacobian(tree: Tree, q: np.ndarray, pairs: Sequence[PointPair]) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual e(q), (rows,) m, of point pairs and its Jacobian A T, (rows, nv): edot = A T v."""
    bodies = Bodies.of(tree)
    k = kinematics(tree, q, np.zeros(tree.nv))
    state = bodies.state(k)
    closed = point_pairs.body_pairs(bodies, pairs)
    T, _ = bodies.velocity_map(k)
    return point_pairs.residual(closed, state), point_pairs.rows(closed, state)[0] @ T


def point_jacobian(tree: Tree, q: np.ndarray, part: str, point: np.ndarray) -> np.ndarray:
    """(3, nv) from v to the velocity, world axes, of a point (3,) m fixed in a part's frame.

    Raises:
        ModelError: the part is unknown.
    """
    frame = tree.frame(part)
    k = kinematics(tree, q, np.zeros(tree.nv))
    on_link = frame.position + rotations.rotate(frame.orientation, point)
    lever = rotations.rotate(k.orientation[frame.link], on_link)
    linear, angular = k.linear_jacobian[frame.link], k.angular_jacobian[frame.link]
    return np.asarray(linear - rotations.skew(lever) @ angular)


def energy(tree: Tree, q: np.ndarray, v: np.ndarray, gravity: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy, J; the potential is zero with all mass in the world's origin."""
    bodies = Bodies.of(tree)
    k = kinematics(tree, q, v)
    T, _ = bodies.velocity_map(k)
    center = bodies.state(k)[:, C]
    kinetic = 0.5 * bodies.diagonal @ (T @ v) ** 2
    return float(kinetic), float(-bodies.mass @ center @ gravity)


def joint_wrenches(
    tree: Tree,
    q: np.ndarray,
    v: np.ndarray,
    vdot: np.ndarray,
    gravity: np.ndarray,
    pairs: Sequence[PointPair] = (),
    forces: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return force (links, 3) N and torque (links, 3) N m ON each link by its joint, world axes.

    The torque is about the link's origin, where the force acts.

    A joint passes on all that accelerates the links beyond it and that neither gravity nor the point pairs
    supply: constraint reactions and the joint's own force tau together.

    Args:
        tree: the model.
        q: (nq,) configuration.
        v: (nv,) velocity.
        vdot: (nv,) acceleration.
        gravity: (3,) m/s^2, world axes.
        pairs: constraints that act on the links as well.
        forces: (pairs, 3) N on b's parts at b, world axes, as in ``ConstrainedMotion``.
    """
    bodies = Bodies.of(tree)
    k = kinematics(tree, q, v)
    T, Tdot = bodies.velocity_map(k)
    state = bodies.state(k)
    f = bodies.gravity_and_gyroscopic(state[:, W], gravity)
    loads = (bodies.diagonal * (T @ vdot + Tdot @ v) - f).reshape(-1, 6)
    force = np.vstack([loads[:, :3], np.zeros(3)])
    torque = np.vstack([rotations.rotate(state[:, Q], loads[:, 3:]), np.zeros(3)])
    torque[:-1] += np.cross(state[:, C] - k.position[:-1], force[:-1])
    for pair, push in zip(pairs, np.zeros((0, 3)) if forces is None else forces, strict=True):
        frame = tree.frame(pair.b.part)
        on_link = frame.position + rotations.rotate(frame.orientation, pair.b.point)
        point = k.position[frame.link] + rotations.rotate(k.orientation[frame.link], on_link)
        for link, sign in ((frame.link, 1.0), (tree.frame(pair.a.part).link, -1.0)):
            force[link] -= sign * push
            torque[link] -= sign * np.cross(point - k.position[link], push)
    for i in range(len(tree.links) - 1, -1, -1):
        p = tree.links[i].parent
        force[p] += force[i]
        torque[p] += torque[i] + np.cross(k.position[i] - k.position[p], force[i])
    return force[:-1], torque[:-1]
