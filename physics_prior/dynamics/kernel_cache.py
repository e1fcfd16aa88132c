"""Where compiled kernels are kept: on disk, keyed by a digest of everything that goes into them."""

import hashlib
import os
import platform
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, UserProvidedCacheLocator

MOST_SOURCES = 500  # files of a user's package that are read for its digest
_PACKAGE = Path(__file__).resolve().parents[1]
_KERNEL_ROOMS = ("dynamics", "effects", "estimation")


@cache
def cache_directory() -> Path:
    """Where compiled kernels of exactly these sources and versions live.

    Numba does not notice an edit in another module that was inlined, so a stale cache would be silently wrong: the
    folder's name is a digest of all sources that hold kernels, the versions of the compilers and the machine. The
    environment variable PHYSICS_PRIOR_CACHE names another place.
    """
    digest = hashlib.sha256()
    for room in _KERNEL_ROOMS:
        for source in sorted((_PACKAGE / room).rglob("*.py")):
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
    return top if (top / "__init__.py").is_file() and top != _PACKAGE else None


def is_own(file: Path) -> bool:
    """Whether a file with kernels is of this package, or a step that was composed of it; else it is a user's."""
    return file.is_relative_to(_PACKAGE) or file.is_relative_to(cache_directory())


def is_kept(kernel: Any) -> bool:
    """Whether machine code of a kernel of a step module, for Python, is on disk."""
    return any(cache_directory().glob(f"*/{kernel.__module__}.{kernel.__name__}-*.nbc"))


def within(folder: Path, decorate: Callable[[], Any]) -> Any:
    """What a decorator of Numba's own returns, which reads where its cache is when it decorates."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return decorate()
    finally:
        numba.config.CACHE_DIR = before


class _Locator(UserProvidedCacheLocator):  # type: ignore[misc]
    """Where a kernel is kept. Those of this package by their place in it: a second checkout finds what the first compiled."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        folder, path = cache_directory(), Path(file)
        if path.is_relative_to(_PACKAGE):
            self._cache_path = str(folder / path.parent.relative_to(_PACKAGE))
            return
        if _users_package(path) is not None:
            folder /= sources_digest(path)
        self._cache_path = str(folder / self.get_suitable_cache_subpath(file))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_Locator":
        return cls(function, file)


class KernelCache(CompileResultCacheImpl):  # type: ignore[misc]
    """How Numba's cache finds a kernel's files."""

    _locator_classes = (_Locator,)
