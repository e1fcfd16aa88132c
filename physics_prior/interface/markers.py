"""Markers out: parts as shapes, forces as arrows, what touches or holds as dots, uncertainty as ellipsoids."""

from collections.abc import Iterator, Mapping

import numpy as np
from scipy import constants

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation import chi_squared
from physics_prior.estimation.estimate import Estimate
from physics_prior.interface.geometry import point_of, pose_of, vector_of
from physics_prior.model import Part, Tree
from physics_prior.recording.messages import ColorRGBA, Header, Marker, MarkerArray, Pose, Vector3

SHAFT, HEAD, DOT = 0.04, 0.1, 0.08  # diameters of an arrow and of a point of contact, of the size of the model
LEAST_ARROW, LEAST_AXIS = 1e-3, 1e-3  # drawn: of the size of the model
PROBABILITY = 0.95  # that the true point is inside its ellipsoid

PART_COLOR = ColorRGBA(0.55, 0.65, 0.8, 1.0)
FORCE_COLOR = ColorRGBA(0.85, 0.2, 0.15, 1.0)
CONTACT_COLOR = ColorRGBA(0.1, 0.75, 0.3, 1.0)
HOLD_COLOR = ColorRGBA(0.6, 0.2, 0.75, 1.0)
UNCERTAINTY_COLOR = ColorRGBA(0.95, 0.75, 0.1, 0.4)


def markers(header: Header, forces: list[str], estimate: Estimate, simulator: Simulator) -> MarkerArray:
    """Draw an estimate. A marker keeps namespace and id: parts and links by their order in the tree, forces by theirs.

    An ellipsoid holds the link's centre of mass with 95 % probability; an arrow begins where its force acts. Both are
    drawn from one thousandth of the model's size on. A dot stands, while something touches or holds, where its force acts.
    Calls ``simulator.move``.
    """
    simulator.move(estimate.q, estimate.v)
    size = _size(simulator.tree)
    drawn = [
        *_parts(header, simulator),
        *_forces(header, forces, estimate, size, simulator.tree.mass),
        *_dots(header, "contacts", CONTACT_COLOR, _touching(simulator, estimate), estimate, size),
        *_dots(header, "attachments", HOLD_COLOR, _holding(simulator, estimate), estimate, size),
        *_uncertainty(header, estimate, simulator, size),
    ]
    return MarkerArray(drawn)


def _size(tree: Tree) -> float:
    """Return a length that is typical of the model, m: its largest part or distance of joints; 1 where there is none."""
    lengths = [float(np.max(part.shape.size)) for part in tree.parts if part.shape is not None]
    lengths += [float(np.linalg.norm(joint.position)) for joint in tree.joints]
    return max(lengths, default=0.0) or 1.0


def _parts(header: Header, simulator: Simulator) -> Iterator[Marker]:
    for index, part in enumerate(simulator.tree.parts):
        if part.shape is None:
            continue
        origin, R = simulator.pose(part.name)
        position = origin + R @ part.shape.position
        wxyz = rotations.multiply(rotations.quaternion_from_matrix(R), part.shape.orientation)
        yield Marker(
            header,
            "parts",
            3 * index,
            _kind(part),
            Marker.ADD,
            pose_of(position, wxyz),
            vector_of(part.shape.size),
            PART_COLOR,
        )
        if part.shape.kind == "capsule":
            diameter, _, length = part.shape.size.tolist()
            axis = rotations.rotate(wxyz, np.array([0.0, 0.0, 0.5 * length]))
            for number, end in ((1, position + axis), (2, position - axis)):
                yield Marker(
                    header,
                    "parts",
                    3 * index + number,
                    Marker.SPHERE,
                    Marker.ADD,
                    pose_of(end, wxyz),
                    Vector3(diameter, diameter, diameter),
                    PART_COLOR,
                )


def _kind(part: Part) -> int:
    kinds = {"box": Marker.CUBE, "sphere": Marker.SPHERE, "ellipsoid": Marker.SPHERE}
    assert part.shape is not None
    return kinds.get(part.shape.kind, Marker.CYLINDER)


def _forces(header: Header, forces: list[str], estimate: Estimate, size: float, mass: float) -> Iterator[Marker]:
    thickness = Vector3(SHAFT * size, HEAD * size, 0.0)
    for index, name in enumerate(forces):
        wrench = estimate.wrenches[name]
        # a force of all parts' weight is drawn as long as the largest part
        arrow = wrench.force * (size / (mass * constants.g))
        shown = float(np.linalg.norm(arrow)) > LEAST_ARROW * size
        yield Marker(
            header,
            "forces",
            index,
            Marker.ARROW,
            Marker.ADD if shown else Marker.DELETE,
            Pose(),
            thickness,
            FORCE_COLOR,
            points=(point_of(wrench.point), point_of(wrench.point + arrow)),
        )


def _touching(simulator: Simulator, estimate: Estimate) -> dict[str, bool]:
    feet = [foot.name for foot in simulator.unknown.feet]
    return {name: estimate.wrenches[name].acts for name in [*simulator.touching, *feet]}


def _holding(simulator: Simulator, estimate: Estimate) -> dict[str, bool]:
    switches = simulator.switches
    return {name: name in estimate.holding for index, name in enumerate(switches.labels) if switches.grips(index)}


def _dots(
    header: Header, namespace: str, color: ColorRGBA, shown: Mapping[str, bool], estimate: Estimate, size: float
) -> Iterator[Marker]:
    """A dot where each of these forces acts, or none."""
    for index, (name, there) in enumerate(shown.items()):
        yield Marker(
            header,
            namespace,
            index,
            Marker.SPHERE,
            Marker.ADD if there else Marker.DELETE,
            pose_of(estimate.wrenches[name].point, np.array([1.0, 0.0, 0.0, 0.0])),
            Vector3(DOT * size, DOT * size, DOT * size),
            color,
        )


def _uncertainty(header: Header, estimate: Estimate, simulator: Simulator, size: float) -> Iterator[Marker]:
    nv, radius = len(estimate.v), np.sqrt(chi_squared.quantile(PROBABILITY, 3))  # in standard deviations
    of_positions = estimate.covariance[:nv, :nv]
    for index, link in enumerate(simulator.tree.links):
        center = link.mass_properties.center_of_mass
        origin, R = simulator.pose(link.part)
        J = simulator.jacobian(link.part, center)[3:]
        variances, axes = np.linalg.eigh(J @ of_positions @ J.T)
        axes[:, 0] *= np.sign(np.linalg.det(axes))  # a rotation, not a mirror
        diameters = 2.0 * radius * np.sqrt(np.maximum(variances, 0.0))
        yield Marker(
            header,
            "uncertainty",
            index,
            Marker.SPHERE,
            Marker.ADD if diameters[-1] > LEAST_AXIS * size else Marker.DELETE,
            pose_of(origin + R @ center, rotations.quaternion_from_matrix(axes)),
            vector_of(np.maximum(diameters, LEAST_AXIS * size)),  # a flat one would not be drawn
            UNCERTAINTY_COLOR,
        )
