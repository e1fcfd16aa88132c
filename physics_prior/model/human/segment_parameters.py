"""Published inertial parameters of the segments of the human body, as fractions of body mass and segment length.

de Leva 1996 (J Biomech 29:1223-1230, Table 4) adjusts Zatsiorsky's gamma-ray scans of young athletes; Dumas 2007 and 2015
(J Biomech 40:543-553) adjust McConville's and Young's stereophotographs of adults, and have products of inertia. Head and
thorax meet at the cervicale (C7) in both. An endpoint and the fractions that count from it go together: rows of different
endpoints are never mixed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

Sex = Literal["female", "male"]
AXIAL = ("pelvis", "abdomen", "thorax", "head")
LIMBS = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
SEGMENTS = AXIAL + LIMBS
HEEL_TO_ANKLE = 0.25  # of the foot's length; the heel is that far behind the ankle


@dataclass(frozen=True, eq=False)
class SegmentParameters:
    """One segment, of the right side if it has one; axes x forward, y left, z up, standing with hanging arms.

    Attributes:
        mass: fraction of the body's.
        length: fraction of stature, of an average person.
        center: (3,) centre of mass from the part's origin (the proximal joint), in segment lengths.
        inertia: (3, 3) about it, in segment mass times length squared.
    """

    mass: float
    length: float
    center: np.ndarray
    inertia: np.ndarray


# Columns: length in mm; mass in % of the body's; centre of mass in % of the length from the endpoint named first; radii of
# gyration about the sagittal (forward), transverse and longitudinal axis in % of the length. Endpoints of head and trunk, the
# upper first: head VERT-CERV, thorax CERV-XYPH, abdomen XYPH-OMPH, pelvis OMPH-MIDH.
DE_LEVA: dict[Sex, dict[str, tuple[float, ...]]] = {
    "female": {
        "head": (244.0, 6.68, 48.41, 27.1, 29.5, 26.1),
        "thorax": (229.2, 15.45, 50.50, 46.6, 31.4, 44.9),
        "abdomen": (205.3, 14.65, 45.12, 43.3, 35.4, 41.5),
        "pelvis": (181.5, 12.47, 49.20, 43.3, 40.2, 44.4),
        "upper_arm": (275.1, 2.55, 57.54, 27.8, 26.0, 14.8),
        "forearm": (264.3, 1.38, 45.59, 26.1, 25.7, 9.4),
        "hand": (78.0, 0.56, 74.74, 53.1, 45.4, 33.5),
        "thigh": (368.5, 14.78, 36.12, 36.9, 36.4, 16.2),
        "shank": (439.0, 4.81, 43.52, 26.7, 26.3, 9.2),
        "foot": (228.3, 1.29, 40.14, 29.9, 27.9, 13.9),
    },
    "male": {
        "head": (243.0, 6.94, 50.02, 30.3, 31.5, 26.1),
        "thorax": (241.8, 15.96, 50.66, 50.5, 32.0, 46.5),
        "abdomen": (215.5, 16.33, 45.02, 48.2, 38.3, 46.8),
        "pelvis": (145.7, 11.17, 61.15, 61.5, 55.1, 58.7),
        "upper_arm": (281.7, 2.71, 57.72, 28.5, 26.9, 15.8),
        "forearm": (268.9, 1.62, 45.74, 27.6, 26.5, 12.1),
        "hand": (86.2, 0.61, 79.00, 62.8, 51.3, 40.1),
        "thigh": (422.2, 14.16, 40.95, 32.9, 32.9, 14.9),
        "shank": (441.0, 4.33, 43.95, 25.1, 24.6, 10.2),
        "foot": (258.1, 1.37, 44.15, 25.7, 24.5, 12.4),
    },
}
DE_LEVA_STATURE: dict[Sex, float] = {"female": 1735.0, "male": 1741.0}

# Columns: length in mm; mass; centre of mass in ISB axes (x forward, y up, z right) over the length, from the upper endpoint (the
# head: from the lower); radii xx, yy, zz, xy, xz, yz over the length, a product of inertia having the sign of its radius.
# The foot's reference length is that from the ankle to the heads of the metatarsals.
DUMAS: dict[Sex, dict[str, tuple[float, ...]]] = {
    "female": {
        "head": (243.0, 0.067, 0.016, 0.575, 0.001, 0.29, 0.23, 0.30, -0.04, 0.01, 0.0),
        "thorax": (304.0, 0.263, 0.021, -0.528, 0.001, 0.39, 0.33, 0.35, -0.12, -0.03, 0.01),
        "abdomen": (125.0, 0.041, 0.244, -0.415, 0.005, 0.67, 0.77, 0.55, 0.20, -0.03, -0.05),
        "pelvis": (107.0, 0.146, -0.009, -0.232, 0.002, 0.91, 1.00, 0.79, -0.34, -0.01, -0.01),
        "upper_arm": (243.0, 0.022, -0.073, -0.454, -0.028, 0.33, 0.17, 0.33, 0.03, -0.05, -0.14),
        "forearm": (247.0, 0.013, 0.021, -0.411, 0.019, 0.26, 0.14, 0.25, 0.10, 0.04, -0.13),
        "hand": (71.0, 0.005, 0.033, -0.327, 0.021, 0.27, 0.18, 0.25, 0.12, 0.10, -0.12),
        "thigh": (379.0, 0.146, -0.077, -0.377, 0.009, 0.31, 0.19, 0.32, 0.07, -0.02, -0.07),
        "shank": (388.0, 0.045, -0.049, -0.404, 0.031, 0.28, 0.10, 0.28, 0.02, 0.01, 0.06),
        "foot": (117.0, 0.010, 0.382, -0.309, 0.055, 0.24, 0.51, 0.50, -0.15, 0.09, -0.05),
    },
    "male": {
        "head": (278.0, 0.067, 0.020, 0.536, 0.001, 0.28, 0.21, 0.30, -0.07, -0.02, 0.03),
        "thorax": (326.0, 0.304, 0.0, -0.555, -0.004, 0.42, 0.33, 0.36, -0.11, 0.01, 0.03),
        "abdomen": (151.0, 0.029, 0.173, -0.361, -0.003, 0.54, 0.66, 0.40, 0.11, -0.06, -0.05),
        "pelvis": (94.0, 0.142, 0.028, -0.280, -0.006, 1.01, 1.06, 0.95, -0.25, -0.12, -0.08),
        "upper_arm": (271.0, 0.024, 0.017, -0.452, -0.026, 0.31, 0.14, 0.32, 0.06, 0.05, 0.02),
        "forearm": (283.0, 0.017, 0.010, -0.417, 0.014, 0.28, 0.11, 0.27, 0.03, 0.02, -0.08),
        "hand": (80.0, 0.006, 0.035, -0.357, 0.032, 0.26, 0.16, 0.24, 0.09, 0.07, -0.08),
        "thigh": (432.0, 0.123, -0.041, -0.429, 0.033, 0.29, 0.15, 0.30, 0.07, -0.02, -0.07),
        "shank": (433.0, 0.048, -0.048, -0.410, 0.007, 0.28, 0.10, 0.28, -0.04, -0.02, 0.05),
        "foot": (139.0, 0.012, 0.502, -0.199, 0.034, 0.22, 0.49, 0.48, 0.17, -0.11, 0.0),
    },
}
DUMAS_STATURE: dict[Sex, float] = {"female": 1610.0, "male": 1770.0}
FOOT_OVER_REFERENCE: dict[Sex, float] = {"female": 2.0, "male": 1.9}  # heel to toe tip over ankle to metatarsals

FROM_ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes of a part (x forward, y left, z up) from ISB's (x forward, y up, z right)."""


def de_leva(sex: Sex) -> dict[str, SegmentParameters]:
    """Every segment of de Leva's table by its name, masses as printed."""
    out = {}
    for name, (length, mass, center, *radii) in DE_LEVA[sex].items():
        along, (sagittal, transverse, longitudinal) = center / 100.0, (radius / 100.0 for radius in radii)
        diagonal = [sagittal, transverse, longitudinal]
        if name == "foot":  # it lies along x, a little above the sole
            offset = np.array([along - HEEL_TO_ANKLE, 0.0, -0.5 * HEEL_TO_ANKLE])
            diagonal = [longitudinal, transverse, sagittal]
        elif name in AXIAL:
            offset = np.array([0.0, 0.0, 1.0 - along])
        else:
            offset = np.array([0.0, 0.0, -along])
        out[name] = SegmentParameters(mass / 100.0, length / DE_LEVA_STATURE[sex], offset, np.diag(np.square(diagonal)))
    return out


def dumas(sex: Sex) -> dict[str, SegmentParameters]:
    """Every segment of Dumas's table by its name, masses as printed."""
    out = {}
    for name, (length, mass, x, y, z, *radii) in DUMAS[sex].items():
        xx, yy, zz, xy, xz, yz = (np.sign(radius) * radius**2 for radius in radii)
        inertia = FROM_ISB @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ FROM_ISB.T
        center = FROM_ISB @ np.array([x, y, z])
        unit = 1.0
        if name == "foot":
            unit = FOOT_OVER_REFERENCE[sex]
        elif name in AXIAL and name != "head":  # counted from the top
            center[2] += 1.0
        out[name] = SegmentParameters(mass, unit * length / DUMAS_STATURE[sex], center / unit, inertia / unit**2)
    return out


TABLES: Mapping[str, Callable[[Sex], dict[str, SegmentParameters]]] = {"de_leva": de_leva, "dumas": dumas}
"""The tables by name."""


def normalised(table: str, sex: Sex) -> dict[str, SegmentParameters]:
    """The segments of a table, their masses (limbs counted twice) scaled to sum to one."""
    segments = TABLES[table](sex)
    total = sum(each.mass * (1.0 if name in AXIAL else 2.0) for name, each in segments.items())
    return {
        name: SegmentParameters(each.mass / total, each.length, each.center, each.inertia)
        for name, each in segments.items()
    }
