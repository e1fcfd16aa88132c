"""A scene's step as Python calls it: machine code at once, as the types of its arguments are known beforehand.

Numba's dispatcher asks every argument of every call what it is, which takes as long as a sweep over the links. The machine code
asks nothing, and would misread another array than ``ENTRIES`` has: what users give is looked at before (``require_state``).
"""

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import types

from physics_prior.dynamics.views import FLOAT
from physics_prior.errors import SimulationError

if TYPE_CHECKING:
    from physics_prior.dynamics.simulator import Simulator

NUMBERS, MATRIX = types.float64[::1], types.float64[:, ::1]
STATE = NUMBERS, NUMBERS, NUMBERS  # q, v and extra forces
ENTRIES: dict[str, tuple[types.Type, ...]] = {
    "evaluate": (NUMBERS, *STATE, types.float64, NUMBERS),
    "advance": (NUMBERS, *STATE, types.float64, types.intp),
    "carry": (NUMBERS, NUMBERS, *STATE, types.float64, types.intp, MATRIX, MATRIX, MATRIX, types.boolean),
    "differentiate_acceleration": (NUMBERS, NUMBERS, *STATE),
}
"""The functions that are called again and again, with the types of their arguments."""


class Step:
    """The functions of a step module: those of ENTRIES compiled when they are first asked for, the others left to Numba.

    Attributes:
        module: the step module (compose.py).
    """

    def __init__(self, module: ModuleType) -> None:
        self.module = module

    def __getattr__(self, name: str) -> Any:
        function = getattr(self.module, name)
        if name in ENTRIES:
            function = function.compile(ENTRIES[name])
            setattr(self, name, function)  # found without this method from now on
        return function


def require_state(simulator: "Simulator", q: np.ndarray, v: np.ndarray, tau: np.ndarray | None) -> np.ndarray:
    """Return tau, zeros where it is None, if a step can take these: floats (nq,), (nv,), (nv,). Raise SimulationError if not."""
    nq, nv, tau = simulator.nq, simulator.nv, simulator.still if tau is None else tau
    if not (_fits(q, nq) and _fits(v, nv) and (tau is simulator.still or _fits(tau, nv))):
        given = ("q", q, nq), ("v", v, nv), ("tau", tau, nv)
        name, array, size = next(each for each in given if not _fits(*each[1:]))
        raise SimulationError(f"{name} is {_told(array, size)}")
    return tau


def _fits(array: np.ndarray, size: int) -> bool:
    """Whether machine code reads an array as so many floats."""
    return isinstance(array, np.ndarray) and array.dtype == FLOAT and array.shape == (size,) and array.flags.carray


def _told(array: Any, size: int) -> str:
    """What was given in place of an array of so many floats, and what is valid."""
    if isinstance(array, np.ndarray) and array.dtype == FLOAT and array.shape == (size,):
        return "read-only, or its numbers stand apart in memory: a copy of it is valid"
    shown = f"an array of shape {array.shape} and type {array.dtype}" if isinstance(array, np.ndarray) else ""
    return f"{shown or f'a {type(array).__name__}'}: a NumPy array of {size} floats (float64) is valid"
