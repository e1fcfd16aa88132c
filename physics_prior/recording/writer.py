"""Writing a bag as rosbag2 (ROS 2 Jazzy) lays it out, reproducible bit for bit and never half-written."""

import os
import secrets
import shutil
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from mcap.writer import CompressionType, Writer

from physics_prior.errors import RecordingError
from physics_prior.recording.bag import METADATA_FILE, Topic, describe, offered_qos, to_yaml
from physics_prior.recording.cdr import encode
from physics_prior.recording.definitions import message_class, schema_text, type_hash
from physics_prior.recording.wire import Message

CHUNK_BYTES = 768 * 1024  # rosbag2's own
LIBRARY = "physics_prior"
MAXIMUM_TIME_NS = 2**63 - 1
COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}


class BagWriter:
    """Writes folder `path` with one MCAP file and metadata.yaml; use as a context manager.

    Everything goes to a temporary folder beside `path`, which takes its place when the block ends without an
    error and is removed when it does not. Checksums cover every byte. The same calls give the same bytes.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        compression: Literal["zstd", "lz4", "none"] = "zstd",
        overwrite: bool = False,
    ):
        if compression not in COMPRESSIONS:
            valid = ", ".join(COMPRESSIONS)
            raise RecordingError(f"compression {compression!r} is not known; valid are {valid}")
        self.path = Path(os.path.abspath(path))
        self._overwrite = overwrite
        self._refuse_what_must_stay()
        self._file_name = f"{self.path.name}_0.mcap"
        self._compression = COMPRESSIONS[compression]
        self._topics: dict[str, Topic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[type[Message], int] = {}
        self._hashes: dict[str, str] = {}
        self._span_ns: tuple[int, int] | None = None

    def _refuse_what_must_stay(self) -> None:
        if not os.path.lexists(self.path):
            return
        if not self._overwrite:
            raise RecordingError(f"{self.path} exists; choose another name or allow overwriting")
        if not _is_bag(self.path):
            raise RecordingError(f"{self.path} is not a bag and is not overwritten; choose another name")

    def __enter__(self) -> Self:
        self._partial = self.path.with_name(f".{self.path.name}.{secrets.token_hex(4)}.partial")
        try:
            self._partial.mkdir(parents=True)
            self._stream = (self._partial / self._file_name).open("wb")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be written: {error.strerror}") from error
        self._writer = Writer(
            self._stream,
            chunk_size=CHUNK_BYTES,
            compression=self._compression,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile="ros2", library=LIBRARY)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish()
        except OSError as failure:
            raise RecordingError(f"{self.path} cannot be written: {failure.strerror}") from failure
        finally:
            self._stream.close()
            shutil.rmtree(self._partial, ignore_errors=True)

    def add_topic(self, name: str, message_type: str | type[Message]) -> None:
        """Announce a topic of a message class or ROS type name. Topics without messages are filed too."""
        cls = message_class(message_type) if isinstance(message_type, str) else message_type
        if name in self._topics:
            known = self._topics[name].type
            if known != cls.ros_type:
                raise RecordingError(f"topic {name} is already of type {known}, not {cls.ros_type}")
            return
        if cls not in self._schemas:
            text = schema_text(cls).encode()
            self._schemas[cls] = self._writer.register_schema(cls.ros_type, "ros2msg", text)
        self._hashes[name] = type_hash(cls)
        self._channels[name] = self._writer.register_channel(
            name,
            "cdr",
            self._schemas[cls],
            {"offered_qos_profiles": to_yaml(offered_qos()), "topic_type_hash": self._hashes[name]},
        )
        self._topics[name] = Topic(cls.ros_type, 0)

    def write(self, topic: str, message: Message | bytes, log_time_ns: int) -> None:
        """File a message, or its CDR bytes, on an announced topic, logged at a time [ns since the epoch]."""
        if topic not in self._topics:
            announced_topics = ", ".join(self._topics) or "none"
            raise RecordingError(f"topic {topic} was not announced; announced are {announced_topics}")
        announced = self._topics[topic]
        if isinstance(message, Message) and message.ros_type != announced.type:
            raise RecordingError(f"topic {topic} takes {announced.type}, not {message.ros_type}")
        if not 0 <= log_time_ns <= MAXIMUM_TIME_NS:
            raise RecordingError(f"log time {log_time_ns} ns on {topic} is not in [0, {MAXIMUM_TIME_NS}]")
        data = encode(message) if isinstance(message, Message) else message
        self._writer.add_message(self._channels[topic], log_time_ns, data, publish_time=log_time_ns)
        self._topics[topic] = replace(announced, count=announced.count + 1)
        first, last = self._span_ns or (log_time_ns, log_time_ns)
        self._span_ns = (min(first, log_time_ns), max(last, log_time_ns))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """File an MCAP metadata record: named texts that travel with the recording."""
        self._writer.add_metadata(name, values)

    def _finish(self) -> None:
        information = describe([self._file_name], self._topics, self._hashes, self._span_ns)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": to_yaml(information)})
        self._writer.finish()
        self._stream.close()
        described = to_yaml({"rosbag2_bagfile_information": information})
        (self._partial / METADATA_FILE).write_text(described, "utf-8")
        self._refuse_what_must_stay()
        if os.path.lexists(self.path):
            replaced = self._partial.with_suffix(".replaced")
            self.path.rename(replaced)
            self._partial.rename(self.path)
            shutil.rmtree(replaced)
        else:
            self._partial.rename(self.path)


def _is_bag(path: Path) -> bool:
    """Whether a folder holds a bag and nothing else, so that overwriting it loses nothing else."""
    if path.is_symlink() or not path.is_dir():
        return False
    names = [entry.name for entry in path.iterdir()]
    return METADATA_FILE in names and all(name == METADATA_FILE or name.endswith(".mcap") for name in names)
