"""Marker sets: which markers a laboratory puts on a person, and about where; what a calibration starts from."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from physics_prior.errors import ModelError
from physics_prior.model.human import SIDES, Human
from physics_prior.resources import marker_set_path
from physics_prior.scene.schema import Name, Number, PositiveLength
from physics_prior.scene.section import Section, relocate, require_known, validate
from physics_prior.scene.yaml_file import read_yaml


class NominalMarker(Section):
    """A marker of a set.

    Attributes:
        part: that it is on.
        point: from the joint that carries the part, x forward, y left, z up, in lengths of the part's segment (``unit``).
        place: the anatomical place, for people.
        spread: m, standard deviation of the true place about that one, each direction.
    """

    part: str
    point: tuple[Number, Number, Number]
    place: str
    spread: PositiveLength = 0.02

    def unit(self) -> tuple[str, str]:
        """The length that ``point`` is in, by name and side (empty if it has none): the hips' width on the pelvis."""
        side = next((side for side in SIDES if self.part.startswith(f"{side}_")), "")
        segment = self.part.removeprefix(f"{side}_")
        return ("hip_width" if segment == "pelvis" else segment), side

    def nominal(self, human: Human) -> np.ndarray:
        """(3,) m, where it is on a person, in the part's frame."""
        return human.length(*self.unit()) * np.array(self.point)


class _MarkerSetFile(Section):
    description: str
    rigid: tuple[str, ...] = ()
    markers: Annotated[dict[Name, NominalMarker], Field(min_length=1)]


@dataclass(frozen=True)
class MarkerSet:
    """The markers of a set in the order of the messages, by name, and the joints that they cannot tell."""

    name: str
    description: str
    rigid: tuple[str, ...]
    markers: dict[str, NominalMarker]


def load_marker_set(name_or_path: str | Path) -> MarkerSet:
    """Load a shipped marker set by its name, or any by its path.

    Raises:
        SceneError: no such set, or one sentence `FILE:LINE: FIELD: what is wrong and what would be valid`.
    """
    top = read_yaml(marker_set_path(name_or_path))
    file = validate(_MarkerSetFile, top)
    segments = [part.name for part in Human(70.0, 1.75, "male").tree().parts if part.mass_properties.mass > 0.0]
    for name, marker in file.markers.items():
        require_known(top["markers"][name]["part"], marker.part, segments, "segment")
    try:
        Human(70.0, 1.75, "male", rigid=file.rigid).tree()
    except ModelError as error:
        raise relocate(top["rigid"], error, []) from None
    return MarkerSet(top.path.stem, file.description.strip(), file.rigid, file.markers)
