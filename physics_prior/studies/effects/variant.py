"""Variants of a scene: an effect left out or added, numbers changed; each is built as a file of its own would be."""

import copy
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from physics_prior.errors import SceneError
from physics_prior.resources import scene_path
from physics_prior.scene import Scene, build_scene
from physics_prior.scene.yaml_file import parse_yaml, read_yaml, shown

_NUMBER = re.compile(r"\s*([-+]?(?:\.\d+|\d+\.?\d*)(?:[eE][-+]?\d+)?)(\s.*)?", re.ASCII | re.DOTALL)

Key = str | int


@dataclass(frozen=True)
class SceneText:
    """A scene as plain data, which variants are made of.

    Attributes:
        path: the file that it came from: what errors name, and where what it refers to lies.
        data: its content.
    """

    path: Path
    data: Mapping[str, Any]

    @staticmethod
    def read(name_or_path: str | Path) -> "SceneText":
        """The text of a shipped scene or a scene file; SceneError if there is none or it is no YAML."""
        path = scene_path(name_or_path)
        return SceneText(path, read_yaml(path).value)

    def build(self) -> Scene:
        """The scene; SceneError as of a file, its lines those of the variant."""
        return build_scene(parse_yaml(self.path, json.dumps(self.data, indent=1)))

    @property
    def entries(self) -> list[Any]:
        """Its effects, as they stand in the file."""
        return list(self.data.get("effects") or [])

    def without(self, index: int) -> "SceneText":
        """The scene without the index-th effect; readouts, which may speak of it, are left out."""
        effects = [entry for place, entry in enumerate(self.entries) if place != index]
        data = {key: value for key, value in self.data.items() if key != "readouts"}
        return SceneText(self.path, data | {"effects": effects})

    def added(self, entry: Any) -> "SceneText":
        """The scene with one effect more, at the end."""
        return SceneText(self.path, dict(self.data) | {"effects": [*self.entries, entry]})

    def number(self, path: str) -> float:
        """The number at a path, in the unit that it has there.

        Raises:
            SceneError: the path leads nowhere, or to no number other than zero, which cannot be scaled.
        """
        keys = self._keys(path)
        return _number(self._at(keys), f"{self.path}: {path}")

    def scaled(self, factors: Mapping[str, float]) -> "SceneText":
        """The scene with the numbers at some paths multiplied."""
        data = copy.deepcopy(dict(self.data))
        for path, factor in factors.items():
            keys = self._keys(path)
            inner: Any = data
            for key in keys[:-1]:
                inner = inner[key]
            inner[keys[-1]] = _scaled(inner[keys[-1]], factor)
        return SceneText(self.path, data)

    def noisier(self, factor: float) -> "SceneText":
        """The scene with all measurements, and the forces that it does not know, so many times as uncertain."""
        paths = ["noise.force"] if _split((self.data.get("noise") or {}).get("force")) is not None else []
        for place, entry in enumerate(self.data.get("measurements") or []):
            for kind, fields in entry.items():
                noises = [key for key in fields if key.endswith("noise")]
                paths += [f"measurements.{place}.{kind}.{key}" for key in noises]
        return self.scaled(dict.fromkeys(paths, factor)) if factor != 1.0 else self

    def paths(self, index: int) -> list[str]:
        """Paths of the numbers other than zero of the index-th effect."""
        entry = self.entries[index]
        return [".".join(map(str, ("effects", index, *keys))) for keys in _numbers(entry)]

    def belongs(self, path: str, index: int) -> bool:
        """Whether a path leads into the index-th effect."""
        return self._keys(path)[:2] == ["effects", index]

    def _at(self, keys: list[Key]) -> Any:
        value: Any = self.data
        for key in keys:
            value = value[key]
        return value

    def _keys(self, path: str) -> list[Key]:
        """Keys and indices of a path such as ``model.parts.rod.mass`` or ``effects.joint_damping.coefficients.pin``.

        An effect may be called by its place in the list, its kind or its name.
        """
        keys: list[Key] = []
        value: Any = self.data
        for word in path.split("."):
            if isinstance(value, list):
                known = {str(place): place for place in range(len(value))}
                if keys == ["effects"]:
                    known |= {label_of(entry): place for place, entry in enumerate(value)}
                found: Key | None = known.get(word)
            else:
                known = {key: key for key in value} if isinstance(value, dict) else {}
                found = known.get(word)
            if found is None:
                raise SceneError(
                    f"{self.path}: parameter '{path}' is not there: at {word!r:.80}, known are {list(known)}"
                )
            keys.append(found)
            value = value[found]
            if keys[:1] == ["effects"] and len(keys) == 2 and isinstance(value, dict):  # {kind: fields}: step inside
                (kind,) = list(value)[:1] or [""]
                keys.append(kind)
                value = value[kind]
        return keys


def label_of(entry: Any) -> str:
    """The name of an effect's outputs, as its entry in a file says: its own, or its kind."""
    if not isinstance(entry, dict):
        return str(entry)
    kind, fields = next(iter(entry.items()), ("", None))
    return str(fields["name"]) if isinstance(fields, dict) and fields.get("name") else str(kind)


def kind_of(entry: Any) -> str:
    """The kind of an effect, as its entry in a file says."""
    return str(next(iter(entry), "")) if isinstance(entry, dict) else str(entry)


def _numbers(entry: Any) -> Iterator[tuple[Key, ...]]:
    """Where numbers other than zero stand in the fields of an effect."""
    fields = next(iter(entry.values()), None) if isinstance(entry, dict) else None

    def walk(value: Any, keys: tuple[Key, ...]) -> Iterator[tuple[Key, ...]]:
        if isinstance(value, dict):
            for key, inner in value.items():
                yield from walk(inner, (*keys, key))
        elif isinstance(value, list):
            for place, inner in enumerate(value):
                yield from walk(inner, (*keys, place))
        elif _split(value) is not None and _split(value) != (0.0, ""):
            yield keys

    yield from walk(fields, ())


def _split(value: Any) -> tuple[float, str] | None:
    """Number and unit of a quantity; None of anything else."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value), ""
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    return None if match is None else (float(match[1]), match[2] or "")


def _number(value: Any, where: str) -> float:
    split = _split(value)
    if split is None or split[0] == 0.0:
        raise SceneError(f"{where}: {shown(value)} cannot be fitted: that takes a number other than zero")
    return split[0]


def _scaled(value: Any, factor: float) -> Any:
    split = _split(value)
    assert split is not None
    number, unit = split
    return f"{number * factor!r}{unit}" if unit else number * factor
