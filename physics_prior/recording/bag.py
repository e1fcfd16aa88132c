"""The rosbag2 folder (ROS 2 Jazzy): NAME/ with NAME_0.mcap, ... and metadata.yaml, read and described."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from physics_prior.errors import RecordingError

METADATA_FILE = "metadata.yaml"
METADATA_VERSION = 9
MAXIMUM_METADATA_BYTES = 16 * 2**20
NEVER_NS = 2**63 - 1  # what rosbag2 files as the start of a bag without messages, and as an infinite deadline
NANOSECONDS = 10**9


@dataclass(frozen=True, slots=True)
class Topic:
    """A recorded topic: ROS message type (``pkg/msg/Type``), number of messages, encoding of their data."""

    type: str
    count: int
    encoding: str = "cdr"


@dataclass(frozen=True)
class BagFiles:
    """The files of a bag in order; `loss` says what is missing of its description."""

    paths: tuple[Path, ...]
    loss: str | None = None


def find_files(path: Path) -> BagFiles:
    """Return the MCAP files of a bag folder or of a bare .mcap. RecordingError names what is wrong."""
    if path.is_file():
        return BagFiles((path,))
    if not path.is_dir():
        raise RecordingError(f"{path} does not exist; give a bag folder or an .mcap file")
    metadata = path / METADATA_FILE
    if metadata.is_file():
        return BagFiles(_listed_files(path, _read_metadata(metadata)))
    # rosbag2 writes metadata.yaml last: a recorder that was killed leaves only its files, numbered from 0.
    found = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not found:
        raise RecordingError(f"{path} is not a bag: it holds neither {METADATA_FILE} nor an .mcap file")
    loss = f"{path} has no {METADATA_FILE}, its recorder was killed: its .mcap files are read"
    return BagFiles(tuple(found), loss)


def _read_metadata(file: Path) -> dict[str, Any]:
    try:
        with file.open("rb") as stream:
            text = stream.read(MAXIMUM_METADATA_BYTES + 1)
        if len(text) > MAXIMUM_METADATA_BYTES:
            raise RecordingError(f"{file} of {MAXIMUM_METADATA_BYTES} bytes or more describes no bag")
        information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    except OSError as error:
        raise RecordingError(f"{file} cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise RecordingError(f"{file} does not describe a bag: {reason}") from error
    if not isinstance(information, dict):
        raise RecordingError(f"{file} does not describe a bag: rosbag2_bagfile_information must be a mapping")
    return information


def _listed_files(folder: Path, information: dict[str, Any]) -> tuple[Path, ...]:
    storage = information.get("storage_identifier")
    if storage != "mcap":
        raise RecordingError(
            f"{folder} is stored as {storage!r}; only mcap is read: convert it with `ros2 bag convert`"
        )
    mode = information.get("compression_mode") or "none"
    if str(mode).lower() != "none":
        raise RecordingError(
            f"{folder} has compression_mode {mode}: only compression by chunk, inside the MCAP file, is read;"
            " convert it with `ros2 bag convert`"
        )
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise RecordingError(f"{folder / METADATA_FILE} must list relative_file_paths, not {names!r}")
    for name in names:
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts:
            raise RecordingError(f"{folder / METADATA_FILE} lists {name!r}, which is not inside the bag")
        if not (folder / name).is_file():
            raise RecordingError(f"{folder} lacks {name}, which its {METADATA_FILE} lists")
    return tuple(folder / name for name in names)


def offered_qos() -> list[dict[str, Any]]:
    """Quality of service as rosbag2 files it for a reliable, volatile publisher without deadlines."""
    never = {"sec": NEVER_NS // NANOSECONDS, "nsec": NEVER_NS % NANOSECONDS}
    return [
        {
            "history": "unknown",
            "depth": 0,
            "reliability": "reliable",
            "durability": "volatile",
            "deadline": dict(never),
            "lifespan": dict(never),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(never),
            "avoid_ros_namespace_conventions": False,
        }
    ]


def describe(
    file_names: Sequence[str],
    topics: Mapping[str, Topic],
    hashes: Mapping[str, str],
    span_ns: tuple[int, int] | None,
) -> dict[str, Any]:
    """Return the rosbag2_bagfile_information of a bag of one file; `span_ns` is None without messages."""
    first, last = span_ns or (NEVER_NS, NEVER_NS)
    count = sum(topic.count for topic in topics.values())
    span = {
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": count,
    }
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        **span,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": name,
                    "type": topic.type,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": offered_qos(),
                    "type_description_hash": hashes[name],
                },
                "message_count": topic.count,
            }
            for name, topic in topics.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(file_names),
        "files": [{"path": name, **span} for name in file_names],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


class _PlainDumper(yaml.SafeDumper):
    """Repeats equal parts instead of referring to the first, as rosbag2 does."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def to_yaml(content: Any) -> str:
    """Return YAML in the order given, without anchors."""
    text: str = yaml.dump(content, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=2**20)
    return text
