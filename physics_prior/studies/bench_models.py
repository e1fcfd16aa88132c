"""The benchmark's human-like tree, and the same tree as Pinocchio and MuJoCo models, made from ours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from physics_prior import inertia, rotations
from physics_prior.dynamics.formulations.generalized import mass_matrix
from physics_prior.effects import Anchor
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Link, Part, Tree

HELD_FEET = (Anchor("left_foot", np.array([0.1, 0.0, -0.06])), Anchor("right_foot", np.array([0.1, 0.0, -0.06])))
"""Where the benchmark pins the feet: under the balls of the toes."""


def humanlike() -> Tree:
    """Build the human-like tree: 16 bodies, 35 degrees of freedom, about 70 kg and 1.7 m.

    A free pelvis; ball joints in the lumbar spine, thorax, neck, shoulders and hips; hinges in elbows, wrists,
    knees and ankles. x forward, y left, z up; links are capsules along z and boxes.
    """
    parts: list[Part] = []
    joints: list[Joint] = []

    def add(name: str, kind: JointKind, parent: str, position: Sequence[float], body: MassProperties) -> None:
        parts.append(Part(name, body))
        joints.append(Joint(f"{name}_joint", kind, parent, name, np.array(position), axis=np.array([0.0, 1.0, 0.0])))

    ball, hinge = JointKind.SPHERICAL, JointKind.REVOLUTE
    add("pelvis", JointKind.FREE, "world", (0.0, 0.0, 0.0), inertia.box(10.0, (0.2, 0.3, 0.16)))
    add("abdomen", ball, "pelvis", (0.0, 0.0, 0.1), _limb(10.0, 0.1, 0.15))
    add("thorax", ball, "abdomen", (0.0, 0.0, 0.15), _limb(15.0, 0.13, 0.25))
    add("head", ball, "thorax", (0.0, 0.0, 0.35), _limb(5.0, 0.08, 0.12))
    for side, y in (("left", 1.0), ("right", -1.0)):
        add(f"{side}_upper_arm", ball, "thorax", (0.0, 0.2 * y, 0.25), _limb(2.0, 0.04, -0.28))
        add(f"{side}_forearm", hinge, f"{side}_upper_arm", (0.0, 0.0, -0.28), _limb(1.2, 0.035, -0.26))
        add(f"{side}_hand", hinge, f"{side}_forearm", (0.0, 0.0, -0.26), _limb(0.4, 0.03, -0.1))
    for side, y in (("left", 1.0), ("right", -1.0)):
        add(f"{side}_thigh", ball, "pelvis", (0.0, 0.09 * y, -0.06), _limb(8.0, 0.07, -0.42))
        add(f"{side}_shank", hinge, f"{side}_thigh", (0.0, 0.0, -0.42), _limb(3.2, 0.05, -0.42))
        foot = inertia.box(1.0, (0.25, 0.09, 0.06)).transformed(np.eye(3), np.array([0.05, 0.0, -0.04]))
        add(f"{side}_foot", hinge, f"{side}_shank", (0.0, 0.0, -0.42), foot)
    return Tree(parts, joints)


def _limb(mass: float, radius: float, length: float) -> MassProperties:
    """A capsule from the joint along z, downwards where the length is negative."""
    return inertia.capsule(mass, radius, abs(length)).transformed(np.eye(3), np.array([0.0, 0.0, 0.5 * length]))


@dataclass(frozen=True)
class PinocchioPosture:
    """A state and forces in Pinocchio's convention: q (nq,), v (nv,), tau (nv,)."""

    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray


class PinocchioModel:
    """A tree as a Pinocchio model, and the maps between the two conventions.

    Pinocchio has the linear velocity of a free joint in the BODY's axes (ours: the world's) and quaternions as
    (x, y, z, w).

    Attributes:
        tree: ours.
        model, data: Pinocchio's.
    """

    def __init__(self, tree: Tree, gravity: np.ndarray) -> None:
        import pinocchio

        self.tree = tree
        self.model = pinocchio.Model()
        self.model.gravity.linear = gravity
        self._ids: list[int] = []
        for link in tree.links:
            joint = link.joint
            parent = self._ids[link.parent] if link.parent >= 0 else 0
            R = rotations.matrix_from_quaternion(joint.orientation)
            place = pinocchio.SE3(R, joint.position)
            self._ids.append(self.model.addJoint(parent, _pinocchio_joint(pinocchio, link), place, joint.name))
            body = link.mass_properties
            body = pinocchio.Inertia(body.mass, body.center_of_mass, body.inertia)
            self.model.appendBodyToJoint(self._ids[-1], body, pinocchio.SE3.Identity())
        self.data = self.model.createData()

    def configuration(self, q: np.ndarray) -> np.ndarray:
        """Return Pinocchio's q of ours, (nq,) both."""
        out = q.copy()
        for link in self.tree.links:
            if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
                last = link.q.stop
                out[last - 4 : last] = np.roll(q[last - 4 : last], -1)
        return out

    def velocity_map(self, q: np.ndarray) -> np.ndarray:
        """(nv, nv) orthogonal matrix from our v, tangent of q or forces to Pinocchio's."""
        out = np.eye(self.tree.nv)
        for link in self.tree.links:
            if link.joint.kind is JointKind.FREE:
                n = link.v.start
                out[n : n + 3, n : n + 3] = rotations.matrix_from_quaternion(q[link.q][3:]).T
        return out

    def transport(self, v: np.ndarray) -> np.ndarray:
        """(nv, nv) matrix W with d(velocity_map)/dt v = W v in Pinocchio's axes: -[w']x for a free joint."""
        out = np.zeros((self.tree.nv, self.tree.nv))
        for link in self.tree.links:
            if link.joint.kind is JointKind.FREE:
                n = link.v.start
                out[n : n + 3, n : n + 3] = -rotations.skew(v[n + 3 : n + 6])
        return out

    def posture(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> "PinocchioPosture":
        """A state and forces of ours in Pinocchio's convention."""
        turn = self.velocity_map(q)
        return PinocchioPosture(self.configuration(q), turn @ v, turn @ tau)

    def acceleration(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """(nv,) vdot of ours in Pinocchio's convention: d/dt (X v) = X vdot + W X v."""
        turn = self.velocity_map(q)
        return np.asarray(turn @ vdot + self.transport(v) @ turn @ v)

    def acceleration_derivatives(
        self, q: np.ndarray, v: np.ndarray, tau: np.ndarray, vdot: np.ndarray, by_q: np.ndarray, by_v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Our derivatives (nv, nv) of vdot in Pinocchio's convention, where X v and X tau are held, not v and tau.

        a = X vdot(q, v, tau) + W(w) X v. Turning the free joint by d in its own axes changes X u by -d x (X u), so with X v
        and X tau constant v and tau of the free joint turn along: dv = X^T (d x X v).
        """
        turn, transport = self.velocity_map(q), self.transport(v)
        inverse_mass = np.linalg.inv(mass_matrix(self.tree, q))
        velocity_slope, force_slope, acceleration_slope = np.zeros((3, self.tree.nv, self.tree.nv))
        slope_v = turn @ by_v + transport @ turn
        for link in self.tree.links:
            if link.joint.kind is JointKind.FREE:
                n = link.v.start
                linear, angular = slice(n, n + 3), slice(n + 3, n + 6)
                for out, vector in ((velocity_slope, v), (force_slope, tau), (acceleration_slope, vdot)):
                    out[linear, angular] = -rotations.skew((turn @ vector)[linear])
                slope_v[linear, angular] += rotations.skew((turn @ v)[linear])
        # columns of d; X^T velocity_slope d is what v must change by to keep X v
        moved_v, moved_tau = turn.T @ velocity_slope, turn.T @ force_slope
        slope_q = turn @ (by_q + by_v @ moved_v + inverse_mass @ moved_tau) - acceleration_slope
        return slope_q @ turn.T, slope_v @ turn.T

    def hold(self, anchors: Sequence[Anchor], points: Sequence[np.ndarray]) -> tuple[Any, Any]:
        """Point contacts that hold anchors (on parts) at world points (3,) m: Pinocchio's models and their data."""
        import pinocchio

        contacts = pinocchio.StdVec_RigidConstraintModel()
        data = pinocchio.StdVec_RigidConstraintData()
        for anchor, point in zip(anchors, points, strict=True):
            frame = self.tree.frame(anchor.part)
            place = frame.position + rotations.rotate(frame.orientation, anchor.point)
            contacts.append(
                pinocchio.RigidConstraintModel(
                    pinocchio.ContactType.CONTACT_3D,
                    self.model,
                    self._ids[frame.link],
                    pinocchio.SE3(np.eye(3), place),
                    0,
                    pinocchio.SE3(np.eye(3), point),
                    pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED,
                )
            )
            data.append(contacts[len(contacts) - 1].createData())
        pinocchio.initConstraintDynamics(self.model, self.data, contacts, data)
        return contacts, data


def _pinocchio_joint(pinocchio: Any, link: Link) -> Any:
    """The joint of Pinocchio: its fastest kind, that of a coordinate axis, where there is one."""
    axis, kind = link.joint.axis, link.joint.kind
    if kind is JointKind.FREE:
        return pinocchio.JointModelFreeFlyer()
    if kind is JointKind.SPHERICAL:
        return pinocchio.JointModelSpherical()
    letter = "R" if kind is JointKind.REVOLUTE else "P"
    for name, unit in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return getattr(pinocchio, f"JointModel{letter}{name}")()
    unaligned = "JointModelRevoluteUnaligned" if kind is JointKind.REVOLUTE else "JointModelPrismaticUnaligned"
    return getattr(pinocchio, unaligned)(axis)


def mjcf(tree: Tree, gravity: np.ndarray, step_size: float, held: Sequence[Anchor] = ()) -> str:
    """Return the tree as MuJoCo XML: Euler steps, no contacts, a ``connect`` to the world for every held anchor.

    MuJoCo's q and v are ours: (w, x, y, z), linear velocity of a free joint in the world's axes.
    """
    kinds = {
        JointKind.FREE: "free",
        JointKind.SPHERICAL: "ball",
        JointKind.REVOLUTE: "hinge",
        JointKind.PRISMATIC: "slide",
    }
    lines = [
        f'<mujoco><option timestep="{step_size!r}" gravity="{_numbers(gravity)}" integrator="Euler">'
        '<flag contact="disable"/></option><compiler angle="radian"/><worldbody>'
    ]
    path: list[int] = []
    for i, link in enumerate(tree.links):
        while path and path[-1] != link.parent:
            path.pop()
            lines.append("</body>")
        path.append(i)
        joint, body = link.joint, link.mass_properties
        inertia_entries = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        lines.append(
            f'<body name="{link.part}" pos="{_numbers(joint.position)}" quat="{_numbers(joint.orientation)}">'
            f'<inertial pos="{_numbers(body.center_of_mass)}" mass="{body.mass!r}"'
            f' fullinertia="{_numbers(inertia_entries)}"/>'
            f'<joint name="{joint.name}" type="{kinds[joint.kind]}" axis="{_numbers(joint.axis)}"/>'
        )
    lines += ["</body>" for _ in path] + ["</worldbody><equality>"]
    for anchor in held:
        frame = tree.frame(anchor.part)
        point = frame.position + rotations.rotate(frame.orientation, anchor.point)
        lines.append(f'<connect body1="{tree.links[frame.link].part}" anchor="{_numbers(point)}"/>')
    return "\n".join([*lines, "</equality></mujoco>"])


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
