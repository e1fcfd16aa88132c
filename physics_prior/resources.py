"""The files shipped beside the code: scenes, launch files and sample recordings."""

import os
from pathlib import Path

from physics_prior.errors import PhysicsPriorError, SceneError

_PACKAGE = "physics_prior"
_SCENES = Path("config", "scenes")
_MARKER_SETS = Path("config", "marker_sets")


def share_directory() -> Path:
    """Folder that holds ``config/``, ``launch/``, ``bags/`` and ``package.xml`` of the code that is running.

    A source checkout is its own share folder. An installed copy has ``share/physics_prior`` in the prefix
    above its site-packages; that holds for a virtual environment, a user or system install, a colcon
    workspace and an ament underlay alike. Starting from the code, and not from ``sys.prefix`` or
    AMENT_PREFIX_PATH, never pairs it with the files of another version.

    Raises:
        PhysicsPriorError: the code was copied somewhere without its files.
    """
    package = Path(__file__).resolve().parent
    candidates = [package.parent, *(prefix / "share" / _PACKAGE for prefix in package.parents)]
    for folder in candidates:
        if (folder / _SCENES).is_dir():
            return folder
    raise PhysicsPriorError(
        f"no share/{_PACKAGE} folder belongs to the package in {package}: install it with pip or colcon"
    )


def shipped_scenes() -> list[str]:
    """Names of the shipped scenes, sorted: what ``scene_path`` takes besides a path.

    Raises:
        PhysicsPriorError: see ``share_directory``.
    """
    return _shipped(_SCENES)


def scene_path(name_or_path: str | Path) -> Path:
    """Find the scene that a user means: a file that exists, as given, or else the shipped scene of that name.

    Raises:
        SceneError: neither a file nor a shipped scene; the message lists the shipped names.
    """
    return _found(name_or_path, _SCENES, "scene")


def marker_set_path(name_or_path: str | Path) -> Path:
    """Find a marker set as ``scene_path`` finds a scene."""
    return _found(name_or_path, _MARKER_SETS, "marker set")


def _shipped(folder: Path) -> list[str]:
    return sorted(file.stem for file in (share_directory() / folder).glob("*.yaml"))


def _found(name_or_path: str | Path, folder: Path, noun: str) -> Path:
    if os.path.isfile(name_or_path):  # unlike Path.is_file, False for a name that no file can have
        return Path(name_or_path)
    names = _shipped(folder)
    if str(name_or_path) in names:
        return share_directory() / folder / f"{name_or_path}.yaml"
    raise SceneError(f"{noun} '{name_or_path}' is neither a file nor a shipped {noun}; shipped are {', '.join(names)}")
