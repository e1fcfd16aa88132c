"""A tree of parts: the model of an articulated body, depth-first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties, combine
from physics_prior.model.joint import Joint, JointKind
from physics_prior.model.part import MASSLESS, Part


@dataclass(frozen=True)
class Link:
    """A moving part as the dynamics see it: everything fixed to it is merged into it.

    Attributes:
        part: name of the part that the joint carries.
        joint: the moving joint; ``position`` and ``orientation`` are relative to the parent link's frame.
        parent: index of the parent link, -1 for the world.
        mass_properties: of the part and all parts fixed to it, in the part frame.
        q: where its coordinates stand in q.
        v: where its degrees of freedom stand in v.
    """

    part: str
    joint: Joint
    parent: int
    mass_properties: MassProperties
    q: slice
    v: slice


@dataclass(frozen=True)
class Frame:
    """Where a part stands on its link: the link's index (-1 for the world) and the constant pose on it."""

    link: int
    position: np.ndarray
    orientation: np.ndarray


class Tree:
    """Parts connected by joints into a tree (or several) that stands on the world.

    Attributes:
        parts: in depth-first order, ``parts[i]`` carried by ``joints[i]``.
        joints: in depth-first order.
        links: the moving parts, in the same order, fixed joints merged away.
        frames: part name -> where it stands on its link; has ``world`` too.
        nq, nv: sizes of configuration and velocity.

    Raises:
        ModelError: names that are doubled or unknown, parts without or with two joints, loops, an order that is not
            depth-first.
    """

    def __init__(self, parts: Sequence[Part], joints: Sequence[Joint]) -> None:
        self.parts = tuple(parts)
        self.joints = tuple(joints)
        self._check_names()
        self._check_order()
        self.frames: dict[str, Frame] = {"world": Frame(-1, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))}
        self.links: tuple[Link, ...] = self._merge()
        self.nq = sum(joint.nq for joint in self.joints)
        self.nv = sum(joint.nv for joint in self.joints)
        self._check_mass()

    @classmethod
    def sorted(cls, parts: Sequence[Part], joints: Sequence[Joint]) -> "Tree":
        """Build a tree from parts and joints in any order, sorting them depth-first (siblings as given).

        Raises:
            ModelError: as the constructor, and joints that form a loop or hang on nothing.
        """
        by_parent: dict[str, list[Joint]] = {}
        for joint in joints:
            by_parent.setdefault(joint.parent, []).append(joint)
        ordered: list[Joint] = []
        stack = list(reversed(by_parent.get("world", [])))
        while stack and len(ordered) <= len(joints):
            joint = stack.pop()
            ordered.append(joint)
            stack.extend(reversed(by_parent.get(joint.child, [])))
        if len(ordered) != len(joints):
            left = sorted({joint.name for joint in joints} - {joint.name for joint in ordered})
            raise ModelError(
                f"joints {left} do not lead to 'world': a tree needs one path from every part to the world"
            )
        by_name = {part.name: part for part in parts}
        if len(by_name) < len(parts):
            _refuse_doubled("part", [part.name for part in parts])
        missing = [joint.child for joint in ordered if joint.child not in by_name]
        if missing:
            raise ModelError(f"joint child '{missing[0]}' is not a part: known parts are {sorted(by_name)}")
        carried = [by_name[joint.child] for joint in ordered]
        return cls(carried + [part for part in parts if part not in carried], ordered)

    def part(self, name: str) -> Part:
        """The part of that name; ModelError lists the known ones."""
        for part in self.parts:
            if part.name == name:
                return part
        raise ModelError(f"part '{name}' is unknown: known parts are {[part.name for part in self.parts]}")

    def joint(self, name: str) -> Joint:
        """The joint of that name; ModelError lists the known ones."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise ModelError(f"joint '{name}' is unknown: known joints are {[joint.name for joint in self.joints]}")

    def frame(self, part: str) -> Frame:
        """Where a part (or ``world``) stands on its link; ModelError lists the known parts."""
        if part not in self.frames:
            raise ModelError(f"part '{part}' is unknown: known parts are {list(self.frames)}")
        return self.frames[part]

    def link(self, joint: str) -> Link:
        """The link that a moving joint carries; ModelError lists the moving joints."""
        for link in self.links:
            if link.joint.name == joint:
                return link
        raise ModelError(f"joint '{joint}' is unknown or fixed: moving joints are {[k.joint.name for k in self.links]}")

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(sum(part.mass_properties.mass for part in self.parts))

    @property
    def freedom_names(self) -> list[str]:
        """(nv,) one name per degree of freedom: the joint's, with /x /y /z for vectors (free: linear, angular)."""
        names: list[str] = []
        for link in self.links:
            if link.joint.kind is JointKind.FREE:
                names += [f"{link.joint.name}/{k}_{a}" for k in ("linear", "angular") for a in "xyz"]
            elif link.joint.kind is JointKind.SPHERICAL:
                names += [f"{link.joint.name}/{a}" for a in "xyz"]
            else:
                names.append(link.joint.name)
        return names

    @property
    def turning(self) -> np.ndarray:
        """(nv,) bool, which degrees of freedom turn; the others slide."""
        kinds = {JointKind.FREE: [False] * 3 + [True] * 3, JointKind.PRISMATIC: [False]}
        return np.array(
            [each for link in self.links for each in kinds.get(link.joint.kind, [True] * link.joint.nv)], bool
        )

    def neutral(self) -> np.ndarray:
        """(nq,) all coordinates zero, quaternions one."""
        q = np.zeros(self.nq)
        for link in self.links:
            if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
                q[link.q.stop - 4] = 1.0
        return q

    def integrate(self, q: np.ndarray, difference: np.ndarray) -> np.ndarray:
        """(nq,) q moved by a tangent vector (nv,): q [+] difference, rotations by the exponential map on the right."""
        moved = np.array(q, dtype=float)
        for link in self.links:
            qs, vs = moved[link.q], difference[link.v]
            if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
                qs[-4:] = rotations.normalize(rotations.multiply(qs[-4:], rotations.exp(vs[-3:])))
                qs[:-4] += vs[:-3]
            else:
                qs += vs
        return moved

    def difference(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(nv,) the tangent vector that leads from start (nq,) to end (nq,): end [-] start."""
        out = np.zeros(self.nv)
        for link in self.links:
            a, b = start[link.q], end[link.q]
            if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
                turn = rotations.log(rotations.multiply(rotations.conjugate(a[-4:]), b[-4:]))
                out[link.v] = np.concatenate([b[:-4] - a[:-4], turn])
            else:
                out[link.v] = b - a
        return out

    def _check_names(self) -> None:
        _refuse_doubled("part", [part.name for part in self.parts])
        _refuse_doubled("joint", [joint.name for joint in self.joints])

    def _check_order(self) -> None:
        children = [joint.child for joint in self.joints]
        for part in self.parts:
            if children.count(part.name) != 1:
                raise ModelError(
                    f"part '{part.name}' is carried by {children.count(part.name)} joints: every part needs exactly one"
                )
        if [part.name for part in self.parts] != children:
            raise ModelError("parts and joints are not in the same order: joints[i] carries parts[i]")
        path: list[str] = []
        for joint in self.joints:
            while path and path[-1] != joint.parent:
                path.pop()
            if not path and joint.parent != "world":
                raise ModelError(
                    f"joint '{joint.name}' is out of order or its parent '{joint.parent}' is unknown: joints stand"
                    " depth-first, every parent before its children (Tree.sorted does that)"
                )
            path.append(joint.child)

    def _merge(self) -> tuple[Link, ...]:
        """Merge fixed joints into the links that carry them: they cost nothing and cannot drift."""
        carried: list[list[MassProperties]] = []
        heads: list[tuple[Joint, int]] = []
        for part, joint in zip(self.parts, self.joints, strict=True):
            parent = self.frames[joint.parent]
            position = parent.position + rotations.rotate(parent.orientation, joint.position)
            orientation = rotations.multiply(parent.orientation, joint.orientation)
            if joint.kind is JointKind.FIXED:
                self.frames[part.name] = Frame(parent.link, position, orientation)
                if parent.link >= 0 and part.mass_properties.mass > 0.0:
                    R = rotations.matrix_from_quaternion(orientation)
                    carried[parent.link].append(part.mass_properties.transformed(R, position))
                continue
            placed = Joint(joint.name, joint.kind, joint.parent, joint.child, position, orientation, joint.axis)
            self.frames[part.name] = Frame(len(heads), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
            heads.append((placed, parent.link))
            carried.append([part.mass_properties] if part.mass_properties.mass > 0.0 else [])
        links: list[Link] = []
        iq = iv = 0
        for (joint, up), masses in zip(heads, carried, strict=True):
            merged = combine(masses) if masses else MASSLESS
            links.append(Link(joint.child, joint, up, merged, slice(iq, iq + joint.nq), slice(iv, iv + joint.nv)))
            iq, iv = iq + joint.nq, iv + joint.nv
        return tuple(links)

    def _check_mass(self) -> None:
        """Refuse links whose joint moves nothing: massless all the way to the tips."""
        moved = [link.mass_properties.mass for link in self.links]
        for i in range(len(self.links) - 1, -1, -1):
            if moved[i] <= 0.0:
                raise ModelError(
                    f"part '{self.links[i].part}' and everything it carries are massless, so joint"
                    f" '{self.links[i].joint.name}' has no inertia to move: give it a mass or fix the joint"
                )
            if self.links[i].parent >= 0:
                moved[self.links[i].parent] += moved[i]


def _refuse_doubled(kind: str, names: Sequence[str]) -> None:
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise ModelError(f"{kind} name '{doubled[0]}' is used twice: names are unique in a tree")
