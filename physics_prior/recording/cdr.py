"""CDR: the bytes of a message, as rmw_fastrtps writes them (OMG DDS-XTypes 1.3, plain XCDR version 1).

Four bytes name the byte order; then come the fields in order, each primitive aligned to its own size, counted
from after those four bytes; strings carry their length with a final NUL, sequences their count, nested
messages nothing.

A message class is turned once into a plan: a flat list of steps over its leaves, in which neighbouring
scalars of nested messages are one `struct` call. Everything read is checked against the bytes that remain
before anything is allocated. Non-finite numbers pass: a marker that was not seen is NaN, and judging that is
not this module's task.
"""

import struct
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from operator import attrgetter, getitem
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from physics_prior.errors import RecordingError
from physics_prior.recording.definitions import Field, fields_of, message_class
from physics_prior.recording.wire import STRING, UINT8, Message, Primitive

ENCAPSULATION_BYTES = 4
LITTLE_ENDIAN_HEADER = b"\x00\x01\x00\x00"
BYTE_ORDERS = (">", "<")  # indexed by the second byte of the encapsulation header
LENGTHS = tuple(struct.Struct(order + "I") for order in BYTE_ORDERS)
LITTLE = 1

Build = Callable[[Sequence[Any], int], Any]


def encode(message: Message) -> bytes:
    """Return the little-endian CDR bytes of a message, encapsulation header included, padding zeroed.

    Raises RecordingError naming type and field where a value does not fit its field.
    """
    body = bytearray()
    _plan(message.ros_type).write(body, message)
    return LITTLE_ENDIAN_HEADER + body


def decode(type_name: str, data: bytes) -> Message:
    """Return the message of ROS type `type_name` (``pkg/msg/Type``) in CDR bytes of either byte order.

    Bytes after the message are left alone: rmw_fastrtps itself sends some. Raises RecordingError naming type,
    field and byte offset where the bytes end too early or claim what they cannot hold.
    """
    plan = _plan(type_name)
    if len(data) < ENCAPSULATION_BYTES or data[0] != 0 or data[1] > LITTLE:
        raise RecordingError(
            f"{type_name}: CDR data must begin with 00 00 or 00 01 (plain CDR) and two option bytes,"
            f" not with {bytes(data[:ENCAPSULATION_BYTES]).hex(' ') or 'nothing'}"
        )
    message: Message
    message, _ = plan.read(memoryview(data)[ENCAPSULATION_BYTES:], 0, data[1])
    return message


class _Step(Protocol):
    """Reads or writes the next leaves of a message; `position` and padding count from after the header."""

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int: ...

    def write(self, body: bytearray, values: Sequence[Any]) -> None: ...


class _Plan:
    """How one message class is read and written: its steps over the flat list of its leaves."""

    def __init__(self, cls: type[Message]):
        leaves, self._build = _flatten(cls)
        self._steps = _steps(cls, leaves)
        self._name = cls.ros_type
        paths = [path for path, _ in leaves]
        if not cls.__dataclass_fields__:  # type: ignore[attr-defined]
            self._get: Callable[[Message], Sequence[Any]] = lambda message: (0,)
        elif len(paths) == 1:
            get_one = attrgetter(paths[0])
            self._get = lambda message: (get_one(message),)
        else:
            self._get = attrgetter(*paths)
        # The least any message of this class takes bounds the count that a sequence of them may claim.
        self.least_size = sum(_least_size(field) for _, field in leaves)

    def read(self, body: memoryview, position: int, order: int) -> tuple[Any, int]:
        values: list[Any] = []
        for step in self._steps:
            position = step.read(body, position, order, values)
        return self._build(values, 0), position

    def write(self, body: bytearray, message: Message) -> None:
        try:
            values = self._get(message)
        except AttributeError as error:
            raise RecordingError(f"{self._name}: a nested message has the wrong type: {error}") from None
        for step in self._steps:
            step.write(body, values)


@cache
def _plan(type_name: str) -> _Plan:
    return _Plan(message_class(type_name))


def _flatten(cls: type[Message]) -> tuple[list[tuple[str, Field]], Build]:
    """Leaves of a class as (dotted path, field), and what builds the message from their values."""
    leaves: list[tuple[str, Field]] = []
    parts: list[tuple[int, Build]] = []
    for field in fields_of(cls):
        if isinstance(field.element, Primitive) or field.is_array:
            leaves.append((field.name, field))
            parts.append((1, getitem))
        else:
            inner, build = _flatten(field.element)
            leaves += [(f"{field.name}.{path}", leaf) for path, leaf in inner]
            parts.append((len(inner), build))
    count = len(leaves)
    if not cls.__dataclass_fields__:  # type: ignore[attr-defined]
        return leaves, lambda values, at: cls()
    if len(parts) == count:
        return leaves, lambda values, at: cls(*values[at : at + count])

    def build_nested(values: Sequence[Any], at: int) -> Any:
        arguments = []
        for size, build in parts:
            arguments.append(build(values, at))
            at += size
        return cls(*arguments)

    return leaves, build_nested


def _steps(cls: type[Message], leaves: list[tuple[str, Field]]) -> list[_Step]:
    steps: list[_Step] = []
    run: list[tuple[str, str]] = []
    for at, (path, field) in enumerate(leaves):
        where = f"{cls.ros_type}.{path}"
        if isinstance(field.element, Primitive) and field.element is not STRING and not field.is_array:
            run.append((where, field.element.struct_code))
            continue
        if run:
            steps.append(_Run(run, at))
            run = []
        if not field.is_array:
            steps.append(_String(where, at))
        elif not isinstance(field.element, Primitive):
            steps.append(_MessageSequence(where, at, _plan(field.element.ros_type)))
        elif field.element is STRING:
            steps.append(_StringSequence(where, at))
        elif field.element is UINT8:
            steps.append(_Octets(where, at))
        else:
            steps.append(_NumberArray(where, at, field.element.struct_code, field.length))
    if run:
        steps.append(_Run(run, len(leaves)))
    return steps


def _least_size(field: Field) -> int:
    counted = field.is_array and not field.length
    if isinstance(field.element, Primitive) and field.element is not STRING and not counted:
        return struct.calcsize("<" + field.element.struct_code) * (field.length or 1)
    return LENGTHS[LITTLE].size


def _read_length(body: memoryview, position: int, order: int, unit: int, where: str) -> tuple[int, int]:
    """Read a count of things of at least `unit` bytes; return it and the position after it."""
    position = (position + 3) & ~3
    if position + 4 > len(body):
        raise _too_short(where, position, len(body))
    (count,) = LENGTHS[order].unpack_from(body, position)
    position += 4
    if count * unit > len(body) - position:
        raise RecordingError(
            f"{where} at byte {position - 4 + ENCAPSULATION_BYTES}: claims {count} elements of {unit} bytes"
            f" or more, but only {len(body) - position} bytes follow"
        )
    return count, position


def _write_length(body: bytearray, count: int) -> None:
    body += bytes(-len(body) & 3)
    body += LENGTHS[LITTLE].pack(count)


def _too_short(where: str, position: int, size: int) -> RecordingError:
    return RecordingError(
        f"{where} at byte {position + ENCAPSULATION_BYTES}: the message ends before this field,"
        f" at byte {size + ENCAPSULATION_BYTES}"
    )


def _does_not_fit(where: str, value: Any, valid: str) -> RecordingError:
    return RecordingError(f"{where}: {str(value)[:80]!r} does not fit; valid is {valid}")


class _Run:
    """Neighbouring scalars, as one struct for each of the eight phases of alignment they may begin at."""

    def __init__(self, scalars: list[tuple[str, str]], stop: int):
        self._names = [name for name, _ in scalars]
        self._codes = [code for _, code in scalars]
        self._values = slice(stop - len(scalars), stop)
        self._structs = [
            [struct.Struct(order + _padded(self._codes, phase)) for phase in range(8)] for order in BYTE_ORDERS
        ]

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        layout = self._structs[order][position & 7]
        if position + layout.size > len(body):
            raise _too_short(self._names[0], position, len(body))
        values += layout.unpack_from(body, position)
        return position + layout.size

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        try:
            body += self._structs[LITTLE][len(body) & 7].pack(*values[self._values])
        except (struct.error, OverflowError):
            for name, code, value in zip(self._names, self._codes, values[self._values], strict=True):
                try:
                    struct.pack("<" + code, value)
                except (struct.error, OverflowError) as error:
                    raise _does_not_fit(name, value, str(error)) from None
            raise


def _padded(codes: list[str], phase: int) -> str:
    """Struct format of scalars with their padding, beginning `phase` bytes after a multiple of eight."""
    position, layout = phase, ""
    for code in codes:
        size = struct.calcsize("<" + code)
        padding = -position % size
        layout += "x" * padding + code
        position += padding + size
    return layout


class _String:
    """A text: length with the final NUL, UTF-8, NUL. Length zero, which some write, is the empty text."""

    def __init__(self, where: str, at: int):
        self._where, self._at = where, at

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        text, position = _read_text(body, position, order, self._where)
        values.append(text)
        return position

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        _write_text(body, values[self._at], self._where)


def _read_text(body: memoryview, position: int, order: int, where: str) -> tuple[str, int]:
    length, position = _read_length(body, position, order, 1, where)
    end = position + length
    if length and body[end - 1] != 0:
        raise RecordingError(f"{where} at byte {end - 1 + ENCAPSULATION_BYTES}: the text does not end in NUL")
    try:
        return str(body[position : max(end - 1, position)], "utf-8"), end
    except UnicodeDecodeError as error:
        at = position + error.start + ENCAPSULATION_BYTES
        raise RecordingError(f"{where} at byte {at}: the text is not UTF-8") from None


def _write_text(body: bytearray, text: Any, where: str) -> None:
    if not isinstance(text, str):
        raise _does_not_fit(where, text, "text without NUL")
    body += bytes(-len(body) & 3)
    body += _text_bytes(text, where)


@lru_cache(maxsize=1024)  # names come again in every message
def _text_bytes(text: str, where: str) -> bytes:
    if "\0" in text:
        raise _does_not_fit(where, text, "text without NUL")
    try:
        encoded = text.encode()
    except UnicodeEncodeError:
        raise _does_not_fit(where, ascii(text), "text that UTF-8 can hold") from None
    return LENGTHS[LITTLE].pack(len(encoded) + 1) + encoded + b"\0"


class _StringSequence:
    """A count and as many texts."""

    def __init__(self, where: str, at: int):
        self._where, self._at = where, at

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        count, position = _read_length(body, position, order, LENGTHS[order].size, self._where)
        texts = []
        for _ in range(count):
            text, position = _read_text(body, position, order, self._where)
            texts.append(text)
        values.append(texts)
        return position

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        texts = values[self._at]
        if isinstance(texts, str) or not isinstance(texts, Sequence):  # a text is itself a sequence of texts
            raise _does_not_fit(self._where, texts, "a sequence of texts")
        _write_length(body, len(texts))
        for text in texts:
            _write_text(body, text, self._where)


class _Octets:
    """A count and as many bytes."""

    def __init__(self, where: str, at: int):
        self._where, self._at = where, at

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        count, position = _read_length(body, position, order, 1, self._where)
        values.append(bytes(body[position : position + count]))
        return position + count

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        octets = values[self._at]
        if not isinstance(octets, bytes | bytearray):
            raise _does_not_fit(self._where, octets, "bytes")
        _write_length(body, len(octets))
        body += octets


class _NumberArray:
    """Numbers: `length` of them, or a count and as many."""

    def __init__(self, where: str, at: int, code: str, length: int | None):
        self._where, self._at, self._length = where, at, length
        self._types = [np.dtype(order + code) for order in BYTE_ORDERS]
        self._native = np.dtype("=" + code)
        self._size = self._native.itemsize

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        count = self._length
        if count is None:
            count, position = _read_length(body, position, order, self._size, self._where)
        if count:  # an empty sequence is not followed by padding
            position += -position % self._size
        end = position + count * self._size
        if end > len(body):
            raise _too_short(self._where, position, len(body))
        # astype copies, so that the array is aligned, native, writable and does not keep the message alive
        values.append(np.frombuffer(body[position:end], self._types[order]).astype(self._native))
        return end

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        numbers = self._as_array(values[self._at])
        if self._length is None:
            _write_length(body, numbers.size)
        if numbers.size:
            body += bytes(-len(body) % self._size)
        body += numbers.tobytes()

    def _as_array(self, value: Any) -> npt.NDArray[Any]:
        valid = f"{self._length} numbers" if self._length else "a one-dimensional sequence of numbers"
        try:
            numbers = np.asarray(value, dtype=self._types[LITTLE])
        except (TypeError, ValueError):
            raise _does_not_fit(self._where, value, valid) from None
        if numbers.size != self._length if self._length else numbers.ndim != 1:
            raise _does_not_fit(self._where, value, valid)
        return numbers


class _MessageSequence:
    """A count and as many nested messages."""

    def __init__(self, where: str, at: int, plan: _Plan):
        self._where, self._at, self._plan = where, at, plan

    def read(self, body: memoryview, position: int, order: int, values: list[Any]) -> int:
        count, position = _read_length(body, position, order, self._plan.least_size, self._where)
        messages = []
        for _ in range(count):
            message, position = self._plan.read(body, position, order)
            messages.append(message)
        values.append(messages)
        return position

    def write(self, body: bytearray, values: Sequence[Any]) -> None:
        messages = values[self._at]
        if not isinstance(messages, Sequence):
            raise _does_not_fit(self._where, messages, "a sequence of messages")
        _write_length(body, len(messages))
        for message in messages:
            self._plan.write(body, message)
