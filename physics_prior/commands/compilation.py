"""A word to whoever waits: the first time that a scene's step is used it is compiled, later it comes from the cache."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from physics_prior.commands.terminal import progress, status
from physics_prior.dynamics.compose import step_module, structure_of
from physics_prior.dynamics.kernel_cache import is_kept
from physics_prior.scene import Scene, load_scene
from physics_prior.stepping import Choice, settle

DURATION, WITH_CONTACT = "~20 s", "~40 s"


def load_settled(name_or_path: str | Path) -> tuple[Scene, Choice | None]:
    """A scene with its step, chosen for the accuracy that it asks for if it does: then also the choice.

    Raises:
        SceneError: as of ``load_scene`` and ``settle``.
    """
    with progress("loading") as report:
        return settle(load_scene(name_or_path), lambda what: report(0.0, what))


@contextmanager
def compiling(scene: Scene, last: Literal["advance", "carry"]) -> Iterator[None]:
    """Say what is going on while the block makes the first use of a scene's step; last: what it compiles last of that."""
    structure = structure_of(scene.tree, scene.effects)
    sleeping = scene.step.sleep is not None and last == "advance"  # the estimator's simulator knows no sleep
    step = step_module(scene.effects, structure, scene.step.integrator, sleeping)
    cached = is_kept(getattr(step, last))
    duration = WITH_CONTACT if structure.touching else DURATION
    with status(f"loading {scene.name}" if cached else f"compiling the step of {scene.name}, once: {duration}"):
        yield
