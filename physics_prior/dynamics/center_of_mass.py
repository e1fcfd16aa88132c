"""The centre of mass of all that moves."""

import numpy as np

from physics_prior.dynamics.simulator import Simulator


def center_of_mass(simulator: Simulator) -> np.ndarray:
    """(3,) m, world axes; needs ``move``."""
    total, moment = 0.0, np.zeros(3)
    for link in simulator.tree.links:
        body = link.mass_properties
        origin, R = simulator.pose(link.part)
        total += body.mass
        moment += body.mass * (origin + R @ body.center_of_mass)
    return moment / total


def center_of_mass_jacobian(simulator: Simulator) -> np.ndarray:
    """(3, nv): its velocity, world axes, per v; needs ``move``."""
    total, momentum = 0.0, np.zeros((3, simulator.nv))
    for link in simulator.tree.links:
        body = link.mass_properties
        total += body.mass
        momentum += body.mass * simulator.jacobian(link.part, body.center_of_mass)[3:]
    return momentum / total
