"""Variants of a scene: an effect left out or added, numbers changed; each is built as a file of its own would be."""

import copy
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from physics_prior.errors import SceneError
from physics_prior.resources import scene_path
from physics_prior.scene import Scene, Step, build_scene
from physics_prior.scene.yaml_file import placed, read_yaml, shown

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
        """The scene; SceneError as of a file of one line."""
        return build_scene(placed(self.path, self.data))

    def stepped(self, step: Step) -> "SceneText":
        """The scene with the step that was chosen for it, if it asks for an accuracy: what variants of it are compared at."""
        if self.data.get("accuracy") is None:
            return self
        data = {key: value for key, value in self.data.items() if key != "accuracy"}
        return SceneText(self.path, data | {"step": step.model_dump(exclude_unset=True)})

    @property
    def entries(self) -> list[Any]:
        """Its effects, as they stand in the file."""
        return list(self.data.get("effects") or [])

    @property
    def labels(self) -> list[str]:
        """Names of its effects' outputs, in their order."""
        return [label_of(entry) for entry in self.entries]

    def without(self, label: str, side: str = "") -> "SceneText":
        """The scene without an effect, and without readouts of its force; or without one side of it.

        A side is one of the effect's strengths; what is told about it besides, such as how uncertain it is, goes with it.
        """
        place = self.labels.index(label)
        effects = copy.deepcopy(self.entries)
        if side:
            (inner,) = effects[place].values()
            *outer, last = self._keys(f"effects.{label}.{side}")[3:]
            for key in outer:
                inner = inner[key]
            for key in [key for key in inner if f"{key}_".startswith(f"{last}_")]:
                del inner[key]
            return SceneText(self.path, dict(self.data) | {"effects": effects})
        del effects[place]
        readouts = [each for each in self.data.get("readouts") or [] if not _is_force_of(each, label)]
        return SceneText(self.path, dict(self.data) | {"effects": effects, "readouts": readouts})

    def added(self, entry: Any) -> "SceneText":
        """The scene with one effect more, at the end."""
        return SceneText(self.path, dict(self.data) | {"effects": [*self.entries, entry]})

    def strengths(self, label: str) -> list[str]:
        """The sides of an effect that are there: where in it numbers other than zero stand that say how strong it is."""
        place = self.labels.index(label)
        fields = _fields(self.entries[place])
        return [
            ".".join([field, *keys])
            for field in self.build().effects[place].strengths
            for keys in _numbers(fields.get(field))
        ]

    def value(self, path: str) -> Any:
        """What stands at a path; SceneError if it leads nowhere."""
        value: Any = self.data
        for key in self._keys(path):
            value = value[key]
        return value

    def proper(self, path: str) -> str:
        """A path that calls the effect it leads into, if any, by its name; SceneError if it leads nowhere."""
        keys = self._keys(path)
        if keys[:1] == ["effects"] and len(keys) > 1:
            return ".".join(["effects", self.labels[int(keys[1])], *map(str, keys[3:])])
        return ".".join(map(str, keys))

    def number(self, path: str) -> float:
        """The number at a path, in the unit that it has there; SceneError if there is none."""
        value = self.value(path)
        split = _split(value)
        if split is None:
            raise SceneError(f"{self.path}: {path}: {shown(value)} is no number and cannot be fitted")
        return split[0]

    def changed(self, numbers: Mapping[str, float]) -> "SceneText":
        """The scene with other numbers at some paths, in the units of those that stand there."""
        data = copy.deepcopy(dict(self.data))
        for path, number in numbers.items():
            keys = self._keys(path)
            inner: Any = data
            for key in keys[:-1]:
                inner = inner[key]
            unit = _unit(inner, keys[-1])
            inner[keys[-1]] = f"{number!r}{unit}" if unit else number
        return SceneText(self.path, data)

    def noisier(self, factor: float) -> "SceneText":
        """The scene with all measurements, and the forces that it does not know, so many times as uncertain."""
        force = (self.data.get("noise") or {}).get("force")
        paths = [".".join(["noise", "force", *keys]) for keys in _numbers(force)]
        for place, entry in enumerate(self.data.get("measurements") or []):
            for kind, fields in entry.items():
                noises = [key for key in fields if key.endswith("noise")]
                paths += [f"measurements.{place}.{kind}.{key}" for key in noises]
        return self.changed({path: factor * self.number(path) for path in paths}) if factor != 1.0 else self

    def _keys(self, path: str) -> list[Key]:
        """Keys and indices of a path such as ``model.parts.rod.mass`` or ``effects.joint_damping.coefficients.pin``.

        An effect may be called by its place in the list, its kind or its name.
        """
        keys: list[Key] = []
        value: Any = self.data
        rest = path
        while rest:
            known: dict[str, Key] = {}
            if isinstance(value, list):
                known = {str(place): place for place in range(len(value))}
                if keys == ["effects"]:
                    known |= {label_of(entry): place for place, entry in enumerate(value)}
            elif isinstance(value, dict):
                known = {str(key): key for key in value}
            word = max((word for word in known if f"{rest}.".startswith(f"{word}.")), key=len, default=None)
            if word is None:  # the longest known word is taken: names may have dots in them
                raise SceneError(
                    f"{self.path}: parameter '{path}' is not there: at {rest.partition('.')[0]!r:.80}, known are {list(known)}"
                )
            keys.append(known[word])
            value, rest = value[known[word]], rest[len(word) + 1 :]
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


def _fields(entry: Any) -> dict[str, Any]:
    """The fields of an effect's entry."""
    fields = next(iter(entry.values()), None) if isinstance(entry, dict) else None
    return fields if isinstance(fields, dict) else {}


def _numbers(value: Any) -> Iterator[list[str]]:
    """Where numbers other than zero stand in a number or in one for each joint: the keys that lead there."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from ([str(key), *keys] for keys in _numbers(inner))
    elif (_split(value) or (0.0, ""))[0] != 0.0:
        yield []


def _is_force_of(readout: Any, label: str) -> bool:
    """Whether a readout, as it stands in the file, is of the force of an effect."""
    force = readout.get("force") if isinstance(readout, dict) else None
    named = force.get("constraint") if isinstance(force, dict) else force
    return isinstance(named, str) and f"{named}.".startswith(f"{label}.")


def _split(value: Any) -> tuple[float, str] | None:
    """Number and unit of a quantity; None of anything else."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value), ""
    match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
    return None if match is None else (float(match[1]), match[2] or "")


def _unit(inner: Any, key: Key) -> str:
    """The unit of a number in what holds it; a bare zero in a list has that of those beside it."""
    number, unit = _split(inner[key]) or (0.0, "")
    if isinstance(inner, list) and not unit and number == 0.0:
        return next((split[1] for split in map(_split, inner) if split is not None and split[1]), "")
    return unit
