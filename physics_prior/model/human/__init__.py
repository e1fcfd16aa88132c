"""People: a tree of segments from mass, stature, sex and published segment parameters."""

from physics_prior.model.human.body import HINGE_RANGES, LENGTHS, SIDED, SIDES, Human
from physics_prior.model.human.segment_parameters import (
    HEEL_TO_ANKLE,
    LIMBS,
    SEGMENTS,
    TABLES,
    SegmentParameters,
    Sex,
    normalised,
)

__all__ = [
    "HEEL_TO_ANKLE",
    "HINGE_RANGES",
    "LENGTHS",
    "LIMBS",
    "SEGMENTS",
    "SIDED",
    "SIDES",
    "TABLES",
    "Human",
    "SegmentParameters",
    "Sex",
    "normalised",
]
