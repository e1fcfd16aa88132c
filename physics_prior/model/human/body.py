"""A person as a tree of 16 segments, from mass, stature, sex and what lengths were measured.

Part frames are those of ROS (REP-103), x forward, y left and z up when standing with hanging arms, palms to the thighs: all
joints are at zero then. ISB's axes (Wu 2002, 2005) are x, z and -y of them. docs/human.md lists joints, axes and lengths.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties
from physics_prior.model.human.segment_parameters import (
    AXIAL,
    HEEL_TO_ANKLE,
    LIMBS,
    SEGMENTS,
    TABLES,
    SegmentParameters,
    Sex,
    normalised,
)
from physics_prior.model.joint import Joint, JointKind
from physics_prior.model.part import MASSLESS, Part, Shape
from physics_prior.model.tree import Tree

SIDES = {"left": 1.0, "right": -1.0}
"""Which side of y is whose."""

# Fractions of stature that segment tables do not have. Hip centres: 0.72 of the width between the anterior superior iliac
# spines (Bell 1990), 0.14 of stature; shoulder centres, as between those of Rajagopal's model (2016), 0.34 of 1.70 m; shoulders
# below C7: CERV-MIDH less MIDS-MIDH of de Leva's trunk; ankle and breadth of foot: Drillis and Contini (1966).
_EITHER = {"hip_width": 0.1, "shoulder_width": 0.2, "ankle_height": 0.039, "foot_width": 0.055}
OTHER_LENGTHS: dict[Sex, dict[str, float]] = {
    "female": {**_EITHER, "shoulder_drop": 0.067},
    "male": {**_EITHER, "shoulder_drop": 0.051},
}
LENGTHS = SEGMENTS + tuple(OTHER_LENGTHS["male"])
SIDED = (*LIMBS, "ankle_height", "foot_width")
"""Lengths that may be given for a side, as left_thigh, or for both, as thigh."""

HINGE_RANGES = {
    "elbow": (math.radians(-5.0), math.radians(150.0)),
    "radioulnar": (math.radians(-90.0), math.radians(85.0)),
    "wrist_flexion": (math.radians(-75.0), math.radians(80.0)),
    "wrist_deviation": (math.radians(-25.0), math.radians(40.0)),
    "knee": (math.radians(-5.0), math.radians(150.0)),
}
"""Lower and upper end, rad: those of healthy adults (Boone and Azen 1979), rounded outwards; 5 degrees beyond straight."""

SMALLEST, LARGEST = 0.01, 3.0  # m, of any length
SLENDERNESS = {"upper_arm": 0.15, "forearm": 0.14, "thigh": 0.17, "shank": 0.12}  # radius over length of what is drawn


@dataclass(frozen=True)
class Human:
    """A person.

    Attributes:
        mass: kg.
        height: m, stature.
        sex: ``female`` or ``male``.
        table: ``de_leva`` or ``dumas``.
        lengths: m, by name (``LENGTHS``; of a limb also left_NAME or right_NAME), where they were measured.
        rigid: names of joints that do not move.

    Raises:
        ModelError: naming the field, its value and what would be valid.
    """

    mass: float
    height: float
    sex: Sex
    table: str = "de_leva"
    lengths: Mapping[str, float] = field(default_factory=dict)
    rigid: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name, value, low, high in (("mass", self.mass, 1.0, 500.0), ("height", self.height, 0.4, 2.8)):
            if not low <= value <= high:
                raise ModelError(
                    f"{name} {value} is not valid: give {low:g} to {high:g} {'kg' if name == 'mass' else 'm'}"
                )
        if self.table not in TABLES:
            raise ModelError(f"table '{self.table}' is not known: give one of {list(TABLES)}")
        known = [*LENGTHS, *(f"{side}_{name}" for side in SIDES for name in SIDED)]
        for name, value in self.lengths.items():
            if name not in known:
                raise ModelError(f"length '{name}' is not known: give one of {known}")
            if not SMALLEST <= value <= LARGEST:
                raise ModelError(f"length '{name}' {value} is not valid: give {SMALLEST:g} to {LARGEST:g} m")

    def length(self, name: str, side: str = "") -> float:
        """A length, m: as measured, of that side or of both, or else in proportion to stature."""
        for key in (f"{side}_{name}", name):
            if key in self.lengths:
                return self.lengths[key]
        if name in SEGMENTS:
            return TABLES[self.table](self.sex)[name].length * self.height
        return OTHER_LENGTHS[self.sex][name] * self.height

    def joint_centers(self) -> dict[str, tuple[str, np.ndarray]]:
        """Where each joint stands at zero: joint -> the part that carries it (``world`` the root) and (3,) m in its frame."""
        up = {name: np.array([0.0, 0.0, self.length(name)]) for name in AXIAL}
        out = {
            "pelvis": ("world", np.zeros(3)),
            "lumbar": ("pelvis", up["pelvis"]),
            "thoracic": ("abdomen", up["abdomen"]),
            "neck": ("thorax", up["thorax"]),
        }
        for side, sign in SIDES.items():
            down = {name: np.array([0.0, 0.0, -self.length(name, side)]) for name in LIMBS}
            half_hips, half_shoulders = 0.5 * self.length("hip_width"), 0.5 * self.length("shoulder_width")
            shoulder = np.array([0.0, sign * half_shoulders, up["thorax"][2] - self.length("shoulder_drop")])
            out |= {
                f"{side}_shoulder": ("thorax", shoulder),
                f"{side}_elbow": (f"{side}_upper_arm", down["upper_arm"]),
                f"{side}_radioulnar": (f"{side}_ulna", np.zeros(3)),
                f"{side}_wrist_flexion": (f"{side}_forearm", down["forearm"]),
                f"{side}_wrist_deviation": (f"{side}_carpus", np.zeros(3)),
                f"{side}_hip": ("pelvis", np.array([0.0, sign * half_hips, 0.0])),
                f"{side}_knee": (f"{side}_thigh", down["thigh"]),
                f"{side}_ankle": (f"{side}_shank", down["shank"]),
                f"{side}_sole": (f"{side}_foot", self.heel(side)),
            }
        return out

    def heel(self, side: str) -> np.ndarray:
        """(3,) m, in the foot's frame: the hindmost point of the sole, where the frame of the part SIDE_sole stands."""
        return np.array([-HEEL_TO_ANKLE * self.length("foot", side), 0.0, -self.length("ankle_height", side)])

    def tree(self) -> Tree:
        """The model; ModelError where ``rigid`` names what is no joint."""
        centers = self.joint_centers()
        for name in self.rigid:
            if name not in centers:
                raise ModelError(f"joint '{name}' is unknown: known joints are {list(centers)}")
        parts, joints = [], []
        for name, (parent, position) in centers.items():
            child, kind, axis = _carried(name)
            if name in self.rigid:
                kind = JointKind.FIXED
            ends = HINGE_RANGES.get(name.partition("_")[2]) if kind is JointKind.REVOLUTE else None
            parts.append(self._part(child))
            joints.append(Joint(name, kind, parent, child, position, axis=np.array(axis), range=ends))
        return Tree.sorted(parts, joints)

    def _part(self, name: str) -> Part:
        side, _, segment = name.partition("_") if name.startswith(tuple(SIDES)) else ("", "", name)
        if segment == "sole":
            return Part(name, MASSLESS, self._sole(side))
        if segment not in SEGMENTS:
            return Part(name)
        parameters = normalised(self.table, self.sex)[segment]
        length, mass = self.length(segment, side), parameters.mass * self.mass
        # the tables give the right side; the left is its mirror image in the plane y = 0
        mirror = np.diag([1.0, -1.0 if side == "left" else 1.0, 1.0])
        center = mirror @ parameters.center * length
        inertia = mass * length**2 * (mirror @ parameters.inertia @ mirror)
        return Part(name, MassProperties(mass, center, inertia), self._shape(segment, side, length, parameters))

    def _sole(self, side: str) -> Shape:
        length, thickness = self.length("foot", side), 0.3 * self.length("ankle_height", side)
        size = np.array([length, self.length("foot_width", side), thickness])
        return Shape("box", size, np.array([0.5 * length, 0.0, 0.5 * thickness]))

    def _shape(self, segment: str, side: str, length: float, parameters: SegmentParameters) -> Shape:
        """What to draw: capsules between joints; ellipsoids for head, hands and feet; boxes for the trunk."""
        if segment in SLENDERNESS:
            diameter = 2.0 * SLENDERNESS[segment] * length
            return Shape("capsule", np.array([diameter, diameter, length]), np.array([0.0, 0.0, -0.5 * length]))
        if segment == "hand":
            return Shape("ellipsoid", np.array([length, 0.4 * length, 2.0 * length]), np.array([0.0, 0.0, -length]))
        if segment == "foot":
            height = self.length("ankle_height", side)
            size, middle = np.array([0.7 * length, 0.3 * length, height]), parameters.center[0] * length
            return Shape("ellipsoid", size, np.array([middle, 0.0, -0.4 * height]))
        middle_up = np.array([0.0, 0.0, 0.5 * length])
        if segment == "head":
            return Shape("ellipsoid", np.array([0.7, 0.6, 1.0]) * length, middle_up)
        width = self.length("shoulder_width" if segment == "thorax" else "hip_width")
        depth = 0.11 * self.height
        return Shape("box", np.array([depth, width * (0.9 if segment == "thorax" else 1.6), 0.9 * length]), middle_up)


def _carried(joint: str) -> tuple[str, JointKind, tuple[float, float, float]]:
    """The part that a joint carries, its kind and, of a hinge, the axis of positive rotation in part axes."""
    side, _, name = joint.partition("_")
    out = -SIDES.get(side, -1.0)  # +1 on the right: rotations towards the middle mirror their axes
    axial = {"pelvis": "pelvis", "lumbar": "abdomen", "thoracic": "thorax", "neck": "head"}
    if joint in axial:
        return axial[joint], JointKind.FREE if joint == "pelvis" else JointKind.SPHERICAL, (0.0, 0.0, 1.0)
    part, kind, axis = {
        "shoulder": ("upper_arm", JointKind.SPHERICAL, (0.0, 0.0, 1.0)),
        "elbow": ("ulna", JointKind.REVOLUTE, (0.0, -1.0, 0.0)),  # flexion
        "radioulnar": ("forearm", JointKind.REVOLUTE, (0.0, 0.0, out)),  # pronation
        "wrist_flexion": ("carpus", JointKind.REVOLUTE, (out, 0.0, 0.0)),
        "wrist_deviation": ("hand", JointKind.REVOLUTE, (0.0, 1.0, 0.0)),  # towards the ulna
        "hip": ("thigh", JointKind.SPHERICAL, (0.0, 0.0, 1.0)),
        "knee": ("shank", JointKind.REVOLUTE, (0.0, 1.0, 0.0)),  # flexion
        "ankle": ("foot", JointKind.SPHERICAL, (0.0, 0.0, 1.0)),
        "sole": ("sole", JointKind.FIXED, (0.0, 0.0, 1.0)),
    }[name]
    return f"{side}_{part}", kind, axis
