"""Tops: the fast heavy one of Bruels, Cardona and Arnold, and a body that flies and flips (Dzhanibekov)."""

import numpy as np

from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark, turn
from physics_prior.studies.problems.reference_values import HEAVY_TOP, TORQUE_FREE_TOP

FLIP_PERIOD = 13.242447962681
"""s, of a full cycle (two flips) of the free top; from Jacobi's elliptic functions."""


def heavy_top() -> Benchmark:
    """15 kg, 1 m from the fixed point along its own axis y, spun at 150 rad/s about it; its orientation every 0.1 s."""
    body = MassProperties(15.0, np.array([0.0, 1.0, 0.0]), np.diag([0.234375, 0.46875, 0.234375]))
    tree = Tree([Part("top", body)], [Joint("pivot", JointKind.SPHERICAL, "world", "top")])
    return Benchmark(
        tree,
        (Gravity(acceleration=(0.0, 0.0, -9.81)),),
        tree.neutral(),
        np.array([0.0, 150.0, -4.61538]),
        observe=lambda run: run.q,
        times=HEAVY_TOP[:, 0],
        values=HEAVY_TOP[:, 1:],
        distance=turn,
    )


def free_top() -> Benchmark:
    """Moments 1, 2 and 3 kg m^2, nothing acts: spun at 5 rad/s about the middle axis, it flips; orientation every 5 s.

    It passes the saddle so close that it amplifies errors of the start by 1e9 in 50 s.
    """
    body = MassProperties(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
    tree = Tree([Part("top", body)], [Joint("flight", JointKind.FREE, "world", "top")])
    return Benchmark(
        tree,
        (),
        tree.neutral(),
        np.array([0.0, 0.0, 0.0, 1e-3, 5.0, 1e-3]),
        observe=lambda run: run.q[3:],
        times=TORQUE_FREE_TOP[:, 0],
        values=TORQUE_FREE_TOP[:, 1:],
        distance=turn,
    )
