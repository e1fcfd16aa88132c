"""What an effect costs scenes that do not name it: nothing, shown by builds of the program in which it does not exist.

For each built-in effect the package is copied without it, and two scenes, less the effect where they name it, are compiled and
moved by both builds from cold caches: the bits of the motion, the instructions of the compiled step, and what was compiled.
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
from physics_prior.studies.effects.variant import SceneText

PACKAGE = Path(__file__).resolve().parents[1]
ROWS = {"physics_prior.dynamics.contact": ("joint_ranges", "touching_pairs")}
"""Kernels that effects with inequality rows need, and the methods that give such rows."""


def scenes() -> dict[str, SceneText]:
    """A body in flight, that nothing acts on, and two rods that swing, with damping and by another integrator."""
    swing = SceneText.read("double_pendulum")
    damping = {"joint_damping": {"coefficients": {"shoulder": "0.1 N m s/rad", "elbow": "0.05 N m s/rad"}}}
    step = {"step": {"integrator": "implicit_midpoint"}}
    return {
        "free_body": SceneText.read("free_body"),
        "double_pendulum": SceneText(swing.path, dict(swing.data) | step).added(damping),
    }


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
        builds = Path(folder)
        whole = _build(builds / "whole")
        known: dict[str, dict[str, Any]] = {}
        for done, kind in enumerate(kinds):
            progress(done / len(kinds), f"without {kind}")
            effect = REGISTRY[kind]
            build, cases = _build(builds / kind, effect), []
            for name, text in scenes().items():
                file = builds / f"{name}.yaml"
                named = kind in text.labels
                file.write_text(json.dumps((text.without(kind) if named else text).data), encoding="utf-8")
                own = f"{name} without {kind}" if named else name
                if own not in known:
                    known[own] = _answer(whole, file)
                cases.append({"scene": name} | _compared(effect, known[own], _answer(build, file)))
            figures.append({"name": kind, "kernels": bool(_kernels(effect)), "cases": cases})
    progress(1.0, "done")
    return {"effects": figures}


def table(figures: dict[str, Any]) -> str:
    """The figures as a table of Markdown."""
    head = [
        "| a scene without | of its kernels compiled | "
        + " | ".join(f"`{name}`: same bits | instructions" for name in scenes())
        + " |",
        "|---" * (2 + 2 * len(scenes())) + "|",
    ]
    rows = []
    for each in figures["effects"]:
        compiled = sum(case["kernels_compiled"] for case in each["cases"])
        cells = [f"`{each['name']}`", str(compiled) if each["kernels"] else "none of its own"]
        for case in each["cases"]:
            same = "the same" if case["same_code"] else "NOT THE SAME"
            cells += [_word(case["same_bits"]), f"{case['instructions']}, {same}, {case['instructions_more']:+d}"]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join([*head, *rows])


def _word(yes: bool) -> str:
    return "yes" if yes else "NO"


def _kernels(effect: type[Effect]) -> tuple[str, ...]:
    """Modules of the kernels that are there for an effect; none where it has none of its own."""
    rows = [
        room for room, methods in ROWS.items() if any(getattr(effect, m) is not getattr(Effect, m) for m in methods)
    ]
    return (effect.__module__, *rows) if effect.compiled is not None or rows else ()


def _compared(effect: type[Effect], whole: dict[str, Any], without: dict[str, Any]) -> dict[str, Any]:
    own = _kernels(effect)
    return {
        "same_bits": whole["bits"] == without["bits"],
        "same_code": (whole["text"], whole["code"]) == (without["text"], without["code"]),
        "instructions": whole["instructions"],
        "instructions_more": whole["instructions"] - without["instructions"],
        "kernels_compiled": sum(module.startswith(own) for module in whole["modules"]) if own else 0,
    }


def _build(folder: Path, without: type[Effect] | None = None) -> Path:
    """A copy of the program in a folder, whole or without an effect."""
    copy = folder / PACKAGE.name
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    if without is not None:
        remove(copy / "effects", without)
    return folder


def _answer(build: Path, scene: Path) -> dict[str, Any]:
    """What the probe of a build answers of a scene, from a cold cache."""
    with tempfile.TemporaryDirectory(dir=build) as cache:
        environment = os.environ | {"PYTHONPATH": str(build), "PHYSICS_PRIOR_CACHE": cache}
        command = [sys.executable, "-m", "physics_prior.studies.effect_probe", str(scene)]
        told = subprocess.run(command, cwd=build, env=environment, capture_output=True, text=True, check=False)
    if told.returncode:
        raise PhysicsPriorError(f"the build in {build.name} does not run: {told.stderr.strip().splitlines()[-1]}")
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
