"""A number of a scene as the search moves it: a factor, a strength or a component.

A mass, a length or a noise is moved by a factor, in the logarithm, so that it keeps its sign. The strength of an effect is
moved in proportion and may come down to zero: the likelihood is nearly quadratic in it, and where it ends at zero the effect
is not there. A component of a vector in which some number is zero, or signs differ, is moved by a share of the vector's
length: so a direction is found.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from physics_prior.errors import SceneError
from physics_prior.studies.effects.variant import SceneText

LARGEST_FACTOR = 1e3  # a factor is sought between 1/1000 and 1000, a strength up to 1000 times what it was
FAINTEST = 1e-6  # of the strength that was given: it stands for none, which an effect may not take
FARTHEST = {"factor": 0.5, "strength": 10.0, "component": 0.5}  # of one step of the search
WIDEST = {"factor": 0.3, "strength": 3.0, "component": 0.3}  # of the differences that derivatives are made of


@dataclass(frozen=True)
class Parameter:
    """A number of a scene file and its coordinate x, which is 0 where the number is as the file has it.

    Attributes:
        path: of the number.
        kind: how x moves it.
        start: the number in the file, in its unit there.
        scale: what x = 1 adds to it; of a factor what one is multiplied with (start itself).
    """

    path: str
    kind: Literal["factor", "strength", "component"]
    start: float
    scale: float

    @property
    def lowest(self) -> float:
        """Lower end of x."""
        return {"factor": -math.log(LARGEST_FACTOR), "strength": FAINTEST - 1.0, "component": -LARGEST_FACTOR}[
            self.kind
        ]

    @property
    def highest(self) -> float:
        """Upper end of x."""
        return math.log(LARGEST_FACTOR) if self.kind == "factor" else LARGEST_FACTOR

    def number(self, x: float) -> float:
        """The number at a coordinate."""
        return self.start * math.exp(x) if self.kind == "factor" else self.start + self.scale * x

    def interval(self, x: float, half: float) -> tuple[float, float]:
        """Ends of the number where x may be off by half; NaN where that tells nothing."""
        if not half < (self.highest if self.kind == "factor" else math.inf):
            return math.nan, math.nan
        low, high = sorted((self.number(x - half), self.number(x + half)))
        return (max(0.0, low), high) if self.kind == "strength" else (low, high)


def parameters(scene: SceneText, paths: Sequence[str], strengths: Sequence[str]) -> list[Parameter]:
    """Parameters at some paths, of which some are those of strengths; a path to a list or a mapping means all numbers in it.

    Raises:
        SceneError: a path leads nowhere, or to what cannot be moved.
    """
    spread = [inner for path in paths for inner in _spread(scene, scene.proper(path))]
    return [_parameter(scene, path, path in strengths) for path in dict.fromkeys(spread)]


def _spread(scene: SceneText, path: str) -> list[str]:
    value = scene.value(path)
    keys: Sequence[Any] = ()
    if isinstance(value, (list, dict)):
        keys = range(len(value)) if isinstance(value, list) else list(value)
        return [inner for key in keys for inner in _spread(scene, f"{path}.{key}")]
    return [path]


def _parameter(scene: SceneText, path: str, strength: bool) -> Parameter:
    start = scene.number(path)
    if strength:
        return Parameter(path, "strength", start, start)
    parent = path.rpartition(".")[0]
    beside = scene.value(parent) if parent else None
    if isinstance(beside, list):
        numbers = np.array([scene.number(f"{parent}.{place}") for place in range(len(beside))])
        length = float(np.linalg.norm(numbers))
        if length > 0.0 and not (np.all(numbers > 0.0) or np.all(numbers < 0.0)):
            return Parameter(path, "component", start, length)
    if start == 0.0:
        raise SceneError(f"{scene.path}: {path}: 0 cannot be fitted: give a number other than zero to start from")
    return Parameter(path, "factor", start, start)
