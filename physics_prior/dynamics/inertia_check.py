"""Whether every joint moves an inertia: one that does not has no acceleration.

By the textbook's formulas in NumPy: a few postures once a scene are not worth a kernel, which takes half a second to compile.
"""

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.formulations.generalized import mass_matrix
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Tree
from physics_prior.model.tree import Link

SINGULAR = 1e-13  # least eigenvalue of the scaled mass matrix: below, a joint moves nothing
ROUNDING = 1e-15  # of the largest moment about a joint: below, a moment is zero
POSTURES = 3


def check_inertia(tree: Tree) -> None:
    """Refuse joints that move no inertia, in any of a few postures (a point mass on a joint's axis, say).

    Raises:
        ModelError: names the degree of freedom.
    """
    rng, worst = np.random.default_rng(0), None
    for _ in range(POSTURES):
        q = tree.integrate(tree.neutral(), rng.normal(size=tree.nv))
        M = mass_matrix(tree, q)
        inertia, moments = np.diag(M), _moments(tree, q)
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


def _moments(tree: Tree, q: np.ndarray) -> np.ndarray:
    """(links,) the polar moment of all that each carries about its joint at q, kg m^2: no axis has more."""
    pose, moments = kinematics(tree, q, np.zeros(tree.nv)), np.zeros(len(tree.links))
    for i, link in enumerate(tree.links):
        own, carrier = link.mass_properties, i
        center = pose.position[i] + rotations.rotate(pose.orientation[i], own.center_of_mass)
        while carrier >= 0:
            arm = center - pose.position[carrier]
            moments[carrier] += np.trace(own.inertia) + own.mass * (arm @ arm)
            carrier = tree.links[carrier].parent
    return moments
