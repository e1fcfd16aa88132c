"""The terminal: results on stdout, progress on stderr and only where a person looks at it."""

import json
import os
import secrets
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from physics_prior.errors import PhysicsPriorError

STDOUT = "-"
FILE_WIDTH = 120


def console(file_width: int = FILE_WIDTH) -> Console:
    """Where results go; a file or pipe has no width, so that it gets one that tables fit in."""
    width = None if sys.stdout.isatty() else file_width
    return Console(file=sys.stdout, highlight=False, markup=False, width=width)


@contextmanager
def progress(what: str) -> Iterator[Callable[..., None]]:
    """A progress bar; tell it the fraction that is done and, where that changes, what comes next."""
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    )
    with bar:
        task = bar.add_task(what, total=1.0)
        yield lambda fraction, now=what: bar.update(task, completed=fraction, description=now)


@contextmanager
def status(what: str) -> Iterator[None]:
    """Say what takes its time, while it does."""
    if not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(what):
        yield


def table(title: str, *columns: str, numbers: int = 0) -> Table:
    """An empty table; its last ``numbers`` columns are aligned to the right."""
    out = Table(
        title=title,
        title_justify="left",
        title_style="bold",
        box=None,
        pad_edge=False,
        padding=(0, 3, 0, 0),
        show_header=any(columns),
    )
    for index, column in enumerate(columns):
        out.add_column(column, justify="right" if index >= len(columns) - numbers else "left", header_style="dim")
    return out


def require_folder(option: str, target: str | None) -> None:
    """Refuse, before any work, a file that could not be written at the end of it."""
    if target is None or target == STDOUT:
        return
    folder = Path(target).absolute().parent
    if not folder.is_dir():
        raise PhysicsPriorError(f"{option} {target}: folder {folder} does not exist")
    if Path(target).is_dir():
        raise PhysicsPriorError(f"{option} {target}: that is a folder; give a file")
    if not os.access(folder, os.W_OK):
        raise PhysicsPriorError(f"{option} {target}: folder {folder} is not writable")


def require_plot_folder(path: Path, option: str = "--plot") -> None:
    """Make the folder for pictures, or refuse before any work."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PhysicsPriorError(f"{option} {path}: {error.strerror}; give a folder") from None
    if not os.access(path, os.W_OK):
        raise PhysicsPriorError(f"{option} {path}: folder is not writable")


def write_json(target: str, data: Mapping[str, Any]) -> None:
    """Write JSON to a file, whole or not at all, or to stdout."""
    text = json.dumps(data, indent=2, allow_nan=False) + "\n"
    if target == STDOUT:
        sys.stdout.write(text)
        return
    with whole_file(Path(target)) as partial:
        partial.write_text(text, encoding="utf-8")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write to, which takes its place if nothing goes wrong."""
    partial = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        raise PhysicsPriorError(f"{path} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
