"""The ROS 2 (Jazzy) messages that this program reads and writes, usable without ROS.

Names, order and units of the fields are those of the ROS interface packages named in each decorator.
Quaternions are (x, y, z, w) here and nowhere else. Number arrays may be given as any sequence or array;
`cdr.decode` returns float64 arrays. Covariances are 6x6 row-major over (x, y, z, rotation about X, Y, Z).
"""

from collections.abc import Sequence
from dataclasses import field
from typing import ClassVar

from physics_prior.recording.wire import (
    Message,
    boolean,
    byte,
    float32,
    float64,
    float64_6x6,
    float64_sequence,
    int32,
    message,
    string,
    uint8_sequence,
    uint32,
)

ZERO_6X6 = (0.0,) * 36


@message("builtin_interfaces")
class Time(Message):
    """A point in time: seconds and nanoseconds in [0, 1e9)."""

    sec: int32 = 0
    nanosec: uint32 = 0


@message("builtin_interfaces")
class Duration(Message):
    """A span of time: seconds and nanoseconds in [0, 1e9)."""

    sec: int32 = 0
    nanosec: uint32 = 0


@message("std_msgs")
class Header(Message):
    """When and in which frame something was so."""

    stamp: Time = field(default_factory=Time)
    frame_id: string = ""


@message("std_msgs")
class ColorRGBA(Message):
    """A colour; components and opacity in [0, 1]."""

    r: float32 = 0.0
    g: float32 = 0.0
    b: float32 = 0.0
    a: float32 = 0.0


@message("std_msgs")
class String(Message):
    """A text."""

    data: string = ""


@message("std_msgs")
class Empty(Message):
    """Nothing; its being sent is the message."""


@message("std_msgs")
class Float64(Message):
    """A number."""

    data: float64 = 0.0


@message("std_msgs")
class MultiArrayDimension(Message):
    """One dimension of an array: label, size, stride."""

    label: string = ""
    size: uint32 = 0
    stride: uint32 = 0


@message("std_msgs")
class MultiArrayLayout(Message):
    """The dimensions of an array, outermost first."""

    dim: Sequence[MultiArrayDimension] = ()
    data_offset: uint32 = 0


@message("std_msgs")
class Float64MultiArray(Message):
    """An array of numbers with its layout."""

    layout: MultiArrayLayout = field(default_factory=MultiArrayLayout)
    data: float64_sequence = ()


@message("geometry_msgs")
class Point(Message):
    """A position [m]."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@message("geometry_msgs")
class Vector3(Message):
    """A direction or free vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@message("geometry_msgs")
class Quaternion(Message):
    """An orientation, scalar last."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@message("geometry_msgs")
class Pose(Message):
    """Position [m] and orientation."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@message("geometry_msgs")
class PoseStamped(Message):
    """A pose with time and frame."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@message("geometry_msgs")
class PoseWithCovariance(Message):
    """A pose and its covariance [m, rad]."""

    pose: Pose = field(default_factory=Pose)
    covariance: float64_6x6 = ZERO_6X6


@message("geometry_msgs")
class PoseWithCovarianceStamped(Message):
    """A pose and its covariance [m, rad] with time and frame."""

    header: Header = field(default_factory=Header)
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)


@message("geometry_msgs")
class PoseArray(Message):
    """Several poses at one time in one frame."""

    header: Header = field(default_factory=Header)
    poses: Sequence[Pose] = ()


@message("geometry_msgs")
class Transform(Message):
    """Translation [m] and rotation."""

    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@message("geometry_msgs")
class TransformStamped(Message):
    """Where `child_frame_id` is in the header's frame."""

    header: Header = field(default_factory=Header)
    child_frame_id: string = ""
    transform: Transform = field(default_factory=Transform)


@message("tf2_msgs")
class TFMessage(Message):
    """Several frames, as the transform tree takes them."""

    transforms: Sequence[TransformStamped] = ()


@message("geometry_msgs")
class Twist(Message):
    """Linear [m/s] and angular [rad/s] velocity."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@message("geometry_msgs")
class TwistWithCovariance(Message):
    """A twist and its covariance [m/s, rad/s]."""

    twist: Twist = field(default_factory=Twist)
    covariance: float64_6x6 = ZERO_6X6


@message("geometry_msgs")
class Wrench(Message):
    """Force [N] and torque [N m]."""

    force: Vector3 = field(default_factory=Vector3)
    torque: Vector3 = field(default_factory=Vector3)


@message("geometry_msgs")
class WrenchStamped(Message):
    """A wrench with time and frame."""

    header: Header = field(default_factory=Header)
    wrench: Wrench = field(default_factory=Wrench)


@message("nav_msgs")
class Odometry(Message):
    """Pose of `child_frame_id` in the header's frame, and its twist in `child_frame_id`."""

    header: Header = field(default_factory=Header)
    child_frame_id: string = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@message("sensor_msgs")
class JointState(Message):
    """Joints of one degree of freedom: position [rad, m], velocity [rad/s, m/s], effort [N m, N]."""

    header: Header = field(default_factory=Header)
    name: Sequence[string] = ()
    position: float64_sequence = ()
    velocity: float64_sequence = ()
    effort: float64_sequence = ()


@message("sensor_msgs")
class MultiDOFJointState(Message):
    """Joints of several degrees of freedom: transform, twist and wrench of each."""

    header: Header = field(default_factory=Header)
    joint_names: Sequence[string] = ()
    transforms: Sequence[Transform] = ()
    twist: Sequence[Twist] = ()
    wrench: Sequence[Wrench] = ()


@message("sensor_msgs")
class CompressedImage(Message):
    """An image file; here only because a Marker may carry one."""

    header: Header = field(default_factory=Header)
    format: string = ""
    data: uint8_sequence = b""


@message("diagnostic_msgs")
class KeyValue(Message):
    """A named value."""

    key: string = ""
    value: string = ""


@message("diagnostic_msgs")
class DiagnosticStatus(Message):
    """The health of one component."""

    OK: ClassVar[byte] = 0
    WARN: ClassVar[byte] = 1
    ERROR: ClassVar[byte] = 2
    STALE: ClassVar[byte] = 3
    level: byte = 0
    name: string = ""
    message: string = ""
    hardware_id: string = ""
    values: Sequence[KeyValue] = ()


@message("diagnostic_msgs")
class DiagnosticArray(Message):
    """The health of several components at one time."""

    header: Header = field(default_factory=Header)
    status: Sequence[DiagnosticStatus] = ()


@message("visualization_msgs")
class UVCoordinate(Message):
    """A place in a texture, both in [0, 1]."""

    u: float32 = 0.0
    v: float32 = 0.0


@message("visualization_msgs")
class MeshFile(Message):
    """A mesh file carried in the message."""

    filename: string = ""
    data: uint8_sequence = b""


@message("visualization_msgs")
class Marker(Message):
    """One drawn thing: shape, arrow, line, text or mesh [m]."""

    ARROW: ClassVar[int32] = 0
    CUBE: ClassVar[int32] = 1
    SPHERE: ClassVar[int32] = 2
    CYLINDER: ClassVar[int32] = 3
    LINE_STRIP: ClassVar[int32] = 4
    LINE_LIST: ClassVar[int32] = 5
    CUBE_LIST: ClassVar[int32] = 6
    SPHERE_LIST: ClassVar[int32] = 7
    POINTS: ClassVar[int32] = 8
    TEXT_VIEW_FACING: ClassVar[int32] = 9
    MESH_RESOURCE: ClassVar[int32] = 10
    TRIANGLE_LIST: ClassVar[int32] = 11
    ARROW_STRIP: ClassVar[int32] = 12
    ADD: ClassVar[int32] = 0
    MODIFY: ClassVar[int32] = 0
    DELETE: ClassVar[int32] = 2
    DELETEALL: ClassVar[int32] = 3
    header: Header = field(default_factory=Header)
    ns: string = ""
    id: int32 = 0
    type: int32 = 0
    action: int32 = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = field(default_factory=Vector3)
    color: ColorRGBA = field(default_factory=ColorRGBA)
    lifetime: Duration = field(default_factory=Duration)
    frame_locked: boolean = False
    points: Sequence[Point] = ()
    colors: Sequence[ColorRGBA] = ()
    texture_resource: string = ""
    texture: CompressedImage = field(default_factory=CompressedImage)
    uv_coordinates: Sequence[UVCoordinate] = ()
    text: string = ""
    mesh_resource: string = ""
    mesh_file: MeshFile = field(default_factory=MeshFile)
    mesh_use_embedded_materials: boolean = False


@message("visualization_msgs")
class MarkerArray(Message):
    """Several markers that belong together."""

    markers: Sequence[Marker] = ()
