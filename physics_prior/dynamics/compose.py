"""Compose the step of a scene: its equation of motion with just the effects that it names, its integrator, the step.

Files of this folder, motion.py, those of one integrator and step.py, become one module, in which each finds what it
imports from those before it. The module is a small readable file in the kernel cache (``physics-prior check
--show-step`` prints it). One line an effect; the effects inline into it, the disk cache hits on the next start, and an
edit of an effect misses it as it must, because the module's name is a digest of its text in a folder keyed by all kernel
sources.
"""

import ast
import hashlib
import importlib.util
import math
import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numba
import numpy as np
from numba.core.errors import NumbaError

from physics_prior.dynamics.blocked import FEW
from physics_prior.dynamics.derivatives import COMPOSITE, FREEDOM
from physics_prior.dynamics.integrators import INTEGRATORS, IntegratorName
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.kernel_cache import cache_directory, sources_digest
from physics_prior.dynamics.records import FREE_LINK, LINK, WORK
from physics_prior.dynamics.types import Array
from physics_prior.effects.effect import Effect
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Tree

ROOM = "physics_prior.dynamics"
GRAVITY = 3  # numbers at the head of the parameters
FUNCTIONS = {
    "apply": ("forces", "links, work, q, v, tau", "{}"),
    "differentiate": ("differentiate_forces", "links, work, freedoms, composites, q, v, tau_q, tau_v", "{}"),
    "energy": ("potential_energy", "links, work, q", "total += {}"),
}
"""By function of a CompiledForce: the function of the step that calls it, the arguments of both, and the line of a call."""

NUMBERS, MATRIX = numba.types.float64[::1], numba.types.float64[:, :]
RECORDS = {"work": WORK, "freedoms": FREEDOM, "composites": COMPOSITE}
TYPES = {name: numba.from_dtype(dtype)[::1] for name, dtype in RECORDS.items()} | {"tau_q": MATRIX, "tau_v": MATRIX}


def pack_parameters(tree: Tree, effects: Sequence[Effect]) -> np.ndarray:
    """The numbers of a scene's step: gravity (3,), where each force effect's own begin (and the end), they, and which act."""
    numbers = [effect.parameters(tree) for effect in effects if effect.compiled is not None]
    starts = GRAVITY + len(numbers) + 1 + np.cumsum([0, *(len(own) for own in numbers)])
    packed = np.concatenate([np.zeros(GRAVITY), starts, *numbers, np.zeros(len(numbers))])
    set_acting(packed, effects, [True] * len(effects))
    return packed


def set_acting(parameters: np.ndarray, effects: Sequence[Effect], acting: Sequence[bool]) -> None:
    """Write into the numbers of a scene's step which of its effects act."""
    fields = [effect.field() for effect, on in zip(effects, acting, strict=True) if on]
    parameters[:GRAVITY] = np.sum([np.zeros(GRAVITY), *fields], axis=0)
    flags = [on for effect, on in zip(effects, acting, strict=True) if effect.compiled is not None]
    end = int(parameters[GRAVITY + len(flags)])
    parameters[end : end + len(flags)] = flags


@inline_kernel
def acts(parameters: Array, count: int, index: int) -> bool:
    """Whether the index-th of count force effects acts now."""
    return bool(parameters[int(parameters[GRAVITY + count]) + index] > 0.0)


@inline_kernel
def section(parameters: Array, index: int) -> Array:
    """The numbers of the index-th force effect."""
    return parameters[int(parameters[GRAVITY + index]) : int(parameters[GRAVITY + index + 1])]


class Structure(NamedTuple):
    """What a scene calls for beside effects that push.

    Attributes:
        constrained: equality rows.
        touching: inequality rows.
        free: no joints, as all parts are free bodies, which do not touch either.
        many: so many errors of the state that reflections in blocks are sooner; others do without what that takes to compile.
    """

    constrained: bool = False
    touching: bool = False
    free: bool = False
    many: bool = False


def structure_of(tree: Tree, effects: Sequence[Effect]) -> Structure:
    """The structure of a scene's step."""
    ranges = [each for effect in effects for each in effect.joint_ranges(tree)]
    limited = any(math.isfinite(each.lower) or math.isfinite(each.upper) for each in ranges)
    touching = limited or any(effect.touching_pairs(tree) for effect in effects)
    free = not touching and all(link.joint.kind is JointKind.FREE for link in tree.links)
    return Structure(any(effect.point_pairs(tree) for effect in effects), touching, free, 2 * tree.nv > FEW)


def step_source(
    effects: Sequence[Effect], structure: Structure, integrator: IntegratorName, sleeping: bool = False
) -> str:
    """The text of a scene's step module, with sleep or not."""
    files = [f"integrators.{file}" for file in INTEGRATORS[integrator].files]
    events = [*(["contact.events"] if structure.touching else []), *(["contact.sleep"] if sleeping else [])]
    texts = {name: _text(name) for name in ("motion", *files, *events, "step")}
    compiled = [effect.compiled for effect in effects if effect.compiled is not None]
    timed = [effect.comes_and_goes for effect in effects if effect.compiled is not None]
    imports = [f"from physics_prior.dynamics.compose import {'acts, ' * any(timed)}section"]
    names: dict[str, str] = {}
    lines: dict[str, list[str]] = {each: [] for each in FUNCTIONS}
    for index, force in enumerate(compiled):
        for each, (_, arguments, line) in FUNCTIONS.items():
            if getattr(force, each) is None:
                continue
            function = getattr(force, each).py_func
            # a user's effect stands outside the folders that key the cache: its own digest makes an edit miss
            digest = sources_digest(Path(function.__code__.co_filename))
            source_of = f"from {function.__module__} import {function.__name__}"
            if source_of not in names:
                taken = sum(other.endswith(f" import {function.__name__}") for other in names)
                names[source_of] = f"{function.__name__}_{taken}" if taken else function.__name__
                renamed = f" as {names[source_of]}" if taken else ""
                imports.append(f"{source_of}{renamed}  # {digest}")
            call = line.format(f"{names[source_of]}(section(parameters, {index}), {arguments})")
            lines[each].append(f"if acts(parameters, {len(compiled)}, {index}): {call}" if timed[index] else call)
    if compiled:
        lines["energy"] = ["total = 0.0", *lines["energy"], "return total"]
        heads = [f"@kernel\ndef {name}(parameters, {arguments}):\n    " for name, arguments, _ in FUNCTIONS.values()]
        bodies = ["\n    ".join(own) for own in lines.values()]
        parts = ["\n".join(imports), *(head + body for head, body in zip(heads, bodies, strict=True))]
        texts["motion"] = _replace(texts["motion"], "effects", "\n\n\n".join(parts) + "\n")
    texts["motion"] = _replace(texts["motion"], "constraints", f"CONSTRAINED = {structure.constrained}")
    texts["motion"] = _replace(texts["motion"], "gyroscopic torques", f"MIDDLE = {INTEGRATORS[integrator].middle}")
    if structure.free:
        line = "from physics_prior.dynamics.memory import free_sections as sections"
        texts["motion"] = _replace(texts["motion"], "links", line)
    if structure.many:
        line = "from physics_prior.dynamics.blocked import triangularise_in_blocks as triangularise"
        texts["step"] = _replace(texts["step"], "errors", line)
    if structure.touching:
        step = "sleeping_step" if sleeping else "event_step"
        texts["step"] = _replace(texts["step"], "events", f"move, linearise = {step}, linearise_events")
    return "\n\n".join(texts.values())


def step_module(
    effects: Sequence[Effect], structure: Structure, integrator: IntegratorName, sleeping: bool = False
) -> ModuleType:
    """The step module of a scene, written to the kernel cache where it is not there yet, and imported.

    Raises:
        ModelError: a kernel of a user's effect does not compile.
    """
    text = step_source(effects, structure, integrator, sleeping)
    name = "step_" + hashlib.sha256(text.encode()).hexdigest()[:16]
    if name in sys.modules:
        return sys.modules[name]
    for effect in effects:
        if effect.compiled is not None and not type(effect).__module__.startswith("physics_prior."):
            _compile_alone(effect, FREE_LINK if structure.free else LINK)
    path = cache_directory() / f"{name}.py"
    if not path.exists():
        # written aside and moved in place, so that another process never reads half a file
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_suffix(f".{os.getpid()}")
        aside.write_text(text)
        aside.replace(path)
    return import_step(path)


def import_step(path: Path) -> ModuleType:
    """The step module of a file in the kernel cache."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _compile_alone(effect: Effect, links: np.dtype) -> None:
    """Compile a user's kernels by themselves: inside the step, Numba's complaint would be about the step."""
    kinds = TYPES | {"links": numba.from_dtype(links)[::1]}
    for each, (_, arguments, _) in FUNCTIONS.items():
        function = getattr(effect.compiled, each)
        if function is None:
            continue
        signature = tuple(kinds.get(name, NUMBERS) for name in ("parameters", *arguments.split(", ")))
        try:
            function.compile(signature)
        except NumbaError as problem:
            lines = [line.strip() for line in str(problem).splitlines()]
            cause = next(line for line in lines if line and not line.startswith("Failed in"))
            code = function.py_func.__code__
            raise ModelError(
                f"effect '{effect.kind}': its '{each}' ({code.co_filename}:{code.co_firstlineno}) does not compile: {cause}"
            ) from problem


@cache
def _text(name: str) -> str:
    """The text of a part of the step, without what it imports from the parts before it: there it stands already."""
    source = Path(__file__).parent.joinpath(*name.split(".")).with_suffix(".py").read_text()
    lines = source.splitlines()
    parts = (f"{ROOM}.motion", f"{ROOM}.integrators.", f"{ROOM}.contact.events")
    for node in reversed(ast.parse(source).body):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(parts):
            del lines[node.lineno - 1 : node.end_lineno]
    return "\n".join(lines) + "\n"


def _replace(source: str, mark: str, by: str) -> str:
    """Replace the one line that ends in ``# scene: mark``."""
    lines = source.splitlines()
    (index,) = [i for i, line in enumerate(lines) if line.endswith(f"# scene: {mark}")]
    lines[index] = by
    return "\n".join(lines) + "\n"
