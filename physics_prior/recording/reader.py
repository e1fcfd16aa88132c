"""Reading a bag in the order in which its messages were logged, within bounded memory.

Blocks (chunks) are loaded only when their time has come: a heap holds the next message of each loaded block,
and a block is loaded before any message that is not earlier than its first is given out.
"""

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from physics_prior.errors import RecordingError
from physics_prior.recording.bag import Topic, find_files
from physics_prior.recording.mcap_file import Block, LoadedBlock, McapFile, corrupt, scan

MAXIMUM_HELD_BYTES = 2**30  # of blocks whose time spans overlap


class Record(NamedTuple):
    """A recorded message: topic, time it was logged [ns], ROS type name, CDR bytes (`cdr.decode`)."""

    topic: str
    log_time_ns: int
    message_type: str
    data: bytes


class BagReader:
    """A bag: its topics, its metadata records, its messages in log-time order."""

    def __init__(self, path: Path):
        self.path = path
        files = find_files(path)
        self._files = [scan(file) for file in files.paths]
        losses = [files.loss, *(file.loss for file in self._files)]
        self.loss: str | None = "; ".join(filter(None, losses)) or None
        """What could not be read of a bag that was not closed, as a sentence; None if the bag is whole."""
        self.metadata_records: dict[str, dict[str, str]] = {
            record.name: record.metadata for file in self._files for record in file.metadata
        }
        """MCAP metadata records by name; of several with one name the last."""
        self.topics: dict[str, Topic] = {}
        """Topic name to type, number of messages and encoding, in the order of recording."""
        for file in self._files:
            self._add_topics(file)
        if not any(topic.count for topic in self.topics.values()):
            what = f"nothing is left to read: {self.loss}" if self.loss else f"{path} holds no messages"
            raise RecordingError(what)

    def _add_topics(self, file: McapFile) -> None:
        for channel in sorted(file.channels.values(), key=lambda channel: channel.id):
            schema = file.schemas.get(channel.schema_id)
            type_name = schema.name if schema else ""
            known = self.topics.get(channel.topic, Topic(type_name, 0, channel.message_encoding))
            if (known.type, known.encoding) != (type_name, channel.message_encoding):
                raise RecordingError(
                    f"{self.path} holds topic {channel.topic} both as {known.type} ({known.encoding}) and as"
                    f" {type_name} ({channel.message_encoding}); a topic must have one type"
                )
            count = known.count + file.message_counts[channel.id]
            self.topics[channel.topic] = replace(known, count=count)

    def require_topic(self, name: str, *types: str) -> Topic:
        """Return a topic that is there, is CDR and of one of the types, if any; else RecordingError."""
        if name not in self.topics:
            raise RecordingError(f"{self.path} has no topic {name}; it has {', '.join(self.topics)}")
        topic = self.topics[name]
        if topic.encoding != "cdr":
            raise RecordingError(f"topic {name} of {self.path} is encoded as {topic.encoding!r}, not as cdr")
        if types and topic.type not in types:
            valid = " or ".join(types)
            raise RecordingError(f"topic {name} of {self.path} holds {topic.type}; valid is {valid}")
        return topic

    def read(self, topics: Iterable[str] | None = None) -> Iterator[Record]:
        """Iterate over the messages of some topics, or of all, by log time; equal times in file order.

        Raises RecordingError at once for a topic that is missing or not CDR, and on the way for corrupt data.
        """
        wanted = self.topics if topics is None else set(topics)
        for name in wanted:
            self.require_topic(name)
        return self._records(wanted)

    def _records(self, wanted: Iterable[str]) -> Iterator[Record]:
        channels = {file.path: {c.id: c.topic for c in file.channels.values()} for file in self._files}
        blocks = [block for file in self._files for block in file.blocks]
        seen: Counter[Path] = Counter()
        for block, log_time, (channel_id, data) in _by_log_time(blocks):
            seen[block.path] += 1
            topic = channels[block.path].get(channel_id)
            if topic is None:
                raise corrupt(block.path, block.offset, f"a message names unknown channel {channel_id}")
            if topic in wanted:
                yield Record(topic, log_time, self.topics[topic].type, data)
        for file in self._files:
            if seen[file.path] != file.message_counts.total():
                written = file.message_counts.total()
                raise corrupt(file.path, 0, f"{written} messages were written, {seen[file.path]} are there")


def open_bag(path: str | Path) -> BagReader:
    """Open a rosbag2 folder or a bare .mcap file.

    Raises RecordingError, in one sentence, if it is missing, empty, corrupt, of another storage or
    compressed by message. A bag that its recorder did not close is opened, and `loss` says what is missing.
    """
    return BagReader(Path(path))


def _by_log_time(blocks: list[Block]) -> Iterator[tuple[Block, int, tuple[int, bytes]]]:
    """Merge blocks: (block, log time, (channel id, data)) by log time, then by order of blocks and in each."""
    pending = sorted(range(len(blocks)), key=lambda number: blocks[number].start_ns, reverse=True)
    heads: list[tuple[int, int, int]] = []  # log time, number of the block, index in it
    loaded: dict[int, LoadedBlock] = {}
    held_bytes = 0
    while pending or heads:
        while pending and (not heads or blocks[pending[-1]].start_ns <= heads[0][0]):
            number = pending.pop()
            block = blocks[number]
            held_bytes += block.size
            if held_bytes > MAXIMUM_HELD_BYTES:
                what = f"more than {MAXIMUM_HELD_BYTES} bytes of chunks overlap in time"
                raise corrupt(block.path, block.offset, what)
            loaded[number] = block.load()
            if loaded[number].log_times:
                heapq.heappush(heads, (loaded[number].log_times[0], number, 0))
        if not heads:
            continue
        log_time, number, index = heads[0]
        yield blocks[number], log_time, loaded[number].message(index)
        index += 1
        if index < len(loaded[number].log_times):
            heapq.heapreplace(heads, (loaded[number].log_times[index], number, index))
        else:
            heapq.heappop(heads)
            del loaded[number]
            held_bytes -= blocks[number].size
