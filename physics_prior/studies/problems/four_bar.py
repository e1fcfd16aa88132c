"""The N-four-bar mechanism, A02 of the IFToMM library: it passes singular configurations in which it could fold."""

import numpy as np
from scipy.special import ellipj, ellipk

from physics_prior.effects.attachment import Attachment
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark, Run
from physics_prior.studies.problems.pendulum import DOWN, G


def four_bar(loops: int, duration: float = 20.0) -> Benchmark:
    """2 N + 1 uniform rods of 1 m and 1 kg: N + 1 upright on pins at (k, 0), N across their tops; B0 starts at 1 m/s.

    A tree of N branches (upright, and the bar on top of it) and the last upright; N attachments close the loops. Where
    all rods lie in one line, twice a turn, the mobility rises from 1 to N + 1. Observed: B0, x and y, every 0.05 s.
    """
    bar = MassProperties(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0]) / 12.0)
    parts, joints = [], []
    for k in range(loops + 1):
        parts.append(Part(f"upright{k}", bar))
        joints.append(Joint(f"pin{k}", JointKind.REVOLUTE, "world", f"upright{k}", np.array([float(k), 0.0, 0.0])))
        if k < loops:
            parts.append(Part(f"bar{k}", bar))
            joints.append(Joint(f"top{k}", JointKind.REVOLUTE, f"upright{k}", f"bar{k}", np.array([1.0, 0.0, 0.0])))
    closed = [
        Attachment(name=f"loop{k}", part=f"bar{k}", point=(1.0, 0.0, 0.0), to=f"upright{k + 1}", at=(1.0, 0.0, 0.0))
        for k in range(loops)
    ]
    times = 0.05 * np.arange(1, round(duration / 0.05) + 1)
    return Benchmark(
        Tree(parts, joints),
        (DOWN, *closed),
        np.array([0.5 * np.pi, -0.5 * np.pi] * loops + [0.5 * np.pi]),
        np.array([-1.0, 1.0] * loops + [-1.0]),
        observe=first_top,
        times=times,
        values=first_top_at(loops, times),
    )


def first_top(run: Run) -> np.ndarray:
    """B0, the top of the first upright: x and y, m."""
    return run.point("upright0", (1.0, 0.0, 0.0))[:2]


def first_top_at(loops: int, times: np.ndarray) -> np.ndarray:
    """B0 (k, 2) m at times (k,) s, exactly: the uprights turn alike, a rotating pendulum.

    phi from upright: phi'' = c sin(phi), phi'(0) = 1, c = g ((N+1)/2 + N) / ((N+1)/3 + N). With w = phi/2 + pi/2 that is
    w'^2 = (1/4 + c) (1 - m sin^2 w), m = c / (1/4 + c): w is Jacobi's amplitude of t sqrt(1/4 + c) + K(m).
    """
    uprights = loops + 1
    c = G * (uprights / 2 + loops) / (uprights / 3 + loops)
    m = c / (0.25 + c)
    _, _, _, w = ellipj(np.sqrt(0.25 + c) * times + ellipk(m), m)
    phi = 2.0 * w - np.pi
    return np.stack([np.sin(phi), np.cos(phi)], axis=1)
