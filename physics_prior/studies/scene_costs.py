"""What scenes cost that name little, and that name much: each compiled from a cold cache, by a process of its own, then stepped.

``python -m physics_prior.studies.scene_costs SCENE`` prints the figures of one as JSON.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from physics_prior.errors import PhysicsPriorError
from physics_prior.interface.warm_up import warm_up
from physics_prior.scene import load_scene
from physics_prior.studies.effects.cost import step_times

SCENES = ("free_body", "double_pendulum", "walk_lemouel")


def run_scene_costs(progress: Callable[[float, str], None] = lambda done, what: None) -> dict[str, Any]:
    """What each of SCENES costs: ``scenes``, a list of figures.

    ``compilation_s``: until estimates can be made, from a cold cache, by two processes where there are cores for them;
    ``us_per_step``: of the scene's own step, from its start on.

    Raises:
        PhysicsPriorError: a scene does not run.
    """
    figures = []
    for done, name in enumerate(SCENES):
        progress(done / len(SCENES), f"{name}, from a cold cache")
        figures.append({"scene": name} | _cold(name))
    progress(1.0, "done")
    return {"scenes": figures}


def scene_cost(name: str) -> dict[str, Any]:
    """The figures of a scene, whose kernels are compiled now if they have not been before."""
    scene = load_scene(name)
    begun = perf_counter()
    warm_up(scene)
    compilation = perf_counter() - begun
    return {
        "freedoms": scene.tree.nv,
        "effects": len(scene.effects),
        "compilation_s": compilation,
        "us_per_step": float(np.median(step_times([scene]))),
    }


def table(figures: dict[str, Any]) -> str:
    """The figures as a table of Markdown."""
    rows = [
        f"| `{each['scene']}` | {each['freedoms']} | {each['effects']} | {each['compilation_s']:.0f} s"
        f" | {each['us_per_step']:.2f} us |"
        for each in figures["scenes"]
    ]
    head = "| scene | degrees of freedom | effects | compilation from a cold cache | a step |"
    return "\n".join([head, "|---|---|---|---|---|", *rows])


def _cold(name: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, "-m", __name__, name]
        environment = os.environ | {"PHYSICS_PRIOR_CACHE": cache}
        told = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if told.returncode:
        raise PhysicsPriorError(f"scene '{name}' does not run: {told.stderr.strip().splitlines()[-1]}")
    figures: dict[str, Any] = json.loads(told.stdout)
    return figures


if __name__ == "__main__":
    print(json.dumps(scene_cost(sys.argv[1])))
