"""The centre of mass of all that moves."""

import numpy as np

from physics_prior.dynamics.kinematics import point_jacobian
from physics_prior.dynamics.simulator import Simulator


def center_of_mass(simulator: Simulator) -> np.ndarray:
    """(3,) m, world axes; needs ``move``."""
    links, work = simulator.memory.links, simulator.memory.work
    center: np.ndarray = links["mass"] @ (work["origin"] + work["center"]) / np.sum(links["mass"])
    return center


def center_of_mass_jacobian(simulator: Simulator) -> np.ndarray:
    """(3, nv): its velocity, world axes, per v; needs ``move``."""
    links, work = simulator.memory.links, simulator.memory.work
    own, total = np.empty((6, simulator.nv)), np.zeros((3, simulator.nv))
    for index, (mass, center) in enumerate(zip(links["mass"].tolist(), links["center"], strict=True)):
        if mass > 0.0:
            point_jacobian(links, work, index, center, own)
            total += mass * own[3:]
    total /= np.sum(links["mass"])
    return total
