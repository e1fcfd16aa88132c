"""The bag writer: rosbag2's layout, read back by us and by rosbags; reproducible; never half-written."""

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from physics_prior.errors import RecordingError
from physics_prior.recording.cdr import encode
from physics_prior.recording.messages import JointState, MarkerArray, Pose, PoseStamped, String
from physics_prior.recording.reader import Record, open_bag
from physics_prior.recording.wire import MESSAGE_CLASSES
from physics_prior.recording.writer import BagWriter

COMPRESSIONS = pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])


def write_sample(path, compression="zstd", count=50, **keywords):
    with BagWriter(path, compression=compression, **keywords) as bag:
        bag.add_metadata("source", {"made_by": "test", "unit": "m"})
        bag.add_topic("/joint_states", "sensor_msgs/msg/JointState")
        bag.add_topic("/silent", String)
        bag.add_topic("/pose", PoseStamped)
        for index in range(count):
            bag.write("/joint_states", JointState(name=["a"], position=[float(index)]), 1000 + 10 * index)
            bag.write("/pose", encode(PoseStamped()), 1005 + 10 * index)
    return path


@COMPRESSIONS
def test_reads_back_the_same(tmp_path, compression):
    bag = open_bag(write_sample(tmp_path / "bag", compression))
    assert bag.loss is None
    assert {name: (topic.type, topic.count) for name, topic in bag.topics.items()} == {
        "/joint_states": ("sensor_msgs/msg/JointState", 50),
        "/silent": ("std_msgs/msg/String", 0),
        "/pose": ("geometry_msgs/msg/PoseStamped", 50),
    }
    assert bag.metadata_records["source"] == {"made_by": "test", "unit": "m"}
    records = list(bag.read())
    assert records[:2] == [
        Record("/joint_states", 1000, "sensor_msgs/msg/JointState", encode(JointState(name=["a"], position=[0.0]))),
        Record("/pose", 1005, "geometry_msgs/msg/PoseStamped", encode(PoseStamped())),
    ]
    assert len(records) == 100


@COMPRESSIONS
def test_rosbags_reads_the_same(tmp_path, compression):
    path = write_sample(tmp_path / "bag", compression)
    with Reader(path) as theirs:
        read = [(connection.topic, time, connection.msgtype, data) for connection, time, data in theirs.messages()]
        assert read == [tuple(record) for record in open_bag(path).read()]
        assert theirs.message_count == 100
        assert {connection.topic for connection in theirs.connections} == {"/joint_states", "/silent", "/pose"}
        assert (theirs.start_time, theirs.end_time - 1) == (1000, 1495)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(draw=st.data())
def test_any_messages_at_any_times_come_back_in_order_of_time(tmp_path, any_message, draw):
    times = st.integers(0, 2**63 - 1) | st.integers(0, 3)
    written = draw.draw(st.lists(st.tuples(any_message, times), min_size=1, max_size=8))
    with BagWriter(tmp_path / "bag", overwrite=True) as bag:
        for message, time in written:
            bag.add_topic(f"/{type(message).__name__}", type(message))
            bag.write(f"/{type(message).__name__}", message, time)
    read = [(record.data, record.log_time_ns) for record in open_bag(tmp_path / "bag").read()]
    assert read == [(encode(message), time) for message, time in sorted(written, key=lambda pair: pair[1])]


def test_file_is_laid_out_as_rosbag2_does(tmp_path):
    path = write_sample(tmp_path / "bag")
    assert sorted(file.name for file in path.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    with (path / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        schema, channel, message = next(reader.iter_messages())
        assert (schema.encoding, schema.name) == ("ros2msg", "sensor_msgs/msg/JointState")
        assert (channel.message_encoding, channel.topic) == ("cdr", "/joint_states")
        assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["reliability"] == "reliable"
        assert channel.metadata["topic_type_hash"].startswith("RIHS01_a13ee3a3")
        assert (message.sequence, message.log_time, message.publish_time) == (0, 1000, 1000)
        records = {record.name: record.metadata for record in reader.iter_metadata()}
    assert summary.statistics.message_count == 100
    information = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert yaml.safe_load(records["rosbag2"]["serialized_metadata"]) == information
    assert information["version"] == 9
    assert information["message_count"] == 100
    assert information["duration"] == {"nanoseconds": 495}
    assert information["relative_file_paths"] == ["bag_0.mcap"]
    assert "&" not in (path / "metadata.yaml").read_text()  # no anchors


def test_description_has_the_keys_of_a_rosbag2_description(tmp_path, shared):
    theirs = shared / "bags" / "cube_toss_120" / "metadata.yaml"
    if not theirs.is_file():
        pytest.skip(f"missing {theirs}")

    def keys(value):
        if isinstance(value, dict):
            return {key: keys(inner) for key, inner in value.items()}
        return keys(value[0]) if isinstance(value, list) else type(value).__name__

    ours = write_sample(tmp_path / "bag") / "metadata.yaml"
    assert keys(yaml.safe_load(ours.read_text())) == keys(yaml.safe_load(theirs.read_text()))


@COMPRESSIONS
def test_same_calls_give_the_same_bytes(tmp_path, compression):
    first, second = write_sample(tmp_path / "1" / "bag", compression), write_sample(tmp_path / "2" / "bag", compression)
    for file in ("bag_0.mcap", "metadata.yaml"):
        assert (first / file).read_bytes() == (second / file).read_bytes()


def test_many_chunks(tmp_path):
    noise = np.random.default_rng(1).normal(size=(40, 6000))  # 40 messages of 48 kB: three chunks
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/joints", JointState)
        for index, position in enumerate(noise):
            bag.write("/joints", JointState(position=position), 100 - index)
    read = list(open_bag(tmp_path / "bag").read())
    assert [record.log_time_ns for record in read] == list(range(61, 101))
    assert [record.data for record in read] == [encode(JointState(position=row)) for row in noise[::-1]]


def test_an_existing_bag_stays_unless_overwriting_is_allowed(tmp_path):
    path = write_sample(tmp_path / "bag", count=3)
    with pytest.raises(RecordingError, match="exists; choose another name or allow overwriting"):
        BagWriter(path)
    write_sample(path, count=5, overwrite=True)
    assert open_bag(path).topics["/pose"].count == 5
    assert [file.name for file in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("extra", ["thesis.tex", None])
def test_what_is_not_a_bag_is_never_overwritten(tmp_path, extra):
    folder = tmp_path / "folder"
    folder.mkdir()
    if extra:
        (folder / extra).write_text("precious")
        (folder / "metadata.yaml").write_text("")
    with pytest.raises(RecordingError, match="is not a bag and is not overwritten"):
        BagWriter(folder, overwrite=True)
    file = tmp_path / "file.mcap"
    file.write_text("precious")
    with pytest.raises(RecordingError, match="is not a bag and is not overwritten"):
        BagWriter(file, overwrite=True)


def test_nothing_is_left_of_a_recording_that_failed(tmp_path):
    old = write_sample(tmp_path / "bag", count=3)
    before = (old / "bag_0.mcap").read_bytes()

    def fail(path, overwrite):
        with BagWriter(path, overwrite=overwrite) as bag:
            bag.add_topic("/pose", PoseStamped)
            bag.write("/pose", PoseStamped(), 1)
            raise ZeroDivisionError

    for overwrite, name in ((True, "bag"), (False, "new")):
        with pytest.raises(ZeroDivisionError):
            fail(tmp_path / name, overwrite)
    assert [file.name for file in tmp_path.iterdir()] == ["bag"]
    assert (old / "bag_0.mcap").read_bytes() == before


def test_two_writers_of_one_name_do_not_mix(tmp_path):
    late = BagWriter(tmp_path / "bag")
    late.__enter__()
    late.add_topic("/late", String)
    write_sample(tmp_path / "bag")
    with pytest.raises(RecordingError, match="exists"):
        late.__exit__(None, None, None)
    assert "/late" not in open_bag(tmp_path / "bag").topics
    assert [file.name for file in tmp_path.iterdir()] == ["bag"]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="bag cannot be written: "), BagWriter(tmp_path / "file" / "bag"):
        pass


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda bag: bag.write("/other", Pose(), 1), "topic /other was not announced; announced are /pose"),
        (lambda bag: bag.write("/pose", Pose(), 1), "takes geometry_msgs/msg/PoseStamped, not geometry_msgs/msg/Pose"),
        (lambda bag: bag.write("/pose", PoseStamped(), -1), "log time -1 ns on /pose is not in"),
        (lambda bag: bag.add_topic("/pose", MarkerArray), "/pose is already of type geometry_msgs/msg/PoseStamped"),
        (lambda bag: bag.add_topic("/x", "std_msgs/Strin"), "message type 'std_msgs/Strin' is not known here"),
    ],
)
def test_bad_calls_are_refused(tmp_path, call, says):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/pose", PoseStamped)
        bag.add_topic("/pose", PoseStamped)  # announcing twice is no error
        with pytest.raises(RecordingError, match=says):
            call(bag)


def test_unknown_compression_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="'gzip' is not known; valid are zstd, lz4, none"):
        BagWriter(tmp_path / "bag", compression="gzip")


def test_every_type_can_be_a_topic(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        for index, (name, cls) in enumerate(MESSAGE_CLASSES.items()):
            bag.add_topic(f"/{name}", name)
            bag.write(f"/{name}", cls(), index)
    with Reader(tmp_path / "bag") as theirs:
        assert {connection.msgtype for connection in theirs.connections} == set(MESSAGE_CLASSES)
        assert theirs.message_count == len(MESSAGE_CLASSES)
