"""How kernels are compiled and cached: Numba, on disk, keyed by a digest of everything that goes into them."""

import gc
import hashlib
import os
import platform
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba.core import event

from physics_prior.dynamics.kernel_compiler import Kernel

FASTMATH = {"nsz"}
"""No flag that lets rounding depend on where a kernel was inlined: the same recording gives the same bits. NaN stays visible."""

Function = TypeVar("Function", bound=Callable[..., Any])

MOST_SOURCES = 500  # files of a user's package that are read for its digest
_CALLBACKS: list[Any] = []  # what must not be collected
_KERNEL_ROOMS = ("dynamics", "effects", "estimation")


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


@cache
def cache_directory() -> Path:
    """Where compiled kernels of exactly these sources and versions live.

    Numba does not notice an edit in another module that was inlined, so a stale cache would be silently wrong: the
    folder's name is a digest of all sources that hold kernels, the versions of the compilers and the machine. The
    environment variable PHYSICS_PRIOR_CACHE names another place.
    """
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parents[1]
    for room in _KERNEL_ROOMS:
        for source in sorted((package / room).rglob("*.py")):
            text = source.read_bytes()
            if b"kernel" in text:
                digest.update(text)
    for version in (numba.__version__, llvmlite.__version__, np.__version__, platform.python_version()):
        digest.update(version.encode())
    digest.update(f"{numba.config.CPU_NAME} {platform.machine()} {platform.processor()}".encode())
    home = os.environ.get("PHYSICS_PRIOR_CACHE") or str(
        Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "physics_prior"
    )
    return Path(home) / digest.hexdigest()[:16]


def sources_digest(file: Path) -> str:
    """A digest of a file with kernels and, of a user's, of all of the package that it is in: kernels call others there."""
    folder = _users_package(file)
    digest = hashlib.sha256()
    for source in [file] if folder is None else sorted(folder.rglob("*.py"))[:MOST_SOURCES]:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _users_package(file: Path) -> Path | None:
    """The folder of the package that a file is in; None where it is in none, or in this one, which keys the cache already."""
    top = file.resolve().parent
    while (top.parent / "__init__.py").is_file():
        top = top.parent
    own = Path(__file__).resolve().parents[1]
    return top if (top / "__init__.py").is_file() and top != own else None


def kernel(function: Function) -> Function:
    """Compile a function of the step: no Python in it, cached on disk, IEEE division, NaN visible."""
    return _compile(function, inline=False)


def inline_kernel(function: Function) -> Function:
    """Compile a small helper (3-vector algebra) that the optimiser is told to inline."""
    return _compile(function, inline=True)


@cache
def callback(function: Callable[..., Any], signature: Any) -> int:
    """Compile a function for calls through its address, and return that; it stays valid while the program runs."""
    compiled = _in_cache(
        lambda: numba.cfunc(signature, cache=True, error_model="numpy", fastmath=FASTMATH)(function), cache_directory()
    )
    _CALLBACKS.append(compiled)
    return int(compiled.address)


def _compile(function: Function, inline: bool) -> Function:
    options = {"error_model": "numpy", "fastmath": FASTMATH, "forceinline": inline, "boundscheck": False}
    file, folder = Path(function.__code__.co_filename), cache_directory()
    if _users_package(file) is not None:
        folder /= sources_digest(file)
    return cast(Function, _in_cache(lambda: Kernel(function, options), folder))


def _in_cache(decorate: Callable[[], Any], folder: Path) -> Any:
    # Numba reads its cache directory when it decorates: set it for our functions only
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return decorate()
    finally:
        numba.config.CACHE_DIR = before
