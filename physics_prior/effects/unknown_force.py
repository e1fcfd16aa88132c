"""What an effect may leave to the estimator: forces that nothing tells, states of their own beside position and velocity.

Each is an Ornstein-Uhlenbeck process, f' = (mean - f) / T + white noise, of a standard deviation about its mean in the long
run (Maybeck 1979, ch. 4.11: the Gauss-Markov process of first order).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.errors import ModelError
from physics_prior.model import Tree

if TYPE_CHECKING:
    from physics_prior.effects.effect import Effect


@dataclass(frozen=True, eq=False)
class Sole:
    """A rectangle on a part that may stand on level ground, and how it is known to stand there.

    Attributes:
        part: its name.
        center: (3,) m, middle of the sole in the part's frame, where the wrench acts.
        half: (2,) m, half its edges along the part's x and y.
        friction: Coulomb's coefficient.
        height, velocity: of the ground, m and (3,) m/s.
        touch: height of the sole's lowest corner, m, and its speed along the ground, m/s, both below which it comes to stand.
        release: height and speed above either of which it is off the ground.
        least: N: what is neither still nor off is off the ground if it carries less.
    """

    part: str
    center: np.ndarray
    half: np.ndarray
    friction: float
    height: float
    velocity: np.ndarray
    touch: tuple[float, float]
    release: tuple[float, float]
    least: float

    @property
    def corners(self) -> np.ndarray:
        """(4, 3) m, in the part's frame."""
        signs = np.array([(-1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0)])
        out: np.ndarray = self.center + signs * np.append(self.half, 0.0)
        return out


@dataclass(frozen=True, eq=False)
class UnknownForce:
    """Numbers among an effect's parameters that are states of the estimator.

    Attributes:
        places: (k,) which of the parameters they are.
        deviation: (k,) N or N m, of each about its mean in the long run.
        time_constant: s.
        freedoms: (k,) the degrees of freedom on which they act, of forces in joints.
        sole: where six of them act, force before moment, world axes, about the middle of the sole; None of forces in joints.
    """

    places: np.ndarray
    deviation: np.ndarray
    time_constant: float
    freedoms: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    sole: Sole | None = None


def check_together(tree: Tree, effects: Sequence["Effect"]) -> None:
    """Raise ModelError where unknown forces stand beside rows that would share the load with them, or two in one place."""
    unknown = [(effect, force) for effect in effects if (force := effect.unknown_force(tree)) is not None]
    if not unknown:
        return
    kind = unknown[0][0].kind
    for effect in effects:
        if effect.point_pairs(tree) or effect.touching_pairs(tree) or effect.joint_ranges(tree):
            raise ModelError(
                f"'{effect.label}' holds or touches something, which no scene with '{kind}' may: the split of the load"
                " between them would be arbitrary; leave one of them out"
            )
    taken: dict[int, str] = {}
    for effect, force in unknown:
        for freedom in force.freedoms.tolist():
            if freedom in taken:
                raise ModelError(
                    f"'{effect.label}' and '{taken[freedom]}' both move '{tree.freedom_names[freedom]}': name it in one"
                )
            taken[freedom] = effect.label
    parts = [force.sole.part for _, force in unknown if force.sole is not None]
    for part in parts:
        if parts.count(part) > 1:
            raise ModelError(f"'{part}' is pushed by the ground twice: give it one '{kind}'")
