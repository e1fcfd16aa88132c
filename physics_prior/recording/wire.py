"""How the fields of a message travel: the primitive types of the ROS 2 interface language, as annotations.

A message class states each field once, as an ordinary annotation; schema text, type hash and CDR codec are
derived from it (`definitions`, `cdr`). Lower-case names here are the interface language's own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from physics_prior.errors import RecordingError


@dataclass(frozen=True, slots=True)
class Primitive:
    """A type not made of fields: its code in `struct`, its id in ROS type descriptions (FieldType.msg)."""

    name: str
    struct_code: str
    description_id: int


@dataclass(frozen=True, slots=True)
class Array:
    """Several primitives in one field: `length` of them, or any number where length is None."""

    element: Primitive
    length: int | None = None


BOOL = Primitive("bool", "?", 15)
BYTE = Primitive("byte", "B", 16)
UINT8 = Primitive("uint8", "B", 3)
INT32 = Primitive("int32", "i", 6)
UINT32 = Primitive("uint32", "I", 7)
FLOAT32 = Primitive("float32", "f", 10)
FLOAT64 = Primitive("float64", "d", 11)
STRING = Primitive("string", "", 17)

boolean = Annotated[bool, BOOL]
byte = Annotated[int, BYTE]
int32 = Annotated[int, INT32]
uint32 = Annotated[int, UINT32]
float32 = Annotated[float, FLOAT32]
float64 = Annotated[float, FLOAT64]
string = Annotated[str, STRING]

Numbers = npt.NDArray[np.float64] | Sequence[float]
float64_sequence = Annotated[Numbers, Array(FLOAT64)]
float64_6x6 = Annotated[Numbers, Array(FLOAT64, 36)]
uint8_sequence = Annotated[bytes, Array(UINT8)]


def _same(left: Any, right: Any) -> bool:
    """Whether two field values say the same, whatever holds them: tuple, list or array. NaN equals NaN."""
    if isinstance(left, str | bytes | Message) or not hasattr(left, "__len__"):
        return bool(left == right or (left != left and right != right))
    if isinstance(left, np.ndarray) or isinstance(right, np.ndarray):
        return np.array_equal(left, right, equal_nan=True)
    return len(left) == len(right) and all(map(_same, left, right))


class Message:
    """Base of every message: an immutable value that knows its ROS type (``sensor_msgs/msg/JointState``)."""

    __slots__ = ()
    ros_type: ClassVar[str]

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]


MESSAGE_CLASSES: dict[str, type[Message]] = {}
MessageClass = TypeVar("MessageClass", bound=type[Message])


@dataclass_transform(frozen_default=True, eq_default=False)
def message(package: str) -> Callable[[MessageClass], MessageClass]:
    """Make a class a message of a ROS package: an immutable dataclass, registered by its type name."""

    def register(cls: MessageClass) -> MessageClass:
        made = dataclass(frozen=True, slots=True, eq=False)(cls)
        made.ros_type = f"{package}/msg/{cls.__name__}"
        MESSAGE_CLASSES[made.ros_type] = made
        return made  # type: ignore[return-value]

    return register


def message_class(type_name: str) -> type[Message]:
    """Return the class of a ROS type name; RecordingError names the known types if it is none of them."""
    try:
        return MESSAGE_CLASSES[type_name]
    except KeyError:
        known = ", ".join(sorted(MESSAGE_CLASSES))
        raise RecordingError(f"message type {type_name!r} is not known here; known are {known}") from None
