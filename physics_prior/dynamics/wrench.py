"""A wrench: what a joint or a constraint does to a part."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Wrench:
    """A force and a moment, (3,) N and (3,) N m, ON a part BY a constraint, at a point (3,) m; all in world axes."""

    force: np.ndarray
    moment: np.ndarray
    point: np.ndarray
