"""Integrators of the smooth motion, one file each, with the two kernels that a step takes from it.

``smooth_step(memory, q, v, extra, h)`` makes one step of h seconds, constraints projected after it, and returns their
rank; ``linearise_smooth(memory, tangent, q, v, extra, h, force_noise, F, G)`` fills the step's derivatives beside. Both
move the time on by h, and set it to that of each stage while they evaluate there.
"""

from dataclasses import dataclass
from typing import Literal, get_args

IntegratorName = Literal["semi_implicit_euler", "rk4"]


@dataclass(frozen=True)
class Integrator:
    """What a scene's memory needs for an integrator, and the order of its error over a given time.

    Attributes:
        order: p, the error falls with the p-th power of the step.
        stages: matrices (nv, 2 nv) that ``linearise_smooth`` needs beside the derivatives.
        vectors: vectors (nv,) of scratch beyond those of every step.
        implicit: whether ``smooth_step`` needs derivatives, and the same matrices, too.
    """

    order: int
    stages: int
    vectors: int = 0
    implicit: bool = False


INTEGRATORS: dict[IntegratorName, Integrator] = {
    "semi_implicit_euler": Integrator(order=1, stages=3),
    "rk4": Integrator(order=4, stages=7),
}
DEFAULT: IntegratorName = "rk4"

assert tuple(INTEGRATORS) == get_args(IntegratorName)
