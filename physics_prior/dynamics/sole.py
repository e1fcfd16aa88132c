"""A sole on its link, as a record that kernels read, and where it is."""

from typing import TYPE_CHECKING

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.algebra import get3, get9, plus, product, times
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Matrix, Record, Records, Vector
from physics_prior.model import Tree

if TYPE_CHECKING:
    from physics_prior.effects.unknown_force import Sole

SOLE = np.dtype(
    [
        ("link", "i8"),  # that carries it
        ("center", "f8", 3),  # its middle in the link's frame, m
        ("axes", "f8", 9),  # rotation matrix, its axes to the link's
        ("half", "f8", 2),  # half its edges along its x and y, m
        ("friction", "f8"),
        ("height", "f8"),  # of the ground, m
        ("velocity", "f8", 3),  # of the ground, m/s
        ("force", "i8"),  # first of its six numbers among the unknown forces
    ],
    align=True,
)


def sole_record(tree: Tree, sole: "Sole", force: int) -> np.ndarray:
    """(1,) SOLE: a sole whose wrench begins at so many unknown forces."""
    frame = tree.frame(sole.part)
    R = rotations.matrix_from_quaternion(frame.orientation)
    out = np.zeros(1, SOLE)
    out["link"], out["center"], out["axes"] = frame.link, frame.position + R @ sole.center, R.reshape(-1)
    out["half"], out["friction"], out["force"] = sole.half, sole.friction, force
    out["height"], out["velocity"] = sole.height, sole.velocity
    return out


@inline_kernel
def sole_pose(work: Records, sole: Record) -> tuple[Vector, Matrix]:
    """The sole's middle, m, and its axes, sole to world; needs ``pose``."""
    if sole.link < 0:
        return get3(sole.center), get9(sole.axes)
    here = work[sole.link]
    R = get9(here.rotation)
    return plus(get3(here.origin), times(R, get3(sole.center))), product(R, get9(sole.axes))


@inline_kernel
def corner_arm(sole: Record, R: Matrix, corner: int) -> Vector:
    """From the middle of a sole with axes R to its corner 0..3, world axes, m: along x the last two, along y the odd ones."""
    x = sole.half[0] if corner >= 2 else -sole.half[0]
    y = sole.half[1] if corner % 2 == 1 else -sole.half[1]
    return times(R, (x, y, 0.0))
