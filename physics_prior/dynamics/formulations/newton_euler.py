"""The links of a tree as free rigid bodies: Newton-Euler equations in principal axes (equation 3)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.formulations.kinematics import Kinematics
from physics_prior.model import JointKind, Tree

C, Q, V, W = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
"""Columns of states (n, 13): centre of mass, quaternion, velocity (world), angular velocity (body)."""

WORLD = np.eye(1, 13, 3)
"""(1, 13) the world as a body at rest: appended to a state, so that the index -1 finds it."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """The links as free bodies, body frame = principal axes about the centre of mass.

    Attributes:
        tree: whose links they are, one body each.
        mass: (n,) kg.
        moments: (n, 3) kg m^2, principal.
        center: (n, 3) m, centre of mass in the link's frame.
        axes: (n, 4) quaternion, body axes to the link's.
    """

    tree: Tree
    mass: np.ndarray
    moments: np.ndarray
    center: np.ndarray
    axes: np.ndarray

    @classmethod
    @lru_cache(maxsize=16)  # principal axes take longer than the motion, and a tree does not change
    def of(cls, tree: Tree) -> "Bodies":
        """Take a tree apart into its bodies."""
        properties = [link.mass_properties for link in tree.links]
        principal = [body.principal_axes() for body in properties]
        return cls(
            tree,
            np.array([body.mass for body in properties]),
            np.array([moments for moments, _ in principal]),
            np.array([body.center_of_mass for body in properties]),
            np.array([axes for _, axes in principal]),
        )

    @property
    def diagonal(self) -> np.ndarray:
        """(6 n,) diagonal of the mass matrix M = diag(m, m, m, I') of each body; all else is zero."""
        return np.hstack([np.repeat(self.mass[:, None], 3, axis=1), self.moments]).ravel()

    @property
    def typical_inertia(self) -> np.ndarray:
        """(n, 2) kg and kg m^2, mass and largest moment of each body, one where it has none."""
        typical = np.stack([self.mass, self.moments.max(axis=1)], axis=1)
        return np.where(typical > 0.0, typical, 1.0)

    def state(self, k: Kinematics) -> np.ndarray:
        """(n, 13) states of the bodies as the links move."""
        state = np.empty((len(self.tree.links), 13))
        offset = rotations.rotate(k.orientation[:-1], self.center)
        state[:, C] = k.position[:-1] + offset
        state[:, Q] = rotations.multiply(k.orientation[:-1], self.axes)
        state[:, V] = k.velocity[:-1] + np.cross(k.angular_velocity[:-1], offset)
        state[:, W] = rotations.rotate(rotations.conjugate(state[:, Q]), k.angular_velocity[:-1])
        return state

    def velocity_map(self, k: Kinematics) -> tuple[np.ndarray, np.ndarray]:
        """T and dT/dt, (6 n, nv): from v to the velocities (v, w') of all bodies, and its rate."""
        T, Tdot = np.zeros((2, len(self.mass), 6, self.tree.nv))
        for i in range(len(self.mass)):
            offset = rotations.rotate(k.orientation[i], self.center[i])
            cross = rotations.skew(offset)
            cross_rate = rotations.skew(np.cross(k.angular_velocity[i], offset))
            to_body = rotations.matrix_from_quaternion(rotations.multiply(k.orientation[i], self.axes[i])).T
            spin = rotations.skew(k.angular_velocity[i])
            angular, angular_rate = k.angular_jacobian[i], k.angular_jacobian_rate[i]
            T[i, :3] = k.linear_jacobian[i] - cross @ angular
            T[i, 3:] = to_body @ angular
            Tdot[i, :3] = k.linear_jacobian_rate[i] - cross_rate @ angular - cross @ angular_rate
            Tdot[i, 3:] = to_body @ (angular_rate - spin @ angular)
        return T.reshape(-1, self.tree.nv), Tdot.reshape(-1, self.tree.nv)

    def gyroscopic(self, angular_velocity: np.ndarray) -> np.ndarray:
        """-w' x (I' w'), (n, 3) N m, of the bodies' angular velocities w', (n, 3), body axes."""
        return -np.cross(angular_velocity, self.moments * angular_velocity)

    def gravity_and_gyroscopic(self, angular_velocity: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        """(6 n,) forces (world) and torques (body axes) of gravity (3,) m/s^2 and the gyroscopic term."""
        return np.hstack([self.mass[:, None] * gravity, self.gyroscopic(angular_velocity)]).ravel()

    def joint_loads(self, state: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """(n, 6) forces (world, at the centre of mass) and torques (body axes) by joint forces tau (nv,).

        A joint pushes the child with a force and a torque at the child's origin, and the parent with the
        opposite, so that the loads f have T^T f = tau (virtual work, equation 6).
        """
        loads = np.zeros((len(self.mass) + 1, 6))
        states = np.vstack([state, WORLD])
        orientation, position = self.link_poses(state)
        for i, link in enumerate(self.tree.links):
            push, kind = tau[link.v], link.joint.kind
            force, torque = np.zeros(3), np.zeros(3)
            if kind is JointKind.PRISMATIC:
                force = rotations.rotate(orientation[i], push[0] * link.joint.axis)
            elif kind is JointKind.REVOLUTE:
                torque = rotations.rotate(orientation[i], push[0] * link.joint.axis)
            else:
                torque = rotations.rotate(orientation[i], push[-3:])
                force[: len(push) - 3] = push[:-3]
            for body, sign in ((i, 1.0), (link.parent, -1.0)):
                moment = torque + np.cross(position[i] - states[body, C], force)
                loads[body, :3] += sign * force
                loads[body, 3:] += sign * rotations.rotate(rotations.conjugate(states[body, Q]), moment)
        return loads[:-1]

    def link_poses(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (n + 1, 4) and origins (n + 1, 3) of the link frames; the last row is the world."""
        orientation = rotations.multiply(state[:, Q], rotations.conjugate(self.axes))
        position = state[:, C] - rotations.rotate(orientation, self.center)
        return np.vstack([orientation, WORLD[:, Q]]), np.vstack([position, WORLD[:, C]])
