"""Whether every joint moves an inertia: one that does not has no acceleration."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior.errors import ModelError
from physics_prior.model import JointKind
from physics_prior.model.tree import Link

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
        inertia, moments = np.diag(M), _moments(simulator)
        lacking = [k for link, moment in zip(tree.links, moments, strict=True) for k in _idle(inertia, link, moment)]
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


def _idle(inertia: np.ndarray, link: Link, moment: float) -> list[int]:
    """The degrees of freedom of a link that move nothing but rounding, against its others or the moment that it carries."""
    turning = range(link.v.start, link.v.stop)[-3:]
    largest = max(inertia[k] for k in turning)
    if link.joint.kind is JointKind.REVOLUTE:
        largest = max(largest, moment)
    return [k for k in turning if not inertia[k] > ROUNDING * largest]


def _moments(simulator: "Simulator") -> np.ndarray:
    """(links,) the polar moment of all that each carries about its joint, kg m^2: no axis has more; needs ``move``."""
    links, work = simulator.memory.links, simulator.memory.work
    moments = np.zeros(len(links))
    for i, link in enumerate(links):
        carrier = i
        while carrier >= 0:
            arm = work[i]["origin"] + work[i]["center"] - work[carrier]["origin"]
            moments[carrier] += link["inertia"][[0, 3, 5]].sum() + link["mass"] * (arm @ arm)
            carrier = int(links[carrier]["parent"])
    return moments
