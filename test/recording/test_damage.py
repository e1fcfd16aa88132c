"""Damaged and hostile files: salvaged with the loss stated, or refused as RecordingError; nothing else, ever."""

import random
import struct

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from physics_prior.errors import RecordingError
from physics_prior.recording import mcap_file
from physics_prior.recording.messages import JointState, String
from physics_prior.recording.reader import open_bag
from physics_prior.recording.writer import BagWriter

COMPRESSIONS = ["zstd", "lz4", "none"]


@pytest.fixture(params=COMPRESSIONS)
def recording(request, tmp_path, monkeypatch):
    """A whole bare .mcap of five chunks, as (path, its bytes, its contents)."""
    monkeypatch.setattr("physics_prior.recording.writer.CHUNK_BYTES", 500)
    with BagWriter(tmp_path / "bag", compression=request.param) as bag:
        bag.add_topic("/joints", JointState)
        bag.add_topic("/text", String)
        for index in range(20):
            bag.write("/joints", JointState(position=[0.1 * index, 1.0]), 100 + index)
            bag.write("/text", String(f"number {index}"), 100 + index)
        bag.add_metadata("source", {"made_by": "test"})
    path = tmp_path / "bag" / "bag_0.mcap"
    return path, path.read_bytes(), read_all(path)


def read_all(path):
    bag = open_bag(path)
    return bag.topics, bag.metadata_records, list(bag.read())


def test_a_cut_off_recording_gives_a_prefix_and_says_what_is_lost(recording):
    path, whole, (_, _, records) = recording
    first_chunk = mcap_file.scan(path).blocks[0]
    salvaged = set()
    for size in [*range(0, len(whole), 7), *range(len(whole) - 12, len(whole))]:
        path.write_bytes(whole[:size])
        try:
            bag = open_bag(path)
        except RecordingError as error:
            assert size < first_chunk.offset + first_chunk.length, error  # noqa: PT017
            continue
        kept = list(bag.read())
        assert kept == records[: len(kept)]
        assert sum(topic.count for topic in bag.topics.values()) == len(kept)
        if bag.loss is None:
            assert size >= len(whole) - len(MCAP0_MAGIC)  # only the closing magic is missing
        else:
            assert f"{path} was not closed by its recorder: the {size - _offset(bag.loss)} bytes" in bag.loss
            assert "but no message" in bag.loss or f"{len(kept)} messages of " in bag.loss
        salvaged.add(len(kept))
    assert len(salvaged) >= 4
    assert len(records) in salvaged


def _offset(loss):
    return int(loss.split("from byte ")[1].split()[0])


def test_a_recorder_killed_before_its_first_chunk_leaves_nothing(recording):
    path, whole, _ = recording
    path.write_bytes(whole[:60])
    with pytest.raises(RecordingError, match=r"nothing is left to read: .* was not closed by its recorder"):
        open_bag(path)


def test_an_altered_byte_is_refused_or_changes_nothing(recording):
    path, whole, expected = recording
    refused = 0
    random_bytes = random.Random(7)
    for _ in range(300):
        altered = bytearray(whole)
        altered[random_bytes.randrange(len(whole))] ^= 1 << random_bytes.randrange(8)
        path.write_bytes(altered)
        try:
            assert read_all(path) == expected
        except RecordingError as error:
            assert str(path) in str(error)  # noqa: PT017
            refused += 1
    assert refused > 250  # 298 to 300: checksums lie over all but the magic at the end


def test_random_cuts_out_of_the_middle_are_refused(recording):
    path, whole, _ = recording
    random_cuts = random.Random(3)
    for _ in range(60):
        start, end = sorted(random_cuts.sample(range(8, len(whole) - 8), 2))
        path.write_bytes(whole[:start] + whole[end:])
        with pytest.raises(RecordingError):
            read_all(path)


def test_random_bytes_after_the_magic_are_refused(tmp_path):
    path = tmp_path / "a.mcap"
    random_bytes = random.Random(5)
    for _ in range(100):
        path.write_bytes(MCAP0_MAGIC + random_bytes.randbytes(200) + random_bytes.choice([b"", MCAP0_MAGIC]))
        with pytest.raises(RecordingError):
            read_all(path)


def record(opcode, body, length=None):
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def chunk(data, compression=b"", size=None, data_length=None, start=0, end=9):
    size = len(data) if size is None else size
    data_length = len(data) if data_length is None else data_length
    head = struct.pack("<QQQII", start, end, size, 0, len(compression))
    return record(Opcode.CHUNK, head + compression + struct.pack("<Q", data_length) + data)


def message(channel=1, time=1, data=b"\0\1\0\0\1\0\0\0\0"):
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", channel, 0, time, time) + data)


def text(value):
    return struct.pack("<I", len(value)) + value


DEFINITIONS = record(
    Opcode.SCHEMA, struct.pack("<H", 1) + text(b"std_msgs/msg/String") + text(b"ros2msg") + text(b"string data\n")
) + record(Opcode.CHANNEL, struct.pack("<HH", 1, 1) + text(b"/text") + text(b"cdr") + struct.pack("<I", 0))
HEADER = record(Opcode.HEADER, text(b"ros2") + text(b"test"))
END = record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20)) + MCAP0_MAGIC
BOMB = bytes(64 * 2**20)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (record(Opcode.MESSAGE, b"", length=2**63), "no record begins here"),
        (record(Opcode.SCHEMA, b"", length=2**40), "no record begins here"),
        (record(0, b""), "no record begins here"),
        (chunk(b"", size=2**40), "is above the limit of 268435456"),
        (chunk(b"", data_length=2**62), "a chunk's data claim 4611686018427387904 bytes"),
        (chunk(b"x" * 9), "claims 8680820740569200760 bytes"),
        (chunk(b"x" * 5), "a chunk ends inside a record's header"),
        (chunk(message(), size=5), "a chunk of 5 bytes gave 40"),
        (chunk(message(time=10)), "outside of its chunk's time span"),
        (chunk(message(), b"gzip"), "compression 'gzip' is not known"),
        (chunk(message(), b"\xff"), "utf-8"),
        (chunk(b"nonsense", b"zstd"), "corrupt near byte"),
        (chunk(b"nonsense", b"lz4"), "corrupt near byte"),
        (chunk(record(Opcode.MESSAGE, b"short")), "claims 5 bytes"),
        (chunk(message(channel=7)), "a message names unknown channel 7"),
        (message(channel=7), "a message names unknown channel 7"),
        (record(Opcode.MESSAGE, b"short"), "corrupt near byte"),
        (record(Opcode.CHUNK, b"short"), "corrupt near byte"),
        (record(Opcode.METADATA, text(b"\xff") + bytes(4)), "utf-8"),
        (record(Opcode.CHANNEL, struct.pack("<HHI", 1, 1, 2**32 - 1)), "corrupt near byte"),
    ],
)
def test_claims_that_cannot_be_true_are_refused(tmp_path, body, says):
    path = tmp_path / "a.mcap"
    path.write_bytes(MCAP0_MAGIC + HEADER + DEFINITIONS + message() + body + END)
    with pytest.raises(RecordingError) as caught:
        read_all(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        (zstandard.compress(BOMB), b"zstd"),
        (zstandard.ZstdCompressor(write_content_size=False).compress(BOMB), b"zstd"),
        (lz4.frame.compress(BOMB), b"lz4"),
        (lz4.frame.compress(BOMB, store_size=False), b"lz4"),
    ],
)
def test_a_decompression_bomb_gives_no_more_than_its_chunk_claims(tmp_path, data):
    compressed, compression = data
    path = tmp_path / "a.mcap"
    path.write_bytes(MCAP0_MAGIC + HEADER + DEFINITIONS + chunk(compressed, compression, size=1000) + END)
    with pytest.raises(RecordingError):
        read_all(path)
    try:
        contents = mcap_file.decompress(compressed, compression.decode(), 1000)
    except (ValueError, zstandard.ZstdError):
        return
    assert len(contents) <= 1001


def test_records_of_a_later_version_are_skipped(tmp_path):
    path = tmp_path / "a.mcap"
    private = record(0x80, b"a private record")
    path.write_bytes(MCAP0_MAGIC + HEADER + private + DEFINITIONS + chunk(private + message()) + END)
    _, _, records = read_all(path)
    assert [entry.topic for entry in records] == ["/text"]


def test_a_chunk_that_is_missing_is_noticed(recording):
    path, whole, _ = recording
    at = len(MCAP0_MAGIC)
    while whole[at] != Opcode.CHUNK:
        at += 9 + struct.unpack_from("<Q", whole, at + 1)[0]
    # As a private record the chunk is skipped; without the data section's checksum only the count tells.
    end = whole.index(struct.pack("<BQ", Opcode.DATA_END, 4)) + 9
    altered = bytearray(whole)
    altered[at] = 0x80
    altered[end : end + 4] = bytes(4)
    path.write_bytes(altered)
    with pytest.raises(RecordingError, match="chunks and 2 metadata records were written"):
        open_bag(path)
