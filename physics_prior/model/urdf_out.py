"""Trees as URDF, for robot_state_publisher, RViz and other engines.

URDF has no ball joints. One becomes three hinges (ball_hinges.py), of massless links between.
"""

from xml.etree import ElementTree

import numpy as np

from physics_prior import rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties
from physics_prior.model.ball_hinges import AXES
from physics_prior.model.joint import Joint, JointKind
from physics_prior.model.part import Shape
from physics_prior.model.tree import Tree

NO_LIMIT = 1e9  # where URDF wants a number for an effort, a speed or an end that a joint has not


def urdf_from_tree(tree: Tree, name: str) -> str:
    """The URDF of a tree of one root part.

    A free joint on the world, which no URDF has, is left out: its part is the root link. Any other root joint hangs on a
    link ``world``.

    Args:
        tree: the model.
        name: of the robot.

    Raises:
        ModelError: a part stands on the world beside a free one.
    """
    robot = ElementTree.Element("robot", name=name)
    roots = [joint for joint in tree.joints if joint.parent == "world"]
    if any(joint.kind is JointKind.FREE for joint in roots):
        if len(roots) > 1:
            raise ModelError(
                f"parts {[joint.child for joint in roots]} all stand on the world: a URDF has one root link"
            )
    else:
        ElementTree.SubElement(robot, "link", name="world")
    for part, joint in zip(tree.parts, tree.joints, strict=True):
        if joint.kind is JointKind.SPHERICAL:
            _add_ball(robot, joint)
        elif joint.kind is not JointKind.FREE:
            _add_joint(robot, joint)
        link = ElementTree.SubElement(robot, "link", name=part.name)
        if part.mass_properties.mass > 0.0:
            _add_inertial(link, part.mass_properties)
        if part.shape is not None:
            _add_visual(link, part.shape)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _add_ball(robot: ElementTree.Element, joint: Joint) -> None:
    parent, position, orientation = joint.parent, joint.position, joint.orientation
    for index, (letter, axis) in enumerate(AXES):
        last = index == len(AXES) - 1
        child = joint.child if last else f"{joint.child}_{letter}"
        name = f"{joint.name}_{letter}"
        _add_joint(robot, Joint(name, JointKind.REVOLUTE, parent, child, position, orientation, axis))
        if not last:
            ElementTree.SubElement(robot, "link", name=child)
        parent, position, orientation = child, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


def _add_joint(robot: ElementTree.Element, joint: Joint) -> None:
    kind = {JointKind.FIXED: "fixed", JointKind.PRISMATIC: "prismatic"}.get(joint.kind, "revolute")
    if kind == "revolute" and joint.range is None:
        kind = "continuous"
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=kind)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    _add_origin(element, joint.position, joint.orientation)
    if kind != "fixed":
        ElementTree.SubElement(element, "axis", xyz=_text(joint.axis))
    if kind in ("revolute", "prismatic"):
        lower, upper = joint.range or (-NO_LIMIT, NO_LIMIT)
        limit = {"lower": lower, "upper": upper, "effort": NO_LIMIT, "velocity": NO_LIMIT}
        ElementTree.SubElement(element, "limit", {key: repr(float(value)) for key, value in limit.items()})


def _add_inertial(link: ElementTree.Element, body: MassProperties) -> None:
    inertial = ElementTree.SubElement(link, "inertial")
    _add_origin(inertial, body.center_of_mass, np.array([1.0, 0.0, 0.0, 0.0]))
    ElementTree.SubElement(inertial, "mass", value=repr(body.mass))
    entries = {f"i{a}{b}": (i, j) for i, a in enumerate("xyz") for j, b in enumerate("xyz") if i <= j}
    moments = {key: repr(float(body.inertia[index])) for key, index in entries.items()}
    ElementTree.SubElement(inertial, "inertia", moments)


def _add_visual(link: ElementTree.Element, shape: Shape) -> None:
    """What URDF can draw: an ellipsoid becomes the box of its diameters, a capsule the cylinder without its caps."""
    visual = ElementTree.SubElement(link, "visual")
    _add_origin(visual, shape.position, shape.orientation)
    geometry = ElementTree.SubElement(visual, "geometry")
    if shape.kind == "sphere":
        ElementTree.SubElement(geometry, "sphere", radius=repr(float(0.5 * shape.size[0])))
    elif shape.kind in ("cylinder", "capsule"):
        radius, length = (repr(float(value)) for value in (0.5 * shape.size[0], shape.size[2]))
        ElementTree.SubElement(geometry, "cylinder", radius=radius, length=length)
    else:
        ElementTree.SubElement(geometry, "box", size=_text(shape.size))


def _add_origin(element: ElementTree.Element, position: np.ndarray, orientation: np.ndarray) -> None:
    """<origin>: roll, pitch and yaw about the fixed axes x, y, z, R = Rz(yaw) Ry(pitch) Rx(roll)."""
    R = rotations.matrix_from_quaternion(orientation)
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) > 1e-9:
        roll, yaw = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    else:  # straight up or down: only their sum or difference counts
        roll, yaw = 0.0, np.arctan2(-R[0, 1], R[1, 1])
    ElementTree.SubElement(element, "origin", xyz=_text(position), rpy=_text([roll, pitch, yaw]))


def _text(numbers: np.ndarray | list[float]) -> str:
    """Numbers as URDF wants them, each by the shortest text that reads back as the same double."""
    return " ".join(repr(float(number) + 0.0) for number in numbers)
