"""Compile the derivatives of a step in another process, beside its motion: two cores take less time than one.

``python -m physics_prior.dynamics.beside FILE`` compiles those of a step module. Both processes look into the cache on disk
before they compile a kernel, so that each finds what the other has done; which of them did it makes no difference.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba import types

from physics_prior.dynamics.compose import import_step
from physics_prior.dynamics.covariance import carry_factor
from physics_prior.dynamics.entry import MATRIX, NUMBERS, Step
from physics_prior.dynamics.kernel_cache import is_kept


@contextmanager
def derivatives_beside(step: Step) -> Iterator[None]:
    """Have another process compile a step's derivatives while the block compiles the rest; it ends with the block.

    Not so where there is but one core, or where ``carry`` is in the cache already. If it fails, the block compiles them itself.
    """
    if (os.cpu_count() or 1) < 2 or is_kept(step.module.carry):
        yield
        return
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", __name__, str(step.module.__file__)]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, env=environment, stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def compile_derivatives(path: Path) -> None:
    """Compile for other kernels what ``carry`` of a step takes and ``advance`` does not."""
    step = import_step(path)
    signatures: dict[Any, tuple[types.Type, ...]] = {
        step.differentiate: (NUMBERS, NUMBERS, NUMBERS, NUMBERS, types.float64),
        step.spread_noise: (NUMBERS, NUMBERS, MATRIX, types.float64, MATRIX),
        carry_factor: (MATRIX, MATRIX, MATRIX, MATRIX),
        step.triangularise: (MATRIX, types.intp, NUMBERS),
    }
    for kernel, signature in signatures.items():
        kernel.inner.compile(signature)


if __name__ == "__main__":
    compile_derivatives(Path(sys.argv[1]))
