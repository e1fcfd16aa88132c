"""What an effect costs scenes that do not name it: nothing, shown by builds of the program in which it does not exist.

For each built-in effect the package is copied without it, and a body in flight is compiled and moved by both builds from cold
caches: the bits of the motion, the instructions of the compiled step, and what was compiled.
"""

import ast
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from physics_prior.effects import REGISTRY, Effect
from physics_prior.errors import PhysicsPriorError

PACKAGE = Path(__file__).resolve().parents[1]
ROWS = {"physics_prior.dynamics.contact": ("joint_ranges", "touching_pairs")}
"""Kernels that effects with inequality rows need, and the methods that give such rows."""


def run_effect_costs(
    kinds: Sequence[str] = tuple(REGISTRY), progress: Callable[[float, str], None] = lambda done, what: None
) -> dict[str, Any]:
    """Compare, for each of these built-in effects, this program with one without it: ``effects``, a list of figures by ``name``.

    progress is told the share that is done, and what comes next.

    Raises:
        PhysicsPriorError: a build does not run.
    """
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        progress(0.0, "the whole program")
        whole = _answer(Path(folder) / "whole")
        for done, kind in enumerate(kinds, start=1):
            progress(done / (1 + len(kinds)), f"without {kind}")
            figures.append(_compared(REGISTRY[kind], whole, _answer(Path(folder) / kind, REGISTRY[kind])))
    progress(1.0, "done")
    return {"effects": figures}


def table(figures: dict[str, Any]) -> str:
    """The figures as a table of Markdown."""
    head = [
        "| a scene without | same bits | same instructions | more of them | of its kernels compiled |",
        "|---|---|---|---|---|",
    ]
    rows = [
        f"| `{each['name']}` | {_word(each['same_bits'])} | {_word(each['same_code'])}, {each['instructions']}"
        f" | {each['instructions_more']} | {each['kernels_compiled'] if each['kernels'] else 'none of its own'} |"
        for each in figures["effects"]
    ]
    return "\n".join([*head, *rows])


def _word(yes: bool) -> str:
    return "yes" if yes else "NO"


def _compared(effect: type[Effect], whole: dict[str, Any], without: dict[str, Any]) -> dict[str, Any]:
    own = [effect.__module__]
    own += [
        room for room, methods in ROWS.items() if any(getattr(effect, m) is not getattr(Effect, m) for m in methods)
    ]
    return {
        "name": effect.kind,
        "same_bits": whole["bits"] == without["bits"],
        "same_code": (whole["text"], whole["code"]) == (without["text"], without["code"]),
        "instructions": whole["instructions"],
        "instructions_more": whole["instructions"] - without["instructions"],
        "kernels": effect.compiled is not None or len(own) > 1,
        "kernels_compiled": sum(module.startswith(tuple(own)) for module in whole["modules"]),
    }


def _answer(folder: Path, without: type[Effect] | None = None) -> dict[str, Any]:
    """What the probe of a copy of the program answers, whole or without an effect, from a cold cache."""
    copy = folder / PACKAGE.name
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    if without is not None:
        remove(copy / "effects", without)
    environment = os.environ | {"PYTHONPATH": str(folder), "PHYSICS_PRIOR_CACHE": str(folder / "cache")}
    command = [sys.executable, "-m", "physics_prior.studies.effect_probe"]
    told = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if told.returncode:
        missing = f"without {without.kind} " if without else ""
        raise PhysicsPriorError(f"the build {missing}does not run: {told.stderr.strip().splitlines()[-1]}")
    answer: dict[str, Any] = json.loads(told.stdout)
    return answer


def remove(effects: Path, effect: type[Effect]) -> None:
    """Take an effect out of a copy of the folder: from the registry, its class, and its file where it has it for itself."""
    name, file = effect.__name__, effects / f"{effect.__module__.rpartition('.')[2]}.py"
    if sum(other.__module__ == effect.__module__ for other in REGISTRY.values()) == 1:
        file.unlink()
    else:
        _cut(file, lambda node: isinstance(node, ast.ClassDef) and node.name == name)
    registry = effects / "__init__.py"
    text = registry.read_text(encoding="utf-8").replace(f"    {name},\n", "")
    text = text.replace(f"from {effect.__module__} import {name}\n", "")
    registry.write_text(text.replace(f" {name},", "").replace(f", {name}\n", "\n"), encoding="utf-8")


def _cut(file: Path, unwanted: Callable[[ast.stmt], bool]) -> None:
    """Cut the top-level statements out of a file that are unwanted."""
    source = file.read_text(encoding="utf-8")
    lines = source.splitlines(keepends=True)
    for node in reversed(ast.parse(source).body):
        if unwanted(node):
            del lines[node.lineno - 1 : node.end_lineno]
    file.write_text("".join(lines), encoding="utf-8")
