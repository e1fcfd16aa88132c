"""The model section of a scene file, made into a tree."""

import os
from abc import abstractmethod
from typing import Any, Literal

import numpy as np

from physics_prior import inertia, rotations
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Shape, Tree
from physics_prior.model.human import Human
from physics_prior.model.urdf import MAXIMUM_CHARACTERS, tree_from_urdf
from physics_prior.scene.quantity import parse_quantity
from physics_prior.scene.schema import (
    HumanSection,
    JointSection,
    ModelSection,
    Orientation,
    PartSection,
    Position,
    PositiveLength,
    check_name,
)
from physics_prior.scene.section import Section, choose, relocate, require_known, validate
from physics_prior.scene.yaml_file import Place, shown

DRAWN_SLENDERNESS = 25.0  # length over diameter of the cylinder that a rod, which is thin, is drawn as


class _Shape(Section):
    """A uniform body; position, m, its centre, is the centre of mass unless the shape is only drawn."""

    position: Position | None = None
    orientation: Orientation = (1.0, 0.0, 0.0, 0.0)

    @abstractmethod
    def mass_properties(self, mass: float) -> MassProperties:
        """Those of the uniform body of this mass, kg."""

    @abstractmethod
    def drawn(self) -> tuple[Literal["box", "sphere", "ellipsoid", "cylinder", "capsule"], list[float]]:
        """Kind and size of the model's shape."""


class _Box(_Shape):
    shorthand = "size"
    size: tuple[PositiveLength, PositiveLength, PositiveLength]

    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.box(mass, self.size)

    def drawn(self) -> tuple[Literal["box"], list[float]]:
        return "box", list(self.size)


class _Sphere(_Shape):
    shorthand = "radius"
    radius: PositiveLength

    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.sphere(mass, self.radius)

    def drawn(self) -> tuple[Literal["sphere"], list[float]]:
        return "sphere", [2.0 * self.radius] * 3


class _Ellipsoid(_Shape):
    shorthand = "semi_axes"
    semi_axes: tuple[PositiveLength, PositiveLength, PositiveLength]

    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.ellipsoid(mass, self.semi_axes)

    def drawn(self) -> tuple[Literal["ellipsoid"], list[float]]:
        return "ellipsoid", [2.0 * each for each in self.semi_axes]


class _Cylinder(_Shape):
    radius: PositiveLength
    length: PositiveLength

    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.cylinder(mass, self.radius, self.length)

    def drawn(self) -> tuple[Literal["cylinder", "capsule"], list[float]]:
        return "cylinder", [2.0 * self.radius, 2.0 * self.radius, self.length]


class _Capsule(_Cylinder):
    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.capsule(mass, self.radius, self.length)

    def drawn(self) -> tuple[Literal["capsule"], list[float]]:
        return "capsule", super().drawn()[1]


class _Rod(_Shape):
    shorthand = "length"
    length: PositiveLength

    def mass_properties(self, mass: float) -> MassProperties:
        return inertia.rod(mass, self.length)

    def drawn(self) -> tuple[Literal["cylinder"], list[float]]:
        diameter = self.length / DRAWN_SLENDERNESS
        return "cylinder", [diameter, diameter, self.length]


SHAPES: dict[str, type[_Shape]] = {
    "box": _Box,
    "sphere": _Sphere,
    "ellipsoid": _Ellipsoid,
    "cylinder": _Cylinder,
    "capsule": _Capsule,
    "rod": _Rod,
}
"""Every shape, by its key in the scene file."""


def build_tree(place: Place) -> Tree:
    """Build the tree that the model section at a place describes, its parts in any order.

    Raises:
        SceneError: naming file, line and field.
    """
    section = validate(ModelSection, place)
    if section.urdf is not None:
        return _tree_from_file(place["urdf"], section)
    if section.human is not None:
        return _tree_of_human(place["human"])
    entries = place["parts"].items()
    names = [name for name, _ in entries]
    parts, joints = [], []
    for name, entry in entries:
        part = validate(PartSection, entry)
        try:
            check_name(name)
        except ValueError as error:
            raise place["parts"].error(str(error), name) from None
        parent = entry["joint"].inside(("parent",))
        require_known(parent, part.joint.parent, ["world", *names], "part")
        parts.append(_part(name, part, entry))
        joints.append(_joint(name, part.joint, entry["joint"]))
    try:
        tree = Tree.sorted(parts, joints)
    except ModelError as error:
        raise relocate(place["parts"], error, names) from None
    if tree.nv == 0:
        raise place["parts"].error("nothing moves: give at least one part a joint that is not fixed")
    return tree


def _tree_of_human(place: Place) -> Tree:
    section = validate(HumanSection, place)
    try:
        return Human(section.mass, section.height, section.sex, section.table, section.lengths, section.rigid).tree()
    except ModelError as error:
        raise relocate(place, error, []) from None


def _tree_from_file(place: Place, section: ModelSection) -> Tree:
    file = place.path.parent / str(section.urdf)
    if not os.path.isfile(file):  # unlike Path.is_file, False for a name that no file can have
        raise place.error(f"{shown(str(file))} is not a file: give a URDF relative to the scene's folder")
    try:
        with file.open(encoding="utf-8") as stream:
            tree = tree_from_urdf(stream.read(MAXIMUM_CHARACTERS + 1), section.root)
    except OSError as error:
        raise place.error(f"'{file}' cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise place.error(f"'{file}' is not UTF-8: save it as UTF-8") from None
    except ModelError as error:
        raise place.error(f"'{file}': {error}") from None
    if tree.nv == 0:
        raise place.error(f"'{file}' has nothing that moves: give it a moving joint, or 'root: free'")
    return tree


def _part(name: str, part: PartSection, place: Place) -> Part:
    center = np.array(part.center_of_mass)
    if part.inertia is None:
        if part.mass > 0.0:
            raise place.error("'inertia' is missing: give moments, a shape, or 0 for a point mass")
        moments, shape = np.zeros((3, 3)), None
    elif place["inertia"].is_mapping:
        _, _, inner = choose(place["inertia"], SHAPES, "a shape")
        if "position" in inner:
            raise inner.error("'position' is not valid here: the body stands at center_of_mass", "position")
        moments, shape = _body(place["inertia"], part.mass), _shape(place["inertia"], center)
    else:
        moments, shape = _moments(place["inertia"]), None
    if part.shape is not None:
        shape = _shape(place["shape"], center)
    try:
        return Part(name, MassProperties(part.mass, center, moments), shape)
    except ModelError as error:
        culprit = place["inertia"] if part.inertia is not None else place
        raise culprit.error(str(error)) from None


def _body(place: Place, mass: float) -> np.ndarray:
    """(3, 3) inertia, kg m^2, of a uniform body about its centre, in part axes."""
    _, kind, inner = choose(place, SHAPES, "a shape")
    shape = validate(kind, inner)
    R = rotations.matrix_from_quaternion(shape.orientation)
    try:
        return shape.mass_properties(mass).transformed(R, np.zeros(3)).inertia
    except ModelError as error:
        raise inner.error(str(error)) from None


def _shape(place: Place, center: np.ndarray) -> Shape:
    _, kind, inner = choose(place, SHAPES, "a shape")
    shape = validate(kind, inner)
    drawn, size = shape.drawn()
    position = center if shape.position is None else np.array(shape.position)
    return Shape(drawn, np.array(size), position, np.array(shape.orientation))


def _moments(place: Place) -> np.ndarray:
    """(3, 3) inertia, kg m^2, from one moment, three of them, or a matrix."""
    value = place.value
    rows = value if isinstance(value, list) else [value] * 3
    matrix = [len(row) if isinstance(row, list) else 0 for row in rows] == [3, 3, 3]
    if len(rows) != 3 or (not matrix and any(isinstance(row, list) for row in rows)):
        raise place.error(
            f"{shown(value)} is not an inertia: give a moment, [xx, yy, zz], three rows of three, or a shape"
        )
    try:
        numbers = (
            [[_moment(each) for each in row] for row in rows] if matrix else np.diag([_moment(row) for row in rows])
        )
    except ValueError as error:
        raise place.error(str(error)) from None
    return np.array(numbers)


def _moment(value: Any) -> float:
    return parse_quantity(value, "kg m^2")


def _joint(part: str, section: JointSection, place: Place) -> Joint:
    try:
        return Joint(
            section.name or part,
            JointKind[section.kind.upper()],
            section.parent,
            part,
            np.array(section.position),
            np.array(section.orientation),
            np.array(section.axis or (0.0, 0.0, 1.0)),
        )
    except ModelError as error:
        raise place.error(str(error)) from None
