"""Choices kept beside the compiled kernels, so that every start, and both doors, step alike."""

import hashlib
import os
import shutil
from pathlib import Path

from pydantic import ValidationError

from physics_prior.dynamics.compose import Structure, step_source, structure_of
from physics_prior.dynamics.integrators import DEFAULT
from physics_prior.dynamics.kernel_cache import cache_directory
from physics_prior.dynamics.records import link_records, pair_records
from physics_prior.scene import Scene
from physics_prior.stepping.choice import Choice


def path_of(scene: Scene) -> Path:
    """Where the scene's choice lies: its name is a digest of all that the choice depends on but kernels and machine.

    Those name the folder.
    """
    tree, effects = scene.tree, scene.effects
    frames = [tree.frame(name) for name in tree.frames]
    pairs = pair_records(tree, [pair for effect in effects for pair in effect.point_pairs(tree)])
    parts = [
        *(source.read_bytes() for source in sorted(Path(__file__).parent.glob("*.py"))),  # how it is chosen
        link_records(tree, pairs).tobytes(),
        step_source(effects, Structure(structure_of(tree, effects).constrained), DEFAULT).encode(),
        *(repr(each).encode() for each in (effects, scene.measurements, scene.gate, scene.simulation, scene.accuracy)),
        *(repr((each.link, each.position.tolist(), each.orientation.tolist())).encode() for each in frames),
        *(array.tobytes() for array in (scene.initial.q, scene.initial.v, scene.noise.force, scene.noise.velocity)),
    ]
    digest = hashlib.sha256()
    for part in parts:
        digest.update(hashlib.sha256(part).digest())
    return cache_directory() / f"choice_{digest.hexdigest()[:16]}.json"


def read(scene: Scene) -> Choice | None:
    """The choice that was kept; None where there is none, or none that can be read."""
    try:
        return Choice.model_validate_json(path_of(scene).read_bytes())
    except (OSError, ValidationError):
        return None


def write(scene: Scene, choice: Choice) -> Choice:
    """Keep a choice; return the one that counts: of two processes that chose at once, that of the first to be done."""
    path = path_of(scene)
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_suffix(f".{os.getpid()}")
    aside.write_text(choice.model_dump_json(indent=2, exclude_unset=True))
    try:
        if read(scene) is None:
            path.unlink(missing_ok=True)  # what cannot be read
        os.link(aside, path)
    except FileExistsError:
        pass
    except OSError:  # no links here: the last one counts
        shutil.copy(aside, path)
    finally:
        aside.unlink()
    return read(scene) or choice
