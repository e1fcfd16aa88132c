"""The bag reader: real recordings, the order of messages, several files, and bad input told in one sentence."""

import shutil
from pathlib import Path

import pytest
import yaml
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import Reader

from physics_prior.errors import RecordingError
from physics_prior.recording import mcap_file, reader
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.messages import PoseStamped, String
from physics_prior.recording.reader import open_bag
from physics_prior.recording.writer import BagWriter

BAGS = sorted(Path(__file__).parents[3].glob("shared/bags/*/metadata.yaml"))


def write_mcap(path, times, topic="/text", schema="std_msgs/msg/String", encoding="cdr", **options):
    """A bare MCAP file made without our writer; message n says n."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros2", "test")
        schema_id = writer.register_schema(schema, "ros2msg", b"string data\n")
        channel = writer.register_channel(topic, encoding, schema_id)
        for number, time in enumerate(times):
            writer.add_message(channel, time, encode(String(str(number))), publish_time=time)
        writer.finish()
    return path


def texts(bag):
    return [decode(record.message_type, record.data).data for record in bag.read()]


@pytest.mark.skipif(not BAGS, reason="missing ../shared/bags: recordings beside the repository")
@pytest.mark.parametrize("metadata", BAGS, ids=lambda file: file.parent.name)
def test_real_recordings_read_as_described_and_as_rosbags_reads_them(metadata):
    described = yaml.safe_load(metadata.read_text())["rosbag2_bagfile_information"]
    bag = open_bag(metadata.parent)
    assert bag.loss is None
    assert {name: (topic.type, topic.count) for name, topic in bag.topics.items()} == {
        entry["topic_metadata"]["name"]: (entry["topic_metadata"]["type"], entry["message_count"])
        for entry in described["topics_with_message_count"]
    }
    assert "source" in bag.metadata_records
    records = list(bag.read())
    assert len(records) == described["message_count"]
    times = [record.log_time_ns for record in records]
    assert times == sorted(times)
    for record in records[:: len(records) // 50]:
        assert encode(decode(record.message_type, record.data)) == record.data
    with Reader(metadata.parent) as theirs:
        expected = [(connection.topic, time, connection.msgtype, data) for connection, time, data in theirs.messages()]
    assert sorted(map(tuple, records)) == sorted(expected)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"chunk_size": 64},  # a chunk for about two messages
        {"use_chunking": False},
        {"compression": CompressionType.NONE, "enable_crcs": False},
        {"index_types": IndexType.NONE},
        {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False, "index_types": IndexType.NONE},
    ],
)
def test_messages_come_by_log_time_and_at_equal_times_in_file_order(tmp_path, options):
    times = [5, 3, 9, 3, 1, 9, 0, 7, 7, 2]
    bag = open_bag(write_mcap(tmp_path / "a.mcap", times, **options))
    assert bag.topics["/text"].count == 10
    assert texts(bag) == [str(number) for number in sorted(range(10), key=times.__getitem__)]
    assert texts(bag) == texts(bag)  # a bag can be read again


def test_messages_outside_of_chunks_are_read_in_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap_file, "BARE_BLOCK_BYTES", 200)
    path = write_mcap(tmp_path / "a.mcap", range(100, 0, -1), use_chunking=False)
    assert len(mcap_file.scan(path).blocks) > 10
    assert texts(open_bag(path)) == [str(number) for number in reversed(range(100))]


def test_files_of_a_split_bag_are_merged(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    write_mcap(folder / "bag_0.mcap", [1, 3, 5])
    write_mcap(folder / "bag_1.mcap", [2, 3, 4])
    description = {"storage_identifier": "mcap", "relative_file_paths": ["bag_0.mcap", "bag_1.mcap"]}
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": description}))
    bag = open_bag(folder)
    assert bag.loss is None
    assert bag.topics["/text"].count == 6
    assert texts(bag) == ["0", "0", "1", "1", "2", "2"]
    assert [record.log_time_ns for record in bag.read()] == [1, 2, 3, 3, 4, 5]


def test_a_folder_without_description_is_read_and_said_so(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    for number in range(11):
        write_mcap(folder / f"bag_{number}.mcap", [7])
    bag = open_bag(folder)
    assert "has no metadata.yaml, its recorder was killed" in bag.loss
    assert bag.topics["/text"].count == 11
    assert [file.path.name for file in bag._files][-2:] == ["bag_9.mcap", "bag_10.mcap"]


def test_only_the_topics_asked_for_are_read(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for name in ("/a", "/b", "/c"):
            writer.add_topic(name, String)
            writer.write(name, String(name), 1)
    bag = open_bag(tmp_path / "bag")
    assert [record.topic for record in bag.read(["/c", "/a"])] == ["/a", "/c"]
    with pytest.raises(RecordingError, match="bag has no topic /d; it has /a, /b, /c"):
        bag.read(["/a", "/d"])
    assert bag.require_topic("/a", "std_msgs/msg/String", "std_msgs/msg/Empty").count == 1
    with pytest.raises(RecordingError, match=r"topic /a of .* holds std_msgs/msg/String; valid is geometry_msgs"):
        bag.require_topic("/a", PoseStamped.ros_type)


def test_of_metadata_records_with_one_name_the_last_counts(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", String)
        writer.write("/a", String(), 1)
        writer.add_metadata("note", {"text": "first"})
        writer.add_metadata("note", {"text": "last"})
    assert open_bag(tmp_path / "bag").metadata_records["note"] == {"text": "last"}


def test_other_encodings_are_refused_only_when_asked_for(tmp_path):
    bag = open_bag(write_mcap(tmp_path / "a.mcap", [1], encoding="json"))
    with pytest.raises(RecordingError, match=r"topic /text of .* is encoded as 'json', not as cdr"):
        bag.read()
    with pytest.raises(RecordingError, match="encoded as 'json'"):
        bag.require_topic("/text")


def test_a_topic_of_two_types_is_refused(tmp_path):
    write_mcap(tmp_path / "bag_0.mcap", [1])
    write_mcap(tmp_path / "bag_1.mcap", [1], schema="std_msgs/msg/Empty")
    with pytest.raises(
        RecordingError, match=r"holds topic /text both as std_msgs/msg/String .* and as std_msgs/msg/Em"
    ):
        open_bag(tmp_path)


def test_missing_empty_and_foreign_paths_are_told_apart(tmp_path):
    with pytest.raises(RecordingError, match=r"nowhere does not exist; give a bag folder or an .mcap file"):
        open_bag(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match=r"is not a bag: it holds neither metadata.yaml nor an .mcap file"):
        open_bag(tmp_path)
    for name, content in (("text.mcap", b"hello, I am a text"), ("empty.mcap", b"")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RecordingError, match=f"{name} does not begin as an MCAP file does"):
            open_bag(tmp_path / name)
    with pytest.raises(RecordingError, match=r"silent.mcap holds no messages"):
        open_bag(write_mcap(tmp_path / "silent.mcap", []))
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", String)
    with pytest.raises(RecordingError, match="bag holds no messages"):
        open_bag(tmp_path / "bag")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"storage_identifier": "sqlite3"}, "is stored as 'sqlite3'; only mcap is read"),
        ({"compression_mode": "MESSAGE", "compression_format": "zstd"}, "has compression_mode MESSAGE"),
        ({"compression_mode": "FILE"}, "has compression_mode FILE"),
        ({"relative_file_paths": []}, "must list relative_file_paths"),
        ({"relative_file_paths": ["bag_1.mcap"]}, "lacks bag_1.mcap, which its metadata.yaml lists"),
        ({"relative_file_paths": ["../secret.mcap"]}, "lists '../secret.mcap', which is not inside the bag"),
        ({"relative_file_paths": ["/etc/passwd"]}, "which is not inside the bag"),
        ({"relative_file_paths": [7]}, "lists 7, which is not inside the bag"),
    ],
)
def test_a_description_that_does_not_fit_is_refused(tmp_path, change, says):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", String)
        writer.write("/a", String(), 1)
    file = tmp_path / "bag" / "metadata.yaml"
    content = yaml.safe_load(file.read_text())
    content["rosbag2_bagfile_information"] |= change
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(RecordingError, match=says):
        open_bag(tmp_path / "bag")


@pytest.mark.parametrize(
    "text", ["", "[1]", "a: 1", "{", "\0", "rosbag2_bagfile_information: 3", "!!python/name:os.system"]
)
def test_a_description_that_is_none_is_refused(tmp_path, text):
    (tmp_path / "metadata.yaml").write_text(text)
    with pytest.raises(RecordingError, match="does not describe a bag"):
        open_bag(tmp_path)


def test_chunks_that_all_overlap_are_bounded(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / "a.mcap", [0, 9] * 200, chunk_size=64)
    assert len(texts(open_bag(path))) == 400
    monkeypatch.setattr(reader, "MAXIMUM_HELD_BYTES", 1000)
    with pytest.raises(RecordingError, match="more than 1000 bytes of chunks overlap in time"):
        texts(open_bag(path))


def test_chunks_in_order_are_not_held_together(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / "a.mcap", range(400), chunk_size=64)
    monkeypatch.setattr(reader, "MAXIMUM_HELD_BYTES", 1000)
    assert len(texts(open_bag(path))) == 400


def test_a_renamed_bag_still_opens(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a", String)
        writer.write("/a", String("x"), 1)
    shutil.move(tmp_path / "bag", tmp_path / "other")
    assert texts(open_bag(str(tmp_path / "other"))) == ["x"]
    assert texts(open_bag(tmp_path / "other" / "bag_0.mcap")) == ["x"]
