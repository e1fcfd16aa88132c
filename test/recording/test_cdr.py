"""The CDR codec against itself, against rosbags, and against hostile bytes. Against rclpy: test_cdr_rclpy.py."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from physics_prior.errors import RecordingError
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.definitions import fields_of
from physics_prior.recording.messages import (
    DiagnosticStatus,
    Float64MultiArray,
    Header,
    JointState,
    Marker,
    MarkerArray,
    MultiArrayLayout,
    Odometry,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    String,
    Time,
)
from physics_prior.recording.wire import MESSAGE_CLASSES, STRING

ROSBAGS = get_typestore(Stores.ROS2_JAZZY)


@given(draw=st.data())
def test_round_trip(any_message, draw):
    message = draw.draw(any_message)
    data = encode(message)
    again = decode(message.ros_type, data)
    assert again == message
    assert encode(again) == data


@given(draw=st.data())
def test_same_bytes_as_rosbags_in_both_byte_orders(any_message, draw):
    message = draw.draw(any_message)
    data = encode(message)
    theirs = ROSBAGS.deserialize_cdr(data, message.ros_type)
    assert bytes(ROSBAGS.serialize_cdr(theirs, message.ros_type)) == data
    big_endian = bytes(ROSBAGS.serialize_cdr(theirs, message.ros_type, little_endian=False))
    assert big_endian[:4] == b"\0\0\0\0"
    assert encode(decode(message.ros_type, big_endian)) == data


@given(draw=st.data())
def test_a_cut_or_altered_message_is_refused_or_read_and_nothing_else(any_message, draw):
    message = draw.draw(any_message)
    data = bytearray(encode(message))
    cut = draw.draw(st.integers(0, len(data)))
    at = draw.draw(st.integers(0, len(data) - 1))
    data[at] = draw.draw(st.integers(0, 255))
    for hostile in (bytes(data), bytes(data[:cut])):
        try:
            decode(message.ros_type, hostile)
        except RecordingError as error:
            assert message.ros_type.split("/")[0] in str(error) or "/msg/" in str(error)  # noqa: PT017


@settings(max_examples=30)
@given(st.sampled_from(sorted(MESSAGE_CLASSES)), st.binary(max_size=300))
def test_random_bytes_are_refused_or_read_and_nothing_else(type_name, data):
    try:
        decode(type_name, b"\0\1\0\0" + data)
    except RecordingError as error:
        assert "at byte" in str(error)  # noqa: PT017


def test_known_bytes():
    message = PoseStamped(Header(Time(1, 2), "w"), Pose(Point(1.0, 2.0, 3.0), Quaternion()))
    expected = struct.pack("<4xiII2s2x7d", 1, 2, 2, b"w\0", 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)
    assert encode(message) == b"\0\1\0\0" + expected[4:]


def test_numbers_may_come_as_list_tuple_or_array_and_return_as_float64():
    given_lists = JointState(name=["a", "b"], position=[1, 2], velocity=(3.0, 4.0))
    given_arrays = JointState(name=("a", "b"), position=np.array([1.0, 2.0]), velocity=np.array([3, 4]))
    assert encode(given_lists) == encode(given_arrays)
    assert given_lists == given_arrays
    position = decode(JointState.ros_type, encode(given_lists)).position
    assert position.dtype == np.float64
    assert position.flags.aligned
    assert position.flags.writeable


def test_a_6x6_covariance_is_written_row_by_row():
    square = np.arange(36.0).reshape(6, 6)
    flat = PoseWithCovariance(covariance=tuple(range(36)))
    assert encode(PoseWithCovariance(covariance=square)) == encode(flat)
    assert encode(PoseWithCovariance(covariance=np.asfortranarray(square))) == encode(flat)


def test_nan_marks_a_marker_that_was_not_seen():
    unseen = PoseArray(poses=[Pose(position=Point(math.nan, math.inf, -math.inf))])
    position = decode(PoseArray.ros_type, encode(unseen)).poses[0].position
    assert math.isnan(position.x)
    assert (position.y, position.z) == (math.inf, -math.inf)


def test_messages_compare_by_content():
    assert Odometry() == Odometry()
    assert Odometry() != Odometry(child_frame_id="base")
    assert JointState(position=[math.nan]) == JointState(position=np.array([math.nan]))
    assert Point() != Quaternion()
    assert Float64MultiArray(data=[1.0]) != Float64MultiArray(data=[1.0, 2.0])


def test_an_empty_text_without_its_nul_is_read():
    assert decode(String.ros_type, b"\0\1\0\0\0\0\0\0") == String("")


@pytest.mark.parametrize(
    ("type_name", "data", "says"),
    [
        ("sensor_msgs/msg/JointState", encode(JointState())[:-1], "JointState.effort at byte 32"),
        ("geometry_msgs/msg/Point", b"\0\1\0\0" + bytes(23), "geometry_msgs/msg/Point.x at byte 4"),
        ("std_msgs/msg/String", b"\0\1\0\0\xff\xff\xff\xffabc", "claims 4294967295 elements"),
        ("std_msgs/msg/String", b"\0\1\0\0\3\0\0\0abc", "does not end in NUL"),
        ("std_msgs/msg/String", b"\0\1\0\0\3\0\0\0\xff\xfe\0", "at byte 8: the text is not UTF-8"),
        ("std_msgs/msg/String", b"\0\7\0\0\1\0\0\0\0", "plain CDR"),
        ("std_msgs/msg/String", b"", "nothing"),
        ("std_msgs/msg/Nonsense", b"\0\1\0\0", "is not known here; known are builtin_interfaces/msg/Duration"),
    ],
)
def test_bad_bytes_are_refused_by_type_field_and_offset(type_name, data, says):
    with pytest.raises(RecordingError) as caught:
        decode(type_name, data)
    assert says in str(caught.value)


@pytest.mark.parametrize("cls", MESSAGE_CLASSES.values(), ids=lambda cls: cls.__name__)
def test_a_huge_claimed_length_is_refused_before_anything_is_allocated(cls):
    for at, field in enumerate(fields_of(cls)):
        counted = field.element is STRING or (field.is_array and field.length is None)
        if counted and at == 0:
            with pytest.raises(RecordingError, match="claims 4294967295 elements"):
                decode(cls.ros_type, b"\0\1\0\0\xff\xff\xff\xff" + bytes(64))


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (Time(sec=2**31), "builtin_interfaces/msg/Time.sec"),
        (Time(nanosec=-1), "builtin_interfaces/msg/Time.nanosec"),
        (Header(stamp=Time(sec=1.5)), "std_msgs/msg/Header.stamp.sec"),
        (Header(stamp=None), "std_msgs/msg/Header: a nested message has the wrong type"),
        (Header(frame_id=None), "std_msgs/msg/Header.frame_id"),
        (Header(frame_id="a\0b"), "text without NUL"),
        (Header(frame_id="\ud800"), "UTF-8"),
        (DiagnosticStatus(level=256), "DiagnosticStatus.level"),
        (JointState(name="joint"), "a sequence of texts"),
        (JointState(position=1.0), "a one-dimensional sequence of numbers"),
        (JointState(position=[[1.0]]), "a one-dimensional sequence of numbers"),
        (JointState(position=["x"]), "sensor_msgs/msg/JointState.position"),
        (PoseWithCovariance(covariance=[0.0] * 35), "36 numbers"),
        (PoseArray(poses=None), "a sequence of messages"),
        (PoseArray(poses=[Point()]), "geometry_msgs/msg/Pose: a nested message has the wrong type"),
        (MarkerArray([Marker(points=[Point("x")])]), "geometry_msgs/msg/Point.x"),
        (Float64MultiArray(MultiArrayLayout(data_offset=-1)), "Float64MultiArray.layout.data_offset"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_by_type_and_field(message, says):
    with pytest.raises(RecordingError) as caught:
        encode(message)
    assert says in str(caught.value)
