"""The CDR codec and the type hashes against rclpy: the bytes that it sends, and what it makes of ours."""

import json
import math
import os
import sys
from array import array
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy", reason="needs rclpy: pip install .[ros]")

from rclpy.serialization import deserialize_message, serialize_message

from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.definitions import fields_of, type_hash
from physics_prior.recording.messages import Point, Pose, PoseArray
from physics_prior.recording.wire import MESSAGE_CLASSES, Primitive

SIZES = {"bool": 1, "byte": 1, "uint8": 1, "int32": 4, "uint32": 4, "float32": 4, "float64": 8}
BY_NAME = pytest.mark.parametrize("cls", MESSAGE_CLASSES.values(), ids=lambda cls: cls.__name__)
FEW = settings(max_examples=25)


def ros_class(cls):
    package, _, name = cls.ros_type.split("/")
    return getattr(pytest.importorskip(f"{package}.msg", reason=f"{package} is not among the ROS wheels"), name)


def to_ros(message):
    made = ros_class(type(message))()
    for field in fields_of(type(message)) if message.__dataclass_fields__ else ():
        value = getattr(message, field.name)
        if not isinstance(field.element, Primitive):
            value = [to_ros(one) for one in value] if field.is_array else to_ros(value)
        elif field.element.name == "byte":
            value = bytes([value])
        elif field.element.name == "string" and field.is_array:
            value = list(value)
        elif field.element.name == "float64" and field.is_array and field.length is None:
            value = array("d", value)
        setattr(made, field.name, value)
    return made


def meaningful_bytes(ros_message):
    """Positions of the bytes that carry content, told from rclpy's own description of the message.

    An alignment rule of its own: everything not listed here is padding, which rclpy leaves uninitialised.
    """
    found = []

    def place(size, alignment):
        start = found[-1] + 1 if found else 0
        start += -start % alignment
        found.extend(range(start, start + size))

    def visit(value, kind):
        if kind.startswith("sequence<"):
            place(4, 4)
            for one in value:
                visit(one, kind[len("sequence<") : -1])
        elif kind.endswith("]"):
            for one in value:
                visit(one, kind.split("[")[0])
        elif kind == "string":
            place(4, 4)
            place(len(value.encode()) + 1, 1)
        elif "/" in kind:
            for name, inner in value.get_fields_and_field_types().items():
                visit(getattr(value, name), inner)
        else:
            size = {"boolean": 1, "octet": 1, "float": 4, "double": 8}.get(kind) or SIZES[kind]
            place(size, size)

    for name, kind in ros_message.get_fields_and_field_types().items():
        visit(getattr(ros_message, name), kind)
    return [4 + at for at in found]


@BY_NAME
@FEW
@given(draw=st.data())
def test_bytes_are_those_of_rclpy_up_to_padding(cls, messages_of, draw):
    message = draw.draw(messages_of[cls])
    ours, ros_message = encode(message), to_ros(message)
    theirs = serialize_message(ros_message)
    content = meaningful_bytes(ros_message)
    assert ours[:4] == theirs[:4]
    assert [ours[at] for at in content] == [theirs[at] for at in content]
    assert not any(ours[at] for at in set(range(4, len(ours))) - set(content))
    assert len(ours) == (content[-1] + 1 if content else 5)  # Empty: its one unused byte
    # rclpy may add bytes at the end: its estimate of the size aligns even empty sequences.
    assert len(theirs) >= len(ours)


@BY_NAME
@FEW
@given(draw=st.data())
def test_rclpy_reads_our_bytes_and_we_read_its(cls, messages_of, draw):
    message = draw.draw(messages_of[cls])
    ros_message = to_ros(message)
    assert deserialize_message(encode(message), ros_class(cls)) == ros_message
    assert decode(cls.ros_type, serialize_message(ros_message)) == message


def test_nan_reaches_rclpy():
    message = PoseArray(poses=[Pose(position=Point(math.nan, 1.0, 2.0))])
    position = deserialize_message(encode(message), ros_class(PoseArray)).poses[0].position
    assert math.isnan(position.x)
    assert (position.y, position.z) == (1.0, 2.0)


@BY_NAME
def test_default_values_are_those_of_rclpy(cls):
    assert to_ros(cls()) == ros_class(cls)()


@BY_NAME
def test_constants_are_those_of_rclpy(cls):
    theirs = ros_class(cls)
    constants = {name for name, value in vars(type(theirs)).items() if isinstance(value, property)}
    ours = {name for name in vars(cls) if name.isupper() and not name.startswith("_")}
    assert ours == {name for name in constants if not name.endswith("__DEFAULT")}
    for name in ours:
        value = getattr(theirs, name)
        assert getattr(cls, name) == (value[0] if isinstance(value, bytes) else value)


@BY_NAME
def test_type_hash_is_the_one_installed_with_ros(cls):
    package, _, name = cls.ros_type.split("/")
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")), sys.prefix]
    found = [file for prefix in prefixes if (file := Path(prefix, "share", package, "msg", f"{name}.json")).is_file()]
    if not found:
        pytest.skip(f"no type description of {cls.ros_type} under {prefixes}")
    described = json.loads(found[0].read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    assert type_hash(cls) == hashes[cls.ros_type]
