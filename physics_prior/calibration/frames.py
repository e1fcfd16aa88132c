"""Forward kinematics of a whole trial at once, with derivatives by postures and by constants of the body, for least squares."""

from collections.abc import Mapping

import numpy as np

from physics_prior import rotations
from physics_prior.model import JointKind, Tree


class Frames:
    """Where the parts of a tree are in each of F frames.

    Attributes:
        origin, rotation: part -> (F, 3) m and (F, 3, 3), part to world.
        by_constants: part -> (F, 3, c), derivative of its origin by the constants.
    """

    def __init__(self, tree: Tree, q: np.ndarray, moved: Mapping[str, np.ndarray], constants: int) -> None:
        """Place a tree at configurations q (F, nq); moved: joint -> (3, constants), how its place in its parent goes by them."""
        count = len(q)
        self.tree = tree
        self.origin = {"world": np.zeros((count, 3))}
        self.rotation = {"world": np.broadcast_to(np.eye(3), (count, 3, 3))}
        self.by_constants = {"world": np.zeros((count, 3, constants))}
        own = {link.joint.name: link for link in tree.links}
        for joint in tree.joints:
            up = joint.parent
            R = self.rotation[up]
            origin = self.origin[up] + R @ joint.position
            turn = np.broadcast_to(np.eye(3), (count, 3, 3))
            if joint.name in own:
                coordinates = q[:, own[joint.name].q]
                if joint.kind is JointKind.FREE:
                    origin, coordinates = origin + coordinates[:, :3], coordinates[:, 3:]
                if joint.kind is JointKind.REVOLUTE:
                    coordinates = np.array([rotations.exp(angle * joint.axis) for angle in coordinates[:, 0]])
                turn = np.array([rotations.matrix_from_quaternion(each) for each in coordinates])
            self.origin[joint.child] = origin
            self.rotation[joint.child] = R @ turn
            slope = moved.get(joint.name)
            self.by_constants[joint.child] = self.by_constants[up] + (0.0 if slope is None else R @ slope)

    def points(self, part: str, place: np.ndarray) -> np.ndarray:
        """(F, 3) world positions of a place (3,) in a part's frame."""
        return np.asarray(self.origin[part] + self.rotation[part] @ place)

    def by_posture(self, part: str, points: np.ndarray) -> np.ndarray:
        """(F, 3, nv) velocities per v of points (F, 3) of a part."""
        out = np.zeros((len(points), 3, self.tree.nv))
        own = {link.joint.name: link for link in self.tree.links}
        carried = {joint.child: joint for joint in self.tree.joints}
        while part != "world":
            joint = carried[part]
            if joint.name in own:
                v = own[joint.name].v
                lever = points - self.origin[part]
                axes = self.rotation[part]
                if joint.kind is JointKind.REVOLUTE:
                    axes = (axes @ joint.axis)[:, :, None]
                out[:, :, v][:, :, -axes.shape[2] :] = np.cross(axes, lever[:, :, None], axis=1)
                if joint.kind is JointKind.FREE:
                    out[:, :, v][:, :, :3] = np.eye(3)
            part = joint.parent
        return out
