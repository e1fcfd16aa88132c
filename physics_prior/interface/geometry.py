"""Points, vectors, quaternions, poses and wrenches as messages have them, from arrays and back."""

import numpy as np

from physics_prior.recording.messages import (
    Header,
    Point,
    Pose,
    Quaternion,
    Time,
    Vector3,
    Wrench,
)

NANOSECONDS = 10**9  # a second


def header_of(stamp: int, frame_id: str) -> Header:
    """Return a header from a stamp in ns."""
    return Header(Time(*divmod(stamp, NANOSECONDS)), frame_id)


def point_of(array: np.ndarray) -> Point:
    """Return a position (3,) m as a Point."""
    return Point(*array.tolist())


def vector_of(array: np.ndarray) -> Vector3:
    """Return a free vector (3,) as a Vector3."""
    return Vector3(*array.tolist())


def quaternion_of(wxyz: np.ndarray) -> Quaternion:
    """Return a unit quaternion (4,) w, x, y, z, scalar first, as messages have it, scalar last."""
    w, x, y, z = wxyz.tolist()
    return Quaternion(x, y, z, w)


def pose_of(position: np.ndarray, wxyz: np.ndarray) -> Pose:
    """Return position (3,) m and orientation (4,) w, x, y, z as a Pose."""
    return Pose(point_of(position), quaternion_of(wxyz))


def wrench_of(force: np.ndarray, moment: np.ndarray) -> Wrench:
    """Return force (3,) N and moment (3,) N m as a Wrench."""
    return Wrench(vector_of(force), vector_of(moment))


def array_of(point: Point | Vector3) -> np.ndarray:
    """Return the coordinates (3,) of a point or vector."""
    return np.array([point.x, point.y, point.z])


def wxyz_of(quaternion: Quaternion) -> np.ndarray:
    """Return the components (4,) of a quaternion, scalar first."""
    return np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
