"""Reading a bag in the order in which its messages were logged, within bounded memory.

Blocks (chunks) are loaded only when their time has come: a heap holds the next message of each loaded block, and a
block is loaded before any message that is not earlier than its first is given out.
"""

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator
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
            raise RecordingError(f"{path} holds no messages" + (f": {self.loss}" if self.loss else ""))

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
            self.topics[channel.topic] = known._replace(count=count)

    def require_topic(self, name: str, *types: str) -> Topic:
        """Return a topic that is there, in CDR and, if types are given, of one of them; else RecordingError."""
        if name not in self.topics:
            raise RecordingError(f"{self.path} has no topic {name}; it has {', '.join(self.topics)}")
        topic = self.topics[name]
        if topic.encoding != "cdr":
            raise RecordingError(f"topic {name} of {self.path} is encoded as {topic.encoding!r}; only cdr is read")
        if types and topic.type not in types:
            raise RecordingError(f"topic {name} of {self.path} holds {topic.type}; valid is {' or '.join(types)}")
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
        # Of each file, what the channels say: topic and type, or None for a channel that is not wanted.
        channels = {
            file.path: {
                channel.id: (channel.topic, self.topics[channel.topic].type) if channel.topic in wanted else None
                for channel in file.channels.values()
            }
            for file in self._files
        }
        seen: Counter[Path] = Counter()
        for block, log_time, (channel_id, data) in _by_log_time([b for file in self._files for b in file.blocks]):
            seen[block.path] += 1
            try:
                channel = channels[block.path][channel_id]
            except KeyError:
                raise corrupt(block.path, block.offset, f"a message names unknown channel {channel_id}") from None
            if channel:
                yield Record(channel[0], log_time, channel[1], data)
        for file in self._files:
            if seen[file.path] != file.message_counts.total():
                written = file.message_counts.total()
                raise corrupt(file.path, 0, f"{written} messages were written, {seen[file.path]} are there")


def open_bag(path: str | Path) -> BagReader:
    """Open a rosbag2 folder or a bare .mcap file.

    Raises RecordingError, in one sentence, if it is missing, empty, corrupt, of another storage or compressed by
    message. A bag that its recorder did not close is opened, and `loss` says what is missing.
    """
    return BagReader(Path(path))


def _by_log_time(blocks: list[Block]) -> Iterator[tuple[Block, int, tuple[int, bytes]]]:
    """Merge blocks: (block, log time, (channel id, data)) by log time, then by order of blocks and in the block."""
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
                raise corrupt(block.path, block.offset, f"more than {MAXIMUM_HELD_BYTES} bytes of chunks overlap in time")
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
