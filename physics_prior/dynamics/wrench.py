"""A wrench: what a joint or a constraint does to a part."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Wrench:
    """A force and a moment, (3,) N and (3,) N m, ON a part BY a constraint, at a point (3,) m; all in world axes."""

    force: np.ndarray
    moment: np.ndarray
    point: np.ndarray

    @property
    def acts(self) -> bool:
        """Whether it is not nothing: what touches pushes, what does not gives exact zeros."""
        return bool(self.force.any() or self.moment.any())
