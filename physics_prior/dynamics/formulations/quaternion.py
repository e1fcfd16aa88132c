"""Quaternions as coordinates, held on the unit sphere by one constraint a body (equation 5).

Coordinates of a body: (c, q), rates (cdot, qdot), accelerations (cddot, qddot). The mass matrix of the
rotation, 4 Q J Q^T with J = diag(0, I'), has rank 3: only together with the norm constraint 2 q . qddot = -2
|qdot|^2 is qddot determined. The multiplier of that constraint is w'^T I' w', a free body's too: bookkeeping,
not a force.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from physics_prior import rotations
from physics_prior.dynamics.formulations import constrained_motion, point_pairs
from physics_prior.dynamics.formulations.constrained_motion import ConstrainedMotion
from physics_prior.dynamics.formulations.maximal import MaximalCoordinates
from physics_prior.dynamics.formulations.newton_euler import Q, W
from physics_prior.effects.effect import PointPair
from physics_prior.model import Tree

RATES, RATE = slice(7, 14), slice(10, 14)
"""Columns of a state (n, 14): all rates, and those of the quaternion."""


def rotational_mass(q: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """4 Q J Q^T, (4, 4), of a body with principal moments (3,) kg m^2 at the unit quaternion q (4,)."""
    left = rotations.left_matrix(q)
    return 4.0 * left @ np.diag([0.0, *moments]) @ left.T


def rotational_force(q: np.ndarray, qdot: np.ndarray, moments: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """2 Q (0; tau') + 8 Qd J Qd^T q, (4,), of a torque tau' (3,) N m in body axes and the rate qdot (4,) 1/s.

    The second term is all there is of gyroscopic effects: -w' x I'w' must not be in tau' as well.
    """
    left_rate = rotations.left_matrix(qdot)
    gyroscopic = 8.0 * left_rate @ np.diag([0.0, *moments]) @ left_rate.T @ q
    return np.asarray(2.0 * rotations.left_matrix(q) @ np.array([0.0, *torque]) + gyroscopic)


def rotational_motion(
    q: np.ndarray, qdot: np.ndarray, moments: np.ndarray, torque: np.ndarray
) -> tuple[np.ndarray, float]:
    """Qddot (4,) 1/s^2 and lambda of one free body (equation 5); arguments as ``rotational_force``.

    Raises:
        SimulationError: an argument is not finite, or more than one moment is zero.
    """
    qddot, multipliers, _ = constrained_motion.solve(
        rotational_mass(q, moments),
        rotational_force(q, qdot, moments, torque),
        2.0 * q[None],
        np.array([-2.0 * qdot @ qdot]),
        np.full(4, moments.max()),
    )
    return qddot, float(multipliers[0])


class QuaternionCoordinates:
    """A tree and its constraints in quaternion coordinates.

    The rows of joints and pairs are those of maximal coordinates, A (vdot, w'dot) = gamma: with
    (0; w'dot) = 2 Q^T qddot, up to the real part which the norm constraint owns, they are rows on qddot.

    Attributes:
        maximal: the same tree and constraints in maximal coordinates.
    """

    def __init__(self, tree: Tree, gravity: np.ndarray, pairs: Sequence[PointPair] = ()) -> None:
        self.maximal = MaximalCoordinates(tree, gravity, pairs)

    def state(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(n, 14) states (c, q, cdot, qdot) of the bodies at q (nq,) and v (nv,) of the tree."""
        y = self.maximal.state(q, v)
        return np.hstack([y[:, : W.start], rotations.derivative(y[:, Q], y[:, W])])

    def generalized(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Read configuration (nq,) and velocity (nv,) of the tree off the bodies' states (n, 14)."""
        return self.maximal.generalized(_with_angular_velocity(state))

    def solve(self, state: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """Equations 4 and 5 together: (cddot, qddot) of the bodies, (n, 7), forces (pairs, 3) and rank.

        The multipliers of the norm constraints are no forces and stay inside. tau: (nv,) joint forces.

        Raises:
            SimulationError: the state is not finite, or a part without inertia is not held by its
                constraints.
        """
        bodies, n = self.maximal.bodies, len(state)
        y = _with_angular_velocity(state)
        loads = bodies.joint_loads(y, tau)
        blocks, f, to_quaternions = [], [], []
        for i in range(n):
            q, qdot = state[i, Q], state[i, RATE]
            blocks.append(block_diag(bodies.mass[i] * np.eye(3), rotational_mass(q, bodies.moments[i])))
            f += [bodies.mass[i] * self.maximal.gravity + loads[i, :3]]
            f += [rotational_force(q, qdot, bodies.moments[i], loads[i, 3:])]
            to_quaternions.append(block_diag(np.eye(3), 2.0 * rotations.left_matrix(q).T[1:]))
        norms = block_diag(*[np.concatenate([np.zeros(3), 2.0 * q])[None] for q in state[:, Q]])
        norms_gamma = -2.0 * np.sum(state[:, RATE] ** 2, axis=1)
        A, gamma = point_pairs.rows([*self.maximal.joints, *self.maximal.pairs], y)
        xddot, multipliers, rank = constrained_motion.solve(
            block_diag(*blocks),
            np.concatenate(f),
            np.vstack([norms, A @ block_diag(*to_quaternions)]),
            np.concatenate([norms_gamma, gamma]),
            np.repeat(bodies.typical_inertia, [3, 4], axis=1).ravel(),
        )
        held = n + sum(pair.rows for pair in self.maximal.joints)
        return xddot.reshape(n, 7), point_pairs.forces(self.maximal.pairs, y, multipliers[held:]), rank - held

    def derivative(self, state: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Time derivative (n, 14) = (cdot, qdot, cddot, qddot) of the states (n, 14)."""
        acceleration, _, _ = self.solve(state, tau)
        return np.hstack([state[:, RATES], acceleration])


def accelerations(
    tree: Tree,
    q: np.ndarray,
    v: np.ndarray,
    tau: np.ndarray,
    gravity: np.ndarray,
    pairs: Sequence[PointPair] = (),
) -> ConstrainedMotion:
    """Forward dynamics in quaternion coordinates, from (q, v) of the tree and back to vdot (nv,).

    Arguments and errors as ``generalized.mixed_accelerations``.
    """
    system = QuaternionCoordinates(tree, gravity, pairs)
    state = system.state(q, v)
    xddot, forces, rank = system.solve(state, tau)
    # the rate of w' = 2 (conj(q) o qdot) is 2 (conj(q) o qddot): the other term, |qdot|^2, is real
    spin_rate = rotations.angular_velocity_body(state[:, Q], xddot[:, 3:])
    vdot = system.maximal.generalized_acceleration(q, v, np.hstack([xddot[:, :3], spin_rate]))
    return ConstrainedMotion(vdot, forces, rank)


def _with_angular_velocity(state: np.ndarray) -> np.ndarray:
    """States (c, q, v, w') of states with quaternion rates: (0; w') = 2 Q^T qdot (equation 2)."""
    return np.hstack([state[:, : RATE.start], rotations.angular_velocity_body(state[:, Q], state[:, RATE])])
