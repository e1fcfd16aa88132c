"""Integrators of the smooth motion, one file each, with the two kernels that a step takes from it.

``smooth_step(memory, q, v, extra, h)`` makes one step of h seconds, constraints projected after it, and returns their
rank; ``linearise_smooth(memory, tangent, q, v, extra, h, force_noise, F, G)`` fills the step's derivatives beside. Both
move the time on by h, and set it to that of each stage while they evaluate there.
"""

from dataclasses import dataclass
from typing import Literal, get_args

IntegratorName = Literal["semi_implicit_euler", "rk4", "implicit_midpoint", "lobatto_iiic", "dop853"]


@dataclass(frozen=True)
class Integrator:
    """What a scene's memory needs for an integrator, and the order of its error over a given time.

    Attributes:
        files: whose texts make it, in this folder; each takes what it needs from those before it.
        order: p, the error falls with the p-th power of the step.
        stages: matrices (nv, 2 nv) that ``linearise_smooth`` needs beside the derivatives.
        vectors: vectors (nv,) of scratch beyond those of every step.
        implicit: whether ``smooth_step`` needs derivatives, and the same matrices, too.
        middle: whether it takes gyroscopic torques at the middle of its steps.
        adaptive: whether it chooses its own steps, within the scene's, by a tolerance.
    """

    files: tuple[str, ...]
    order: int
    stages: int
    vectors: int = 0
    implicit: bool = False
    middle: bool = False
    adaptive: bool = False


INTEGRATORS: dict[IntegratorName, Integrator] = {
    "semi_implicit_euler": Integrator(("semi_implicit_euler",), order=1, stages=3, middle=True),
    "rk4": Integrator(("rk4",), order=4, stages=7),
    "implicit_midpoint": Integrator(
        ("implicit_midpoint", "implicit_runge_kutta", "parts"), order=2, stages=11, vectors=7, implicit=True
    ),
    "lobatto_iiic": Integrator(
        ("lobatto_iiic", "implicit_runge_kutta", "parts"), order=2, stages=11, vectors=11, implicit=True
    ),
    "dop853": Integrator(("dop853", "parts"), order=8, stages=33, vectors=27, adaptive=True),
}
DEFAULT: IntegratorName = "rk4"
TOLERATED = (
    1e-9  # m and rad, m/s and rad/s: the error that an adaptive integrator allows a step, if the scene names none
)

assert tuple(INTEGRATORS) == get_args(IntegratorName)
