"""Values given by joint name in a scene file, laid out along q and v."""

from typing import Any

import numpy as np

from physics_prior.model import JointKind, Link, Tree
from physics_prior.scene.quantity import parse_quantity
from physics_prior.scene.scene import Initial, Noise
from physics_prior.scene.schema import FreeNoiseSection, Pose, Twist, parse_orientation
from physics_prior.scene.section import require_known, validate
from physics_prior.scene.yaml_file import Place, shown

FORCE_UNITS = ("N sqrt(s)", "N m sqrt(s)")
JERK_UNITS = ("m/s^3 sqrt(s)", "rad/s^3 sqrt(s)")
VELOCITY_UNITS = ("m/s", "rad/s")
NO_FORCE, DEFAULT_JERK, DEFAULT_VELOCITY = 0.0, 100.0, 10.0


def read_noise(place: Place, tree: Tree) -> Noise:
    """Noise per degree of freedom from the noise section at a place; no section, no force noise.

    Raises:
        SceneError: naming file, line and field.
    """
    values = []
    for key, units, default in (
        ("force", FORCE_UNITS, NO_FORCE),
        ("jerk", JERK_UNITS, DEFAULT_JERK),
        ("velocity", VELOCITY_UNITS, DEFAULT_VELOCITY),
    ):
        values.append(_by_freedom(place[key], tree, units) if key in place else np.full(tree.nv, default))
    return Noise(*values)


def read_initial(place: Place, tree: Tree) -> Initial:
    """Start values from the initial section at a place; joints not named there start at zero and at rest.

    Raises:
        SceneError: naming file, line and field.
    """
    q, v = tree.neutral(), np.zeros(tree.nv)
    for key, parse, out in (("positions", _coordinates, q), ("velocities", _velocities, v)):
        for name, entry in place[key].items() if key in place else []:
            link = _link(place[key], name, tree)
            out[link.q if key == "positions" else link.v] = parse(entry, link)
    return Initial(q, v)


def _link(place: Place, name: str, tree: Tree) -> Link:
    require_known(place, name, [link.joint.name for link in tree.links], "moving joint", name)
    return tree.link(name)


def _by_freedom(place: Place, tree: Tree, units: tuple[str, str]) -> np.ndarray:
    """(nv,) standard deviations, from one for all or from a mapping that has every moving joint."""
    values = np.zeros(tree.nv)
    if not place.is_mapping:
        for link in tree.links:
            values[link.v] = _of_joint(place, link, units)
        return values
    for name, entry in place.items():
        link = _link(place, name, tree)
        values[link.v] = _of_joint(entry, link, units)
    missing = [link.joint.name for link in tree.links if link.joint.name not in place]
    if missing:
        raise place.error(f"joint '{missing[0]}' is missing: give every moving joint, or one number for all")
    return values


def _of_joint(place: Place, link: Link, units: tuple[str, str]) -> np.ndarray:
    kind, size = link.joint.kind, link.joint.nv
    if kind is JointKind.FREE and place.is_mapping:
        validate(FreeNoiseSection, place)
        return np.repeat([_deviation(place["linear"], units[0]), _deviation(place["angular"], units[1])], 3)
    if kind is JointKind.FREE:
        if isinstance(place.value, str):
            raise place.error(
                f"{shown(place.value)} cannot be both linear and angular: give the free joint"
                f" '{link.joint.name}' {{linear: NUMBER {units[0]}, angular: NUMBER {units[1]}}}"
            )
        return np.full(size, _deviation(place, units[0]))
    if kind is JointKind.SPHERICAL and place.is_list:
        axes = place.entries()
        if len(axes) != size:
            raise place.error(
                f"{shown(place.value)} has {len(axes)} entries: give one number, or one for each of x, y and z"
            )
        return np.array([_deviation(each, units[1]) for each in axes])
    return np.full(size, _deviation(place, units[0] if kind is JointKind.PRISMATIC else units[1]))


def _deviation(place: Place, unit: str) -> float:
    value = _quantity(place, place.value, unit)
    if value < 0.0:
        raise place.error(f"{shown(place.value)} is out of range: a standard deviation is >= 0")
    return value


def _coordinates(place: Place, link: Link) -> Any:
    kind = link.joint.kind
    if kind is JointKind.FREE:
        pose = validate(Pose, place)
        return np.concatenate([pose.position, pose.orientation])
    if kind is JointKind.SPHERICAL:
        try:
            return parse_orientation(place.value)
        except ValueError as error:
            raise place.error(str(error)) from None
    return _quantity(place, place.value, "m" if kind is JointKind.PRISMATIC else "rad")


def _velocities(place: Place, link: Link) -> Any:
    kind = link.joint.kind
    if kind is JointKind.FREE:
        twist = validate(Twist, place)
        return np.concatenate([twist.linear, twist.angular])
    if kind is JointKind.SPHERICAL:
        value = place.value
        if not isinstance(value, list) or len(value) != 3:
            raise place.error(f"{shown(value)} is not an angular velocity: give three numbers, rad/s")
        return [_quantity(place, each, "rad/s") for each in value]
    return _quantity(place, place.value, "m/s" if kind is JointKind.PRISMATIC else "rad/s")


def _quantity(place: Place, value: Any, unit: str) -> float:
    try:
        return parse_quantity(value, unit)
    except ValueError as error:
        raise place.error(str(error)) from None
