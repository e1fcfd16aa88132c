"""Trees from URDF, the robot_description of ROS (https://wiki.ros.org/urdf/XML)."""

from collections import Counter
from collections.abc import Iterable
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from physics_prior import rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import LARGEST_NUMBER, MassProperties
from physics_prior.model.joint import Joint, JointKind
from physics_prior.model.part import MASSLESS, Part, Shape
from physics_prior.model.tree import Tree

MAXIMUM_CHARACTERS = 2_000_000  # an order above the largest robots; bounds what parsing may allocate
JOINT_KINDS = {
    "fixed": JointKind.FIXED,
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.REVOLUTE,
    "prismatic": JointKind.PRISMATIC,
    "floating": JointKind.FREE,
}
ROOT_KINDS = {"fixed": JointKind.FIXED, "free": JointKind.FREE}


def tree_from_urdf(text: str, root: Literal["fixed", "free"] = "fixed") -> Tree:
    """Build the tree that a URDF describes.

    Links become parts in the same frames; a link without <inertial> is massless. A joint named ``root``
    connects the root link to the world; a root link that is itself named ``world`` is the ground and needs
    none. The first box, sphere or cylinder among the visual, then collision, geometry is the part's shape.
    What a URDF says about limits, damping and friction is no part of the model: effects say it.

    Args:
        text: the XML, up to 2 million characters; no DOCTYPE.
        root: whether the root link stands fixed or moves freely in the world.

    Raises:
        ModelError: one sentence naming link or joint, element and attribute.
    """
    if root not in ROOT_KINDS:
        raise ModelError(f"root {root!r} is not valid: use one of {list(ROOT_KINDS)}")
    robot = _parse(text)
    links = {_name(element): element for element in robot.findall("link")}
    joints = [_joint(element) for element in robot.findall("joint")]
    _refuse_doubles("link name", (_name(element) for element in robot.findall("link")))
    _refuse_doubles("child link", (joint.child for joint in joints))
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise ModelError(f"joint '{joint.name}', <{role} link>: '{link}' is unknown: links are {_shown(links)}")
    roots = sorted(links.keys() - {joint.child for joint in joints})
    if len(roots) != 1:
        raise ModelError(f"a URDF needs exactly one link that is no joint's child, but has {_shown(roots)}")
    if roots == ["world"]:
        if root != "fixed":
            raise ModelError("root 'free' is not valid: the root link 'world' is the ground and cannot move")
        del links["world"]
    else:
        joints.insert(0, Joint("root", ROOT_KINDS[root], "world", roots[0]))
    return Tree.sorted([_part(element) for element in links.values()], joints)


class _NoDoctype(ElementTree.TreeBuilder):
    """Refuses a document type before its entities are read: they can expand without bound or name files."""

    def doctype(self, name: str, public_id: str | None, system: str | None) -> None:
        raise ModelError(f"URDF has a DOCTYPE '{name}', which is refused: give plain XML without entities")


def _parse(text: str) -> ElementTree.Element:
    if len(text) > MAXIMUM_CHARACTERS:
        raise ModelError(f"URDF has {len(text)} characters, more than the {MAXIMUM_CHARACTERS} accepted")
    try:
        robot = ElementTree.fromstring(text, ElementTree.XMLParser(target=_NoDoctype()))
    except (ElementTree.ParseError, ValueError) as error:
        raise ModelError(f"URDF is not well-formed XML: {error}") from None
    if robot.tag != "robot":
        raise ModelError(f"URDF has <{robot.tag}> as its outermost element: it must be <robot>")
    return robot


def _part(element: ElementTree.Element) -> Part:
    name = _name(element)
    return Part(name, _mass_properties(element, f"link '{name}'"), _shape(element, f"link '{name}'"))


def _mass_properties(link: ElementTree.Element, where: str) -> MassProperties:
    inertial = link.find("inertial")
    if inertial is None:
        return MASSLESS
    (mass,) = _numbers(inertial, "mass", "value", where, 1)
    xx, yy, zz, xy, xz, yz = (
        _numbers(inertial, "inertia", attribute, where, 1)[0]
        for attribute in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    position, orientation = _origin(inertial, where)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    try:
        about_its_frame = MassProperties(mass, np.zeros(3), inertia)
    except ModelError as error:
        raise ModelError(f"{where}, <inertial>: {error}") from None
    return about_its_frame.transformed(rotations.matrix_from_quaternion(orientation), position)


def _shape(link: ElementTree.Element, where: str) -> Shape | None:
    for element in link.findall("visual") + link.findall("collision"):
        position, orientation = _origin(element, where)
        geometry = element.find("geometry")
        if geometry is None:
            raise ModelError(f"{where}, <{element.tag}>: <geometry> is missing")
        if geometry.find("box") is not None:
            size = _numbers(geometry, "box", "size", where, 3)
            return Shape("box", _lengths(size, where, "box size"), position, orientation)
        if geometry.find("sphere") is not None:
            (radius,) = _numbers(geometry, "sphere", "radius", where, 1)
            diameters = _lengths(np.full(3, 2.0 * radius), where, "sphere radius")
            return Shape("sphere", diameters, position, orientation)
        if geometry.find("cylinder") is not None:
            (radius,) = _numbers(geometry, "cylinder", "radius", where, 1)
            (length,) = _numbers(geometry, "cylinder", "length", where, 1)
            size = _lengths(np.array([2.0 * radius, 2.0 * radius, length]), where, "cylinder radius, length")
            return Shape("cylinder", size, position, orientation)
    return None


def _lengths(size: np.ndarray, where: str, what: str) -> np.ndarray:
    if np.any(size <= 0.0):
        raise ModelError(f"{where}, <{what}>: lengths must be greater than zero")
    return size


def _joint(element: ElementTree.Element) -> Joint:
    name = _name(element)
    where = f"joint '{name}'"
    kind = element.get("type")
    if kind not in JOINT_KINDS:
        raise ModelError(f"{where}, <joint type>: {kind!r} is not supported: use one of {list(JOINT_KINDS)}")
    if element.find("mimic") is not None:
        raise ModelError(f"{where}, <mimic>: coupled joints are not supported: remove it or fix the joint")
    parent = _attribute(element, "parent", "link", where)
    child = _attribute(element, "child", "link", where)
    position, orientation = _origin(element, where)
    axis = np.array([1.0, 0.0, 0.0])  # URDF's default
    if element.find("axis") is not None and kind in ("revolute", "continuous", "prismatic"):
        axis = _numbers(element, "axis", "xyz", where, 3)
        if not np.any(axis):
            raise ModelError(f"{where}, <axis xyz>: the axis is zero: give its direction, for example '0 0 1'")
        axis /= np.max(np.abs(axis))
    return Joint(name, JOINT_KINDS[kind], parent, child, position, orientation, axis)


def _origin(element: ElementTree.Element, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Position, (3,) m, and quaternion, (4,), of <origin>: roll, pitch, yaw about the fixed axes x, y, z."""
    origin = element.find("origin")
    position, angles = np.zeros(3), np.zeros(3)
    if origin is not None:
        where = f"{where}, <{element.tag}>" if element.tag != "joint" else where
        if origin.get("xyz") is not None:
            position = _numbers(element, "origin", "xyz", where, 3)
        if origin.get("rpy") is not None:
            angles = _numbers(element, "origin", "rpy", where, 3)
    roll, pitch, yaw = (rotations.exp(angle * axis) for angle, axis in zip(angles, np.eye(3), strict=True))
    return position, rotations.multiply(yaw, rotations.multiply(pitch, roll))


def _numbers(parent: ElementTree.Element, tag: str, attribute: str, where: str, count: int) -> np.ndarray:
    text = _attribute(parent, tag, attribute, where)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([np.nan])
    if values.shape != (count,) or not np.all(np.abs(values) <= LARGEST_NUMBER):
        expected = "one finite number" if count == 1 else f"{count} finite numbers"
        raise ModelError(f"{where}, <{tag} {attribute}>: {text[:80]!r} is not valid: give {expected}")
    return values


def _attribute(parent: ElementTree.Element, tag: str, attribute: str, where: str) -> str:
    element = parent.find(tag)
    if element is None:
        raise ModelError(f"{where}: <{tag}> is missing")
    value = element.get(attribute)
    if value is None:
        raise ModelError(f"{where}, <{tag}>: attribute '{attribute}' is missing")
    return value


def _name(element: ElementTree.Element) -> str:
    name = element.get("name")
    if not name:
        raise ModelError(f"a <{element.tag}> has no name: every link and joint of a URDF needs one")
    return name


def _shown(names: Iterable[str]) -> str:
    """List names in a message that stays one sentence however many there are."""
    names = list(names)
    return f"{names[:20]} and {len(names) - 20} more" if len(names) > 20 else f"{names}"


def _refuse_doubles(what: str, names: Iterable[str]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise ModelError(f"{what} '{name}' is used {count} times: it must be used once")
