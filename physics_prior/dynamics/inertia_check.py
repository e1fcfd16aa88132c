"""Whether every joint moves an inertia: one that does not has no acceleration."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.errors import ModelError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

SINGULAR = 1e-13  # least eigenvalue of the scaled mass matrix: below, a joint moves nothing
ROUNDING = 1e-15  # of the largest moment about a joint: below, a moment is zero
POSTURES = 3


def check_inertia(simulator: "Simulator") -> None:
    """Refuse joints that move no inertia, in any of a few postures (a point mass on a joint's axis, say).

    Raises:
        ModelError: names the degree of freedom.
    """
    tree, rng, worst = simulator.tree, np.random.default_rng(0), None
    for _ in range(POSTURES):
        q = tree.integrate(tree.neutral(), rng.normal(size=tree.nv))
        M = simulator.mass_matrix(q)
        inertia = np.diag(M)
        lacking = [k for link in tree.links for k in _idle(inertia, link.v)]
        if lacking:
            worst = lacking[0]
        else:
            scale = np.sqrt(inertia)
            values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
            if values[0] > SINGULAR:
                return
            worst = int(np.argmax(np.abs(vectors[:, 0])))
    if worst is not None:
        raise ModelError(
            f"'{tree.freedom_names[worst]}' moves no inertia: give what it carries a mass off its axis or an inertia"
        )


def _idle(inertia: np.ndarray, v: slice) -> list[int]:
    """The degrees of freedom v of a joint that move nothing but rounding, against the others that turn about it."""
    turning = range(v.start, v.stop)[-3:]
    largest = max(inertia[k] for k in turning)
    return [k for k in turning if not inertia[k] > ROUNDING * largest]
