"""One MCAP file as blocks of messages, bounds and checksums checked before anything is believed.

`scan` walks the records at the top level, skipping over the contents of chunks, so that whole, unindexed and
cut-off files are read the same way and nothing is taken from an index that may be wrong. `Block.load` then
reads the messages of one chunk. Format: https://mcap.dev/spec.
"""

import struct
import zlib
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from physics_prior.errors import RecordingError

MAXIMUM_CHUNK_BYTES = 256 * 2**20  # of one chunk or record, uncompressed; rosbag2 writes chunks of 0.75 MiB
BARE_BLOCK_BYTES = 2**20  # messages that stand outside of chunks are read in blocks of about this size
RECORD_HEADER = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEADER = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
CHUNK_HEADER = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, length of the compression's name
CHANNEL_ID = struct.Struct("<H")
CRC_PIECE_BYTES = 2**20
FIRST_PRIVATE_OPCODE = 0x80


def corrupt(path: Path, offset: int, what: str) -> RecordingError:
    """Return the error for a file that is not what it claims to be, near a byte offset."""
    return RecordingError(f"{path} is corrupt near byte {offset}: {what}; copy it anew or try `mcap recover`")


@contextmanager
def foreign_errors(path: Path, offset: Callable[[], int]) -> Iterator[None]:
    """Re-raise what the libraries raise on bad bytes, which is no family of exceptions, as RecordingError."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from error
    except (McapError, zstandard.ZstdError, struct.error, ValueError, RuntimeError, MemoryError) as error:
        raise corrupt(path, offset(), str(error) or type(error).__name__) from error


class LoadedBlock:
    """The messages of one block in log-time order, equal times in file order."""

    def __init__(self, contents: bytes, log_times: "array[int]", offsets: "array[int]"):
        times = np.frombuffer(log_times, np.uint64)
        order = np.argsort(times, kind="stable")
        self._contents = contents
        self._offsets = array("Q", np.frombuffer(offsets, np.uint64)[order].tobytes())
        self.log_times = array("Q", times[order].tobytes())

    def message(self, index: int) -> tuple[int, bytes]:
        """Return channel id and data of the message that is `index`-th in time."""
        at = self._offsets[index]
        _, length = RECORD_HEADER.unpack_from(self._contents, at)
        at += RECORD_HEADER.size
        (channel_id,) = CHANNEL_ID.unpack_from(self._contents, at)
        return channel_id, self._contents[at + MESSAGE_HEADER.size : at + length]


@dataclass(frozen=True)
class Block:
    """Where messages lie: the data of one chunk, or a run of messages outside of chunks (CRC 0)."""

    path: Path
    offset: int  # of the (compressed) data in the file
    length: int
    compression: str
    size: int  # uncompressed
    crc: int
    start_ns: int
    end_ns: int

    def load(self) -> LoadedBlock:
        """Read, decompress and check this block; RecordingError where it is not what it claims to be."""
        contents = self.contents()
        log_times, offsets = array("Q"), array("Q")
        for opcode, at, _ in self.records(contents):
            if opcode == Opcode.MESSAGE:
                _, _, log_time, _ = MESSAGE_HEADER.unpack_from(contents, at)
                if not self.start_ns <= log_time <= self.end_ns:
                    what = "a message is logged outside of its chunk's time span"
                    raise corrupt(self.path, self.offset, what)
                log_times.append(log_time)
                offsets.append(at - RECORD_HEADER.size)
        return LoadedBlock(contents, log_times, offsets)

    def contents(self) -> bytes:
        """Return the uncompressed data, its size and CRC checked."""
        with foreign_errors(self.path, lambda: self.offset), self.path.open("rb") as file:
            file.seek(self.offset)
            data = decompress(file.read(self.length), self.compression, self.size)
        if len(data) != self.size:
            raise corrupt(self.path, self.offset, f"a chunk of {self.size} bytes gave {len(data)}")
        if self.crc and zlib.crc32(data) != self.crc:
            raise corrupt(self.path, self.offset, "a chunk does not match its checksum")
        return data

    def records(self, contents: bytes) -> Iterator[tuple[int, int, int]]:
        """Yield (opcode, start, end) of each record's body in the uncompressed data."""
        at = 0
        while at < len(contents):
            if at + RECORD_HEADER.size > len(contents):
                raise corrupt(self.path, self.offset, "a chunk ends inside a record's header")
            opcode, length = RECORD_HEADER.unpack_from(contents, at)
            at += RECORD_HEADER.size
            if length > len(contents) - at or (opcode == Opcode.MESSAGE and length < MESSAGE_HEADER.size):
                raise corrupt(self.path, self.offset, f"a record in a chunk claims {length} bytes")
            yield opcode, at, at + length
            at += length


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """Decompress to at most `size` + 1 bytes, whatever the data themselves claim."""
    if compression == "":
        return data
    if compression == "zstd":
        claimed = zstandard.get_frame_parameters(data).content_size
        if claimed not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f"the compressed data claim {claimed} bytes, their chunk {size}")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        contents: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        return contents
    raise ValueError(f"chunk compression {compression!r} is not known; known are zstd, lz4 and none")


@dataclass
class McapFile:
    """What a scan found; `loss` says what a recorder that was killed left unfinished."""

    path: Path
    blocks: list[Block] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    message_counts: Counter[int] = field(default_factory=Counter)  # by channel id
    loss: str | None = None


def scan(path: Path) -> McapFile:
    """Walk the records of an MCAP file; RecordingError with offset and hint if it is corrupt or none."""
    at = 0
    with foreign_errors(path, lambda: at), path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordingError(f"{path} does not begin as an MCAP file does; was it renamed or compressed?")
        size = file.seek(0, SEEK_END)
        file.seek(size - len(MCAP0_MAGIC))
        at = len(MCAP0_MAGIC)
        closed = size > at and file.read() == MCAP0_MAGIC
        walker = _Walker(file, path, size - len(MCAP0_MAGIC) if closed else size)
        while not walker.footer_seen and (following := walker.visit(at)):
            at = following
        if closed and not walker.footer_seen:
            raise ValueError("no record begins here that would end inside the file")
    found = walker.complete()
    if not walker.footer_seen:
        kept = f"{found.message_counts.total()} messages of {len(found.blocks)} whole chunks are kept"
        found.loss = (
            f"{path} was not closed by its recorder: the {size - at} bytes from byte {at} on are lost,"
            f" {'but no message' if walker.data_end_seen else kept}"
        )
    return found


class _Walker:
    """Visits one top-level record after the other."""

    def __init__(self, file: IO[bytes], path: Path, end: int):
        self._file, self._end = file, end
        self._found = McapFile(path)
        self._statistics: Statistics | None = None
        self._chunk_count = 0
        # Of the messages met outside of chunks since the last chunk: begin, end, first and last log time.
        self._bare: tuple[int, int, int, int] | None = None
        self.data_end_seen = self.footer_seen = False

    def visit(self, at: int) -> int | None:
        """Take in the record at an offset; return the next one's, None if none that is whole begins here."""
        self._file.seek(at)
        header = self._file.read(RECORD_HEADER.size)
        if len(header) < RECORD_HEADER.size:
            return None
        opcode, length = RECORD_HEADER.unpack(header)
        following: int = at + RECORD_HEADER.size + length
        known = Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= FIRST_PRIVATE_OPCODE
        if following > self._end or not known:
            return None
        if opcode not in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            self._finish_bare_block()
        self._take(opcode, at, length)
        return following

    def _take(self, opcode: int, at: int, length: int) -> None:
        found, end = self._found, at + RECORD_HEADER.size + length
        if opcode == Opcode.CHUNK:
            self._chunk_count += 1
            found.blocks.append(self._chunk(at + RECORD_HEADER.size, length))
        elif opcode == Opcode.MESSAGE:
            self._bare_message(at, end)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            _take_definition(found, opcode, self._stream(length))
        elif opcode == Opcode.METADATA:
            found.metadata.append(Metadata.read(self._stream(length)))
        elif opcode == Opcode.STATISTICS:
            self._statistics = Statistics.read(self._stream(length))
        elif opcode == Opcode.DATA_END:
            self._check_crc(0, at, DataEnd.read(self._stream(length)).data_section_crc)
            self.data_end_seen = True
        elif opcode == Opcode.FOOTER:
            footer = Footer.read(self._stream(length))
            # The summary's checksum runs on to the footer's own last field.
            self._check_crc(footer.summary_start or at, end - 4, footer.summary_crc)
            self.footer_seen = True

    def complete(self) -> McapFile:
        """Return what was found; channels and counts from the blocks themselves where there is no summary."""
        self._finish_bare_block()
        found, statistics = self._found, self._statistics
        if statistics is None or len(found.channels) < statistics.channel_count:
            for block in found.blocks:
                _count(block, found)
            return found
        written = (statistics.chunk_count, statistics.metadata_count)
        if written != (self._chunk_count, len(found.metadata)):
            raise corrupt(
                found.path,
                0,
                f"{written[0]} chunks and {written[1]} metadata records were written,"
                f" {self._chunk_count} and {len(found.metadata)} are there",
            )
        found.message_counts.update(statistics.channel_message_counts)
        return found

    def _chunk(self, body: int, length: int) -> Block:
        fixed = self._file.read(CHUNK_HEADER.size)
        start, end, size, crc, name_length = CHUNK_HEADER.unpack(fixed)
        if name_length + CHUNK_HEADER.size + 8 > length:
            raise ValueError(f"a chunk's compression has a name of {name_length} bytes")
        compression = str(self._file.read(name_length), "utf-8")
        (data_length,) = struct.unpack("<Q", self._file.read(8))
        data = body + CHUNK_HEADER.size + name_length + 8
        if data + data_length != body + length:
            raise ValueError(f"a chunk's data claim {data_length} bytes of its {length}")
        if max(size, length) > MAXIMUM_CHUNK_BYTES:
            raise _too_large(size)
        return Block(self._found.path, data, data_length, compression, size, crc, start, end)

    def _bare_message(self, at: int, end: int) -> None:
        if end - at > MAXIMUM_CHUNK_BYTES:
            raise _too_large(end - at)
        _, _, log_time, _ = MESSAGE_HEADER.unpack(self._file.read(MESSAGE_HEADER.size))
        if self._bare and end - self._bare[0] > BARE_BLOCK_BYTES:
            self._finish_bare_block()
        begin, _, first, last = self._bare or (at, at, log_time, log_time)
        self._bare = (begin, end, min(first, log_time), max(last, log_time))

    def _finish_bare_block(self) -> None:
        if self._bare:
            begin, end, first, last = self._bare
            size = end - begin
            self._found.blocks.append(Block(self._found.path, begin, size, "", size, 0, first, last))
            self._bare = None

    def _stream(self, length: int) -> ReadDataStream:
        if length > MAXIMUM_CHUNK_BYTES:
            raise _too_large(length)
        return ReadDataStream(BytesIO(self._file.read(length)))

    def _check_crc(self, start: int, end: int, claimed: int) -> None:
        if claimed == 0:
            return
        crc, at = 0, start
        self._file.seek(start)
        while at < end:
            piece = self._file.read(min(CRC_PIECE_BYTES, end - at))
            crc = zlib.crc32(piece, crc)
            at += len(piece)
        if crc != claimed:
            raise ValueError(f"bytes {start} to {end} do not match their checksum")


def _too_large(size: int) -> ValueError:
    return ValueError(f"a record or chunk of {size} bytes is above the limit of {MAXIMUM_CHUNK_BYTES}")


def _take_definition(found: McapFile, opcode: int, stream: ReadDataStream) -> None:
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        found.schemas[schema.id] = schema
    else:
        channel = Channel.read(stream)
        found.channels[channel.id] = channel


def _count(block: Block, found: McapFile) -> None:
    """Take in the definitions and the number of messages of a block."""
    contents = block.contents()
    with foreign_errors(block.path, lambda: block.offset):
        for opcode, start, end in block.records(contents):
            if opcode == Opcode.MESSAGE:
                found.message_counts[CHANNEL_ID.unpack_from(contents, start)[0]] += 1
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                _take_definition(found, opcode, ReadDataStream(BytesIO(contents[start:end])))
