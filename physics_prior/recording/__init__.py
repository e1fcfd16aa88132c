"""Recordings without ROS: messages, their CDR bytes, and MCAP bags as rosbag2 writes them.

`open_bag` reads, `BagWriter` writes; `encode` and `decode` turn messages into the bytes that ROS sends and
back.
"""

from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.reader import BagReader, Record, open_bag
from physics_prior.recording.writer import BagWriter

__all__ = ["BagReader", "BagWriter", "Record", "decode", "encode", "open_bag"]
