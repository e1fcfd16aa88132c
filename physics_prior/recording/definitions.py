"""What the message classes say of themselves: fields, schema text as rosbag2 writes it, and type hash.

All of it is derived from the annotations in `messages`. The hash is that of REP-2011 (RIHS01): SHA-256 of the
type description as JSON, without default values; it covers what goes over the wire, and no comments.
"""

import dataclasses
import hashlib
import json
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

from physics_prior.recording import messages as _registered  # noqa: F401  (defining a message registers it)
from physics_prior.recording.wire import UINT8, Array, Message, Primitive, message_class

SEPARATOR = "=" * 80
NESTED_ID, FIXED_ARRAY_IDS, SEQUENCE_IDS = 1, 48, 144  # offsets of type_description_interfaces/msg/FieldType


class Field(NamedTuple):
    """One field on the wire: a primitive or a nested message; of an array `length`, or any number if None."""

    name: str
    element: Primitive | type[Message]
    is_array: bool = False
    length: int | None = None
    default: Any = None


def fields_of(cls: type[Message]) -> tuple[Field, ...]:
    """Fields of a message class in wire order. An empty message travels as one unused byte, as ROS has it."""
    hints = get_type_hints(cls, include_extras=True)
    found = tuple(_field(f.name, hints[f.name], f.default) for f in dataclasses.fields(cls))  # type: ignore[arg-type]
    return found or (Field("structure_needs_at_least_one_member", UINT8),)


def _field(name: str, hint: Any, default: Any) -> Field:
    if get_origin(hint) is Annotated:
        wire = hint.__metadata__[0]
        if isinstance(wire, Array):
            return Field(name, wire.element, True, wire.length)
        return Field(name, wire, default=default)
    if isinstance(hint, type):
        return Field(name, hint)
    (inner,) = get_args(hint)
    return Field(name, _field(name, inner, None).element, is_array=True)


def schema_text(cls: type[Message]) -> str:
    """Return the `ros2msg` schema: fields and constants, then each nested type after a line of 80 '='.

    Nested types come depth first, by name at each level, each once: rosbag2's order.
    """
    blocks = [_fields_text(cls)]
    blocks += [f"{SEPARATOR}\nMSG: {_short_name(n)}\n{_fields_text(n)}" for n in _dependencies(cls)]
    return "\n".join(blocks)


def _fields_text(cls: type[Message]) -> str:
    lines = []
    for name, hint in get_type_hints(cls, include_extras=True).items():
        if get_origin(hint) is ClassVar and get_origin(get_args(hint)[0]) is Annotated:
            lines.append(f"{get_args(hint)[0].__metadata__[0].name} {name}={getattr(cls, name)}")
    for field in fields_of(cls) if dataclasses.fields(cls) else ():  # type: ignore[arg-type]
        size = f"[{field.length or ''}]" if field.is_array else ""
        # Only the quaternion's w has a default that is not zero.
        default = f" {field.default:g}" if isinstance(field.default, float) and field.default else ""
        lines.append(f"{_written_type(field.element, cls)}{size} {field.name}{default}")
    return "".join(f"{line}\n" for line in lines)


def _written_type(element: Primitive | type[Message], inside: type[Message]) -> str:
    if isinstance(element, Primitive):
        return element.name
    package, name = _short_name(element).split("/")
    return name if inside.ros_type.startswith(f"{package}/") else f"{package}/{name}"


def _short_name(cls: type[Message]) -> str:
    return cls.ros_type.replace("/msg/", "/")


def _dependencies(cls: type[Message]) -> list[type[Message]]:
    """Nested types, depth first, by name at each level, each once."""
    found: dict[type[Message], None] = {}

    def visit(outer: type[Message]) -> None:
        inner = {f.element for f in fields_of(outer) if not isinstance(f.element, Primitive)}
        for nested in sorted(inner, key=_short_name):
            if nested not in found:
                found[nested] = None
                visit(nested)

    visit(cls)
    return list(found)


def type_hash(cls: type[Message]) -> str:
    """Return the type's RIHS01 hash: what rosbag2 files as `topic_type_hash` and the graph compares."""
    nested = sorted(_dependencies(cls), key=lambda dependency: dependency.ros_type)
    description = {
        "type_description": _type_description(cls),
        "referenced_type_descriptions": [_type_description(dependency) for dependency in nested],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(description).encode()).hexdigest()


def _type_description(cls: type[Message]) -> dict[str, Any]:
    return {"type_name": cls.ros_type, "fields": [_field_description(field) for field in fields_of(cls)]}


def _field_description(field: Field) -> dict[str, Any]:
    primitive = isinstance(field.element, Primitive)
    type_id = field.element.description_id if isinstance(field.element, Primitive) else NESTED_ID
    if field.is_array:
        type_id += FIXED_ARRAY_IDS if field.length else SEQUENCE_IDS
    return {
        "name": field.name,
        "type": {
            "type_id": type_id,
            "capacity": field.length or 0,
            "string_capacity": 0,
            "nested_type_name": "" if primitive else field.element.ros_type,  # type: ignore[union-attr]
        },
    }


__all__ = ["Field", "fields_of", "message_class", "schema_text", "type_hash"]
