"""Bricard's mechanism, A04 of the IFToMM library: it moves although its rows, counted, hold it fast."""

from itertools import pairwise

import numpy as np

from physics_prior import inertia
from physics_prior.effects.attachment import Hinge
from physics_prior.effects.gravity import Gravity
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark
from physics_prior.studies.problems.reference_values import BRICARD

POINTS = np.array([[0.0, 0, 0], [1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, -1.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
"""m: the joints; five rods join them, the ground joins the last to the first."""
X, Y, Z = np.eye(3)
AXES = (Y, Z, X, Y, Z, X)
WIDTH = 0.1  # m, of the rods' square section


def bricard() -> Benchmark:
    """Five rods of 1 m and 1 kg on six hinges, gravity along -y, at rest; joint 3, x, y and z, at whole seconds.

    Five hinges make the tree and the sixth closes the loop: its five rows have rank 4, so that one freedom is left where
    counting leaves none.
    """
    parts, joints = [], []
    for i, (begin, end) in enumerate(pairwise(POINTS)):
        size = np.where(begin == end, WIDTH, 1.0)
        body = inertia.box(1.0, size).transformed(np.eye(3), 0.5 * (end - begin))
        position = begin - POINTS[i - 1] if i else begin
        parts.append(Part(f"rod{i}", body))
        joints.append(
            Joint(f"hinge{i}", JointKind.REVOLUTE, f"rod{i - 1}" if i else "world", f"rod{i}", position, axis=AXES[i])
        )
    last = tuple(POINTS[-1] - POINTS[-2])
    axis = tuple(AXES[-1])
    closed = Hinge(name="loop", part="rod4", point=last, at=tuple(POINTS[-1]), axis=axis, to_axis=axis)
    return Benchmark(
        Tree(parts, joints),
        (Gravity(acceleration=(0.0, -9.81, 0.0)), closed),
        np.zeros(5),
        np.zeros(5),
        observe=lambda run: run.point("rod2", POINTS[3] - POINTS[2]),
        times=BRICARD[:, 0],
        values=BRICARD[:, 1:],
    )
