"""Maximal coordinates: every link a free body, every joint an explicit constraint (equations 3 and 4).

State of a body: y = (c, q, v, w'), centre of mass and quaternion, velocity in world axes, angular velocity in
body axes, which are the principal axes of inertia. Joints are point pairs like loops and attachments, only
more of them: what a joint forbids, a Lagrange multiplier holds.
"""

from collections.abc import Sequence

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.formulations import constrained_motion, point_pairs
from physics_prior.dynamics.formulations.constrained_motion import ConstrainedMotion
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.dynamics.formulations.newton_euler import WORLD, Bodies, C, Q, V, W
from physics_prior.effects.effect import Anchor, PointPair
from physics_prior.model import JointKind, Link, Tree


class MaximalCoordinates:
    """A tree and its constraints in maximal coordinates.

    Attributes:
        tree: the model.
        bodies: its links as free bodies.
        joints, pairs: the constraint rows of the joints and the remaining ones.
        gravity: (3,) m/s^2, world axes.
    """

    def __init__(self, tree: Tree, gravity: np.ndarray, pairs: Sequence[PointPair] = ()) -> None:
        self.tree = tree
        self.bodies = Bodies.of(tree)
        self.gravity = gravity
        self.joints = point_pairs.body_pairs(self.bodies, joint_pairs(tree))
        self.pairs = point_pairs.body_pairs(self.bodies, pairs)

    def state(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(n, 13) states (c, q, v, w') of the bodies at q (nq,) and v (nv,) of the tree."""
        return self.bodies.state(kinematics(self.tree, q, v))

    def generalized(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Read configuration (nq,) and velocity (nv,) of the tree off the bodies' states (n, 13).

        Angles come out in (-pi, pi]; what the joints forbid but drift has brought in is left out.
        """
        orientation, position = self.bodies.link_poses(state)
        states = np.vstack([state, WORLD])
        spin = rotations.rotate(states[:, Q], states[:, W])
        speed = states[:, V] + np.cross(spin, position - states[:, C])
        q, v = np.empty(self.tree.nq), np.empty(self.tree.nv)
        for i, link in enumerate(self.tree.links):
            p, joint = link.parent, link.joint
            zero = rotations.multiply(orientation[p], joint.orientation)
            turn = rotations.multiply(rotations.conjugate(zero), orientation[i])
            if joint.kind is JointKind.FREE:
                q[link.q] = np.concatenate([position[i], orientation[i]])
            elif joint.kind is JointKind.SPHERICAL:
                q[link.q] = turn
            elif joint.kind is JointKind.REVOLUTE:
                q[link.q] = rotations.log(turn) @ joint.axis
            else:
                origin = position[p] + rotations.rotate(orientation[p], joint.position)
                q[link.q] = rotations.rotate(zero, joint.axis) @ (position[i] - origin)
            relative_speed = speed[i] - speed[p] - np.cross(spin[p], position[i] - position[p])
            relative_spin = rotations.rotate(rotations.conjugate(orientation[i]), spin[i] - spin[p])
            if joint.kind is JointKind.PRISMATIC:
                v[link.v] = rotations.rotate(zero, joint.axis) @ relative_speed
            elif joint.kind is JointKind.REVOLUTE:
                v[link.v] = joint.axis @ relative_spin
            else:
                v[link.v] = np.concatenate([relative_speed, relative_spin])[-link.joint.nv :]
        return q, v

    def generalized_acceleration(self, q: np.ndarray, v: np.ndarray, xddot: np.ndarray) -> np.ndarray:
        """Read vdot (nv,) off accelerations (n, 6) of the bodies at q, v: xddot = T vdot + dT/dt v."""
        T, Tdot = self.bodies.velocity_map(kinematics(self.tree, q, v))
        return np.asarray(np.linalg.lstsq(T, xddot.ravel() - Tdot @ v, rcond=None)[0])

    def solve(self, state: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """Equation 4: accelerations (n, 6) of the bodies (vdot world, w'dot), forces (pairs, 3) and rank.

        f is gravity, the gyroscopic torque -w' x I'w' of equation 3 and the joints' own forces tau (nv,);
        forces and rank are those of ``ConstrainedMotion``.

        Raises:
            SimulationError: the state is not finite, or a part without inertia is not held by its
                constraints.
        """
        f = self.bodies.gravity_and_gyroscopic(state[:, W], self.gravity)
        f = f + self.bodies.joint_loads(state, tau).ravel()
        A, gamma = point_pairs.rows([*self.joints, *self.pairs], state)
        diagonal, typical = self.bodies.diagonal, np.repeat(self.bodies.typical_inertia.ravel(), 3)
        xddot, multipliers, rank = constrained_motion.solve(np.diag(diagonal), f, A, gamma, typical)
        held = sum(pair.rows for pair in self.joints)
        forces = point_pairs.forces(self.pairs, state, multipliers[held:])
        return xddot.reshape(-1, 6), forces, rank - held

    def derivative(self, state: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Equation 3: ydot (n, 13) = (v, q o (0; w') / 2, vdot, w'dot) at the states (n, 13)."""
        acceleration, _, _ = self.solve(state, tau)
        return np.hstack([state[:, V], rotations.derivative(state[:, Q], state[:, W]), acceleration])

    def residual(self, state: np.ndarray) -> np.ndarray:
        """(rows,) m, by how much states (n, 13) violate the rows of joints and pairs: the drift."""
        return point_pairs.residual([*self.joints, *self.pairs], state)


def accelerations(
    tree: Tree,
    q: np.ndarray,
    v: np.ndarray,
    tau: np.ndarray,
    gravity: np.ndarray,
    pairs: Sequence[PointPair] = (),
) -> ConstrainedMotion:
    """Forward dynamics in maximal coordinates, from (q, v) of the tree and back to vdot (nv,).

    Arguments and errors as ``generalized.mixed_accelerations``.
    """
    system = MaximalCoordinates(tree, gravity, pairs)
    xddot, forces, rank = system.solve(system.state(q, v), tau)
    return ConstrainedMotion(system.generalized_acceleration(q, v, xddot), forces, rank)


def joint_pairs(tree: Tree) -> list[PointPair]:
    """State the joints as point pairs: three rows for a spherical, five for a revolute or prismatic one."""
    return [pair for link in tree.links for pair in _joint_pairs(tree, link)]


def _joint_pairs(tree: Tree, link: Link) -> list[PointPair]:
    joint = link.joint
    parent = tree.links[link.parent].part if link.parent >= 0 else "world"
    to_parent = rotations.matrix_from_quaternion(joint.orientation)
    axis = joint.axis
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)

    def pair(point: np.ndarray, *directions: np.ndarray) -> PointPair:
        """Hold a point of the child where it is at zero coordinate, along directions; all in child axes."""
        there = joint.position + to_parent @ point
        return PointPair(Anchor(parent, there), Anchor(link.part, point), np.array(directions) @ to_parent.T)

    arm = _radius_of_gyration(link)
    origin = np.zeros(3)
    if joint.kind is JointKind.SPHERICAL:
        return [pair(origin, *np.eye(3))]
    if joint.kind is JointKind.REVOLUTE:
        return [pair(origin, *np.eye(3)), pair(arm * axis, first, second)]
    if joint.kind is JointKind.PRISMATIC:
        return [pair(origin, first, second), pair(arm * axis, first, second), pair(arm * first, second)]
    return []


def _radius_of_gyration(link: Link) -> float:
    """Give a length typical of the link, m, so that turning and shifting weigh alike in its rows."""
    body = link.mass_properties
    radius = np.sqrt(np.trace(body.inertia) / body.mass) if body.mass > 0.0 else 0.0
    return float(radius) or 1.0
