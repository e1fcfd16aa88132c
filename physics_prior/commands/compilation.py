"""A word to whoever waits: the first time that a scene's step is used it is compiled, later it comes from the cache."""

from collections.abc import Iterator
from contextlib import contextmanager

from physics_prior.commands.terminal import status
from physics_prior.dynamics.compose import kinds_of_rows, step_module
from physics_prior.dynamics.kernel import cache_directory
from physics_prior.scene import Scene

DURATION, WITH_CONTACT = "~20 s", "~1 min"


@contextmanager
def compiling(scene: Scene, kernel: str) -> Iterator[None]:
    """Say what is going on while the block makes the first use of a scene's step; kernel: the last that it compiles."""
    constrained, touching = kinds_of_rows(scene.tree, scene.effects)
    step = step_module(scene.effects, constrained, scene.step.integrator, touching).__name__
    cached = any(cache_directory().glob(f"*/{step}.{kernel}-*.nbc"))
    duration = WITH_CONTACT if touching else DURATION
    with status(f"loading {scene.name}" if cached else f"compiling the step of {scene.name}, once: {duration}"):
        yield
