"""Schema texts and type hashes against rosbags, which parses and hashes them on its own, and as published."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from physics_prior.errors import RecordingError
from physics_prior.recording.definitions import message_class, schema_text, type_hash
from physics_prior.recording.messages import JointState, Marker, PoseStamped, Quaternion
from physics_prior.recording.wire import MESSAGE_CLASSES

JAZZY = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize("cls", MESSAGE_CLASSES.values(), ids=lambda cls: cls.__name__)
def test_schema_text_defines_the_type_as_rosbags_knows_it(cls):
    for name, (constants, fields) in get_types_from_msg(schema_text(cls), cls.ros_type).items():
        known_constants, known_fields = JAZZY.fielddefs[name]
        dummy = "structure_needs_at_least_one_member"  # of an empty message: on the wire, not in the text
        assert list(fields) == [field for field in known_fields if field[0] != dummy]
        assert list(constants) == list(known_constants)


@pytest.mark.parametrize("cls", MESSAGE_CLASSES.values(), ids=lambda cls: cls.__name__)
def test_type_hash_is_the_one_that_rosbags_computes(cls):
    assert type_hash(cls) == JAZZY.hash_rihs01(cls.ros_type)


@pytest.mark.parametrize(
    ("cls", "published"),
    [  # as recorded by rosbag2 from a Jazzy graph
        (PoseStamped, "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"),
        (JointState, "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"),
    ],
)
def test_type_hash_is_the_published_one(cls, published):
    assert type_hash(cls) == published


def test_schema_text_is_laid_out_as_rosbag2_does():
    bar = "=" * 80
    assert schema_text(PoseStamped) == (
        "std_msgs/Header header\nPose pose\n"
        f"\n{bar}\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n"
        f"\n{bar}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
        f"\n{bar}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w 1\n"
        f"\n{bar}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"\n{bar}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )


def test_constants_belong_to_the_type():
    assert schema_text(Marker).startswith("int32 ARROW=0\nint32 CUBE=1\n")
    assert Marker.DELETEALL == 3


def test_class_by_type_name():
    assert message_class("geometry_msgs/msg/Quaternion") is Quaternion
    with pytest.raises(RecordingError, match="'geometry_msgs/Quaternion' is not known here; known are builtin"):
        message_class("geometry_msgs/Quaternion")
