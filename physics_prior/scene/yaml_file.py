"""YAML files read so that every value knows its line, hostile ones refused before they cost anything."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import yaml

from physics_prior.errors import SceneError
from physics_prior.inertia import LARGEST_NUMBER

MAXIMUM_BYTES = 1_000_000
MAXIMUM_VALUES = 20_000  # aliases counted as often as they are used: nothing expands beyond it
MAXIMUM_DEPTH = 30

Location = tuple[str | int, ...]

# The numbers of YAML 1.2. PyYAML follows 1.1, in which 1e-4 is a text and 1:30 a number.
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|nan)", re.IGNORECASE)
_SIMPLE_KEY = re.compile(r"[\w./-]{1,80}")
_WORDS = {"true": True, "false": False, "null": None, "~": None, "": None}


@dataclass(frozen=True)
class _Node:
    """A value and the line that it, or the key it belongs to, stands on."""

    line: int
    content: Any  # dict[str, _Node], list[_Node] or a scalar
    size: int = 1  # how many values it holds, itself included
    depth: int = 1


@dataclass(frozen=True)
class Place:
    """A value in a YAML file and where it stands: what a reader walks along, and complains about.

    Attributes:
        path: the file.
        location: keys and indices that lead from the top of the file to the value.
    """

    path: Path
    location: Location
    _node: _Node

    @property
    def value(self) -> Any:
        """The value in plain dicts, lists, texts, floats, ints, bools and None."""
        return _plain(self._node)

    @property
    def is_mapping(self) -> bool:
        """Whether the value is a mapping."""
        return isinstance(self._node.content, dict)

    @property
    def is_list(self) -> bool:
        """Whether the value is a list."""
        return isinstance(self._node.content, list)

    def __getitem__(self, key: str | int) -> "Place":
        return Place(self.path, (*self.location, key), self._node.content[key])

    def __contains__(self, key: str) -> bool:
        return self.is_mapping and key in self._node.content

    def get(self, key: str) -> "Place":
        """Return the entry of a mapping, or an empty one, on this line, where it has none of that key."""
        if key in self:
            return self[key]
        return Place(self.path, (*self.location, key), _Node(self._node.line, None))

    def items(self) -> "list[tuple[str, Place]]":
        """Return the entries of a mapping as ordered in the file, none for null; SceneError otherwise."""
        if self._node.content is None:
            return []
        if not self.is_mapping:
            raise self.error(f"{shown(self.value)} is not valid: give a mapping, 'name: value' on each line")
        return [(key, self[key]) for key in self._node.content]

    def entries(self) -> "list[Place]":
        """Return the entries of a list, none for null; SceneError otherwise."""
        if self._node.content is None:
            return []
        if not self.is_list:
            raise self.error(f"{shown(self.value)} is not valid: give a list, '- entry' on each line")
        return [self[index] for index in range(len(self._node.content))]

    def inside(self, location: Location) -> "Place":
        """Return the place that a location leads to from here, or the last one that exists on the way."""
        place = self
        for key in location:
            content = place._node.content
            listed = isinstance(content, list) and isinstance(key, int) and key < len(content)
            if not listed and not (isinstance(content, dict) and key in content):
                break
            place = place[key]
        return place

    def find(self, text: str) -> "Place | None":
        """Return the first place here, depth first, that is a text or has it as a key."""
        content = self._node.content
        if content == text or (isinstance(content, dict) and text in content):
            return self
        keys: list[Any] = list(content) if isinstance(content, dict) else []
        if isinstance(content, list):
            keys = list(range(len(content)))
        return next((found for key in keys if (found := self[key].find(text)) is not None), None)

    def error(self, message: str, key: str | None = None) -> SceneError:
        """Return the error `FILE:LINE: LOCATION: message`, on the line of the entry `key` if there is one."""
        node = self._node.content[key] if key is not None and key in self else self._node
        where = _where(self.location)
        return SceneError(f"{self.path}:{node.line}: {where + ': ' if where else ''}{message}")


def read_yaml(path: Path) -> Place:
    """Read a YAML file whose top is a mapping.

    Keys are texts, none given twice; numbers are finite; anchors and aliases may be used, tags may not.

    Raises:
        SceneError: naming file and line: the file cannot be read, is no UTF-8, no YAML, breaks the rules
            above or has more than 1 MB, 20 000 values or 30 levels.
    """
    try:
        with path.open("rb") as file:
            raw = file.read(MAXIMUM_BYTES + 1)
        text = raw.decode("utf-8-sig")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise SceneError(f"{path}:{line}: byte 0x{raw[error.start]:02x} is not UTF-8: save it as UTF-8") from None
    if len(raw) > MAXIMUM_BYTES:
        raise SceneError(f"{path}: has more than {MAXIMUM_BYTES} bytes, the most that is accepted")
    return parse_yaml(path, text)


def parse_yaml(path: Path, text: str) -> Place:
    """Parse the text of a file as ``read_yaml`` does; path is what errors name."""
    try:
        top = _Builder(path, text).build()
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise SceneError(f"{path}:{line}: character {error.character!r} is not allowed in YAML") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = " ".join(str(error.problem or error.context).split())
        raise SceneError(f"{path}:{mark.line + 1 if mark else 1}: is not valid YAML: {problem}") from None
    if not isinstance(top.content, dict):
        raise SceneError(f"{path}:{top.line}: is not a scene: its top must be a mapping such as 'model: ...'")
    return Place(path, (), top)


def placed(path: Path, data: Any) -> Place:
    """Plain data that ``Place.value`` gave, or that were made from such, as if they stood in one line of a file."""
    return Place(path, (), _node(data))


def _node(value: Any) -> _Node:
    if isinstance(value, dict):
        return _Node(1, {key: _node(inner) for key, inner in value.items()})
    return _Node(1, [_node(inner) for inner in value] if isinstance(value, list) else value)


class _Builder:
    """Builds nodes from PyYAML's parsing events, so that limits hold before memory is spent."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.events = yaml.parse(text, Loader=yaml.SafeLoader)
        self.anchors: dict[str, _Node] = {}
        self.values = 0
        self.location: list[str | int] = []

    def build(self) -> _Node:
        self.next()  # start of the stream
        if isinstance(self.next(), yaml.StreamEndEvent):
            raise SceneError(f"{self.path}:1: is empty: a scene needs at least 'model: ...'")
        top = self.node(self.next(), 1)
        self.next()  # end of the document
        after = self.next()
        if not isinstance(after, yaml.StreamEndEvent):
            raise self.error(after, "a second document starts here: a scene is one document")
        return top

    def next(self) -> Any:
        return next(self.events)

    def node(self, event: Any, depth: int) -> _Node:
        if depth > MAXIMUM_DEPTH:
            raise self.error(event, f"is nested deeper than {MAXIMUM_DEPTH} levels")
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                raise self.error(event, f"alias *{event.anchor} is unknown: its anchor must end before it")
            node = self.anchors[event.anchor]
            self.count(event, node.size)
            if depth + node.depth - 1 > MAXIMUM_DEPTH:
                raise self.error(event, f"is nested deeper than {MAXIMUM_DEPTH} levels")
            return node
        self.count(event, 1)
        if event.tag is not None:
            raise self.error(event, f"tag {event.tag[:80]!r} is refused: a scene holds plain values only")
        node = self.content(event, depth)
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def inner(self, key: str | int, event: Any, depth: int) -> _Node:
        self.location.append(key)
        node = self.node(event, depth)
        self.location.pop()
        return node

    def content(self, event: Any, depth: int) -> _Node:
        line = _line(event)
        if isinstance(event, yaml.ScalarEvent):
            return _Node(line, self.scalar(event))
        if isinstance(event, yaml.SequenceStartEvent):
            children: list[_Node] = []
            while not isinstance(inner := self.next(), yaml.SequenceEndEvent):
                children.append(self.inner(len(children), inner, depth + 1))
            return self.collection(line, children, children)
        mapping: dict[str, _Node] = {}
        while not isinstance(key := self.next(), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                raise self.error(key, "a key must be a plain text")
            self.count(key, 1)
            name = self.text(key)
            if name in mapping:
                raise self.error(key, f"key {shown(name)} is given twice, on line {mapping[name].line} too")
            value = self.inner(name, self.next(), depth + 1)
            mapping[name] = _Node(_line(key), value.content, value.size, value.depth)
        return self.collection(line, mapping, list(mapping.values()))

    def collection(self, line: int, content: Any, children: list[_Node]) -> _Node:
        size = 1 + sum(child.size for child in children)
        return _Node(line, content, size, 1 + max((child.depth for child in children), default=0))

    def text(self, event: Any) -> str:
        text = str(event.value)
        if any("\ud800" <= character <= "\udfff" for character in text):
            raise self.error(event, f"{shown(text)} has half a character (a lone surrogate)")
        return text

    def scalar(self, event: Any) -> Any:
        text = self.text(event)
        if not event.implicit[0]:  # quoted, or a block of text
            return text
        if _NOT_FINITE.fullmatch(text):
            raise self.error(event, f"{self.field()}{text} is not a finite number")
        if _NUMBER.fullmatch(text):
            number = float(text)
            if abs(number) > LARGEST_NUMBER:
                raise self.error(event, f"{self.field()}{text[:80]} is too large: numbers go up to {LARGEST_NUMBER:g}")
            return int(number) if number.is_integer() and abs(number) < 2**53 else number
        return _WORDS.get(text.lower(), text)

    def count(self, event: Any, values: int) -> None:
        self.values += values
        if self.values > MAXIMUM_VALUES:
            raise self.error(event, f"has more than {MAXIMUM_VALUES} values, those behind aliases included")

    def field(self) -> str:
        where = _where(self.location)
        return where + ": " if where else ""

    def error(self, event: Any, message: str) -> SceneError:
        return SceneError(f"{self.path}:{_line(event)}: {message}")


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1


def shown(value: Any) -> str:
    """Return a value as it may stand in a sentence: on one line, at most 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def suggestion(name: object, known: list[str]) -> str:
    """Return ` (did you mean 'NAME'?)` for the nearest of the known names, or nothing if none is near."""
    near = get_close_matches(str(name), known, n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _where(location: Sequence[str | int]) -> str:
    return "".join(_step(key) for key in location).removeprefix(".")


def _step(key: str | int) -> str:
    if isinstance(key, int):
        return f"[{key}]"
    return f".{key}" if _SIMPLE_KEY.fullmatch(key) else f".{shown(key)}"


def _plain(node: _Node) -> Any:
    if isinstance(node.content, dict):
        return {key: _plain(child) for key, child in node.content.items()}
    if isinstance(node.content, list):
        return [_plain(child) for child in node.content]
    return node.content
