"""What makes a function a kernel: compiled by Numba, kept on disk."""

import gc
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import event

from physics_prior.dynamics.kernel_cache import cache_directory, within
from physics_prior.dynamics.kernel_compiler import CONSTANT_FIELDS, Kernel

FASTMATH = {"nsz"}
"""No flag that lets rounding depend on where a kernel was inlined: the same recording gives the same bits. NaN stays visible."""

Function = TypeVar("Function", bound=Callable[..., Any])

_CALLBACKS: list[Any] = []  # what must not be collected


class _Undisturbed(event.Listener):  # type: ignore[misc]
    """Keeps the garbage collector out of a compilation, whose millions of objects live to its end: an eighth of its time."""

    def __init__(self) -> None:
        self._depth, self._collected = 0, False

    def on_start(self, event: Any) -> None:
        if self._depth == 0:
            self._collected = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0 and self._collected:
            gc.enable()


event.register("numba:compile", _Undisturbed())


def kernel(function: Function) -> Function:
    """Compile a function of the step: no Python in it, cached on disk, IEEE division, NaN visible."""
    return _compile(function, inline=False)


def inline_kernel(function: Function) -> Function:
    """Compile a small helper (3-vector algebra) that the optimiser is told to inline."""
    return _compile(function, inline=True)


def constant_fields(dtype: np.dtype, values: dict[str, int]) -> None:
    """Have kernels take fields that records of a type lack as constants: what these rule out is not compiled."""
    CONSTANT_FIELDS[numba.from_dtype(dtype)] = values


@cache
def callback(function: Callable[..., Any], signature: Any) -> int:
    """Compile a function for calls through its address, and return that; it stays valid while the program runs."""
    decorate = numba.cfunc(signature, cache=True, error_model="numpy", fastmath=FASTMATH)
    compiled = within(cache_directory(), lambda: decorate(function))
    _CALLBACKS.append(compiled)
    return int(compiled.address)


def _compile(function: Function, inline: bool) -> Function:
    options = {"error_model": "numpy", "fastmath": FASTMATH, "forceinline": inline, "boundscheck": False}
    return cast(Function, Kernel(function, options))
