"""One build, asked from outside: how a scene moves in it, by which machine code, and what it compiled for that.

``python -m physics_prior.studies.effect_probe SCENE`` prints JSON. It names no effect, so that it runs in a build without any of
them (effect_costs.py).
"""

import hashlib
import json
import re
import sys
from typing import Any

from numba.core import event

from physics_prior.dynamics.compose import step_source, structure_of
from physics_prior.scene import Scene, load_scene

STEPS = 1000


class Compiled(event.Listener):  # type: ignore[misc]
    """Which modules' functions were compiled."""

    def __init__(self) -> None:
        self.modules: list[str] = []

    def on_start(self, event: Any) -> None:
        self.modules.append(event.data["dispatcher"].py_func.__module__)

    def on_end(self, event: Any) -> None:
        """Nothing more is to be known."""


def digest(data: bytes) -> str:
    """A short digest."""
    return hashlib.sha256(data).hexdigest()[:16]


def instructions(assembly: str) -> list[str]:
    """The instructions of assembly, without directives and the numbers that Numba gives functions and types as it meets them."""
    lines = re.sub(r"B\d+v\d+|(?<=RecordILi)\d+", "", assembly).splitlines()
    return [line.strip() for line in lines if re.match(r"\s+[a-z]", line)]


def answer(scene: Scene) -> dict[str, Any]:
    """What STEPS steps from a scene's start come to, and what they took."""
    compiled = Compiled()
    q, v = scene.initial.q.copy(), scene.initial.v.copy()
    with event.install_listener("numba:compile", compiled):
        simulator = scene.simulator()
        simulator.begin(q, v)
        simulator.advance(q, v, scene.step.size, STEPS)
    (assembly,) = simulator.step.module.advance.inspect_asm().values()
    code = instructions(assembly)
    text = step_source(scene.effects, structure_of(scene.tree, scene.effects), scene.step.integrator)
    return {
        "bits": digest(q.tobytes() + v.tobytes()),
        "text": digest(text.encode()),
        "code": digest("\n".join(code).encode()),
        "instructions": len(code),
        "modules": sorted(set(compiled.modules)),
    }


if __name__ == "__main__":
    print(json.dumps(answer(load_scene(sys.argv[1]))))
