"""What an effect may ask to be kept apart: joints from the ends of their range, surfaces from each other (design eq. 8)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class JointRange:
    """The range of a revolute or prismatic joint: one inequality row at each finite end.

    Attributes:
        joint: its name.
        lower, upper: rad or m; infinite where there is no end.
        restitution: speed after an impact over speed before it, 0..1.
        restitution_deviation: standard deviation of that, for the filter.
        quiet: rad/s or m/s, speed of approach below which nothing bounces.
    """

    joint: str
    lower: float
    upper: float
    restitution: float
    restitution_deviation: float
    quiet: float


@dataclass(frozen=True)
class Surface:
    """A convex surface fixed on a part or on ``world``.

    Attributes:
        part: its name.
        kind: what it is; a plane is the half-space below its own z axis.
        size: (3,) m: radius (sphere); radius and half length between the caps (capsule); half edges (box); semi-axes.
        position: (3,) m, of its centre in the part's frame.
        orientation: (4,) quaternion, its axes to the part's frame.
    """

    part: str
    kind: Literal["plane", "sphere", "capsule", "box", "ellipsoid"]
    size: np.ndarray
    position: np.ndarray
    orientation: np.ndarray

    @property
    def halves(self) -> np.ndarray:
        """(3,) m, half the edges of the box about it, along its own axes."""
        if self.kind == "plane":
            return np.array([np.inf, np.inf, 0.0])
        if self.kind == "sphere":
            return np.full(3, self.size[0])
        if self.kind == "capsule":
            return np.array([self.size[0], self.size[0], self.size[0] + self.size[1]])
        return self.size.copy()


@dataclass(frozen=True)
class Footing:
    """What may stand on the ground.

    Attributes:
        surface: what touches it.
        velocity: (3,) m/s, world axes, of the ground's material (a treadmill's belt).
    """

    surface: Surface
    velocity: np.ndarray


@dataclass(frozen=True)
class TouchingPair:
    """Two surfaces that may touch: the published force acts ON b's part.

    Attributes:
        a, b: the surfaces; only a may be a plane.
        friction: Coulomb's coefficient; rolling: m, moment of rolling resistance over normal force.
        restitution, quiet: as of ``JointRange``.
        friction_deviation, restitution_deviation: how uncertain they are, for the filter.
        impulse_deviation: how far the impulse of an impact may be off the law's, as a share of it, for the filter.
        velocity: (3,) m/s, world axes, of surface a's material where it moves though its part does not (a treadmill).
    """

    a: Surface
    b: Surface
    friction: float
    rolling: float
    restitution: float
    quiet: float
    friction_deviation: float
    restitution_deviation: float
    impulse_deviation: float
    velocity: np.ndarray
