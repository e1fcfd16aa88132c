"""A configuration as plain numbers, one a degree of freedom: turns in three dimensions as the angles of three hinges."""

import numpy as np

from physics_prior.model.ball_hinges import AXES, hinge_angles, rates_per_omega
from physics_prior.model.joint import JointKind
from physics_prior.model.tree import Tree

TURNING = (JointKind.FREE, JointKind.SPHERICAL)


def coordinate_names(tree: Tree) -> dict[str, tuple[str, ...]]:
    """Joint -> what its coordinates are called, in the order of its degrees of freedom: nothing where it has one alone."""
    letters = tuple(f"turn {letter}" for letter, _ in AXES)
    names = {JointKind.FREE: ("x", "y", "z", *letters), JointKind.SPHERICAL: letters}
    return {link.joint.name: names.get(link.joint.kind, ("",)) for link in tree.links}


def coordinates(tree: Tree, q: np.ndarray) -> np.ndarray:
    """(nv,) m or rad; turns of free and spherical joints are the hinges' about y, x and z (ball_hinges.py)."""
    out = np.zeros(tree.nv)
    for link in tree.links:
        own = q[link.q]
        out[link.v] = np.concatenate([own[:-4], hinge_angles(own[-4:])]) if link.joint.kind in TURNING else own
    return out


def coordinate_errors(tree: Tree, q: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """(nv, k) of the coordinates, from errors (nv, k) in the tangent of q."""
    out = errors.copy()
    for link in tree.links:
        if link.joint.kind in TURNING:
            turn = slice(link.v.stop - 3, link.v.stop)
            out[turn] = rates_per_omega(hinge_angles(q[link.q][-4:])) @ errors[turn]
    return out
