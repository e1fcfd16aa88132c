"""One build, asked from outside: how a scene moves in it, by which machine code, and what it compiled for that.

``python -m physics_prior.studies.effect_probe`` prints JSON. It names no effect, so that it runs in a build without any of
them (effect_costs.py).
"""

import hashlib
import json
import re
from typing import Any

import numpy as np
from numba.core import event

from physics_prior.dynamics.compose import step_source
from physics_prior.dynamics.simulator import Simulator
from physics_prior.inertia import box
from physics_prior.model import Joint, JointKind, Part, Tree

STEPS, STEP_SIZE = 1000, 1e-3


class Compiled(event.Listener):  # type: ignore[misc]
    """Which modules' functions were compiled."""

    def __init__(self) -> None:
        self.modules: list[str] = []

    def on_start(self, event: Any) -> None:
        self.modules.append(event.data["dispatcher"].py_func.__module__)

    def on_end(self, event: Any) -> None:
        """Nothing more is to be known."""


def free_body() -> Tree:
    """A brick in flight, that no effect acts on."""
    return Tree([Part("brick", box(1.0, (0.1, 0.2, 0.3)))], [Joint("flight", JointKind.FREE, "world", "brick")])


class Flight:
    """A body on its way, stepped."""

    def __init__(self) -> None:
        self.simulator = Simulator(free_body())
        self.v = np.array([1.0, 2.0, 3.0, 0.3, -4.0, 0.5])
        self.q = self.simulator.tree.neutral()

    def advance(self) -> None:
        """Make STEPS steps from where it is."""
        self.simulator.advance(self.q, self.v, STEP_SIZE, STEPS)


def digest(data: bytes) -> str:
    """A short digest."""
    return hashlib.sha256(data).hexdigest()[:16]


def instructions(assembly: str) -> list[str]:
    """The instructions of assembly, without directives and the numbers that Numba gives functions and types as it meets them."""
    lines = re.sub(r"B\d+v\d+|(?<=RecordILi)\d+", "", assembly).splitlines()
    return [line.strip() for line in lines if re.match(r"\s+[a-z]", line)]


def main() -> None:
    """Answer."""
    compiled = Compiled()
    with event.install_listener("numba:compile", compiled):
        flight = Flight()
        flight.advance()
    (assembly,) = flight.simulator.step.advance.inspect_asm().values()
    code = instructions(assembly)
    answer = {
        "bits": digest(flight.q.tobytes() + flight.v.tobytes()),
        "text": digest(step_source([], False, "rk4").encode()),
        "code": digest("\n".join(code).encode()),
        "instructions": len(code),
        "modules": sorted(set(compiled.modules)),
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
