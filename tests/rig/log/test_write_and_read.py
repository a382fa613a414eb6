"""What is written is read back, by us and by two independent readers; layouts of streams."""

import _thread
import io
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory

from benchmarks.reliability.kills import kill_once
from estimation.recording import Flag, Mark, Stretch
from rig.errors import DataError, UsageError
from rig.log.messages import UnflaggedSampleError
from rig.log.reader import DamagedLogError, read_log
from rig.log.run import RunEnd, RunInfo
from rig.log.scan import NotALogError
from rig.log.schema import NUMPY_TYPES, Field, LayoutError, Stream
from rig.log.streams import COUNTS, SAMPLE
from rig.log.writer import FLUSH_AFTER_S, MAX_LOSS_S, LogExistsError, LogWriteError, LogWriter

STREAM = Stream(
    "/t",
    "p/msg/P",
    (Field("x_a", "float64", "A"), Field("sequence", "uint32"), Field("flags", "uint32")),
    1000.0,
)


def rows(count, first=0, x=1.5, flags=0):
    sequence = np.arange(first, first + count)
    return {"x_a": np.full(count, x), "sequence": sequence, "flags": np.full(count, flags)}


def times(count, first=0):
    return np.arange(first, first + count) * 1_000_000


class Clock:
    """A clock that stands still until it is moved."""

    now_s = 100.0

    def __call__(self):
        return self.now_s


def decoded_by_mcap_ros2(path):
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, message, decoded in reader.iter_decoded_messages():
            yield channel.topic, message.log_time, decoded


def decoded_by_rosbags(path):
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        for connection, timestamp, raw in reader.messages():
            yield connection.topic, timestamp, reader.deserialize(raw, connection.msgtype)


@pytest.mark.parametrize("reader", [decoded_by_mcap_ros2, decoded_by_rosbags])
def test_an_independent_reader_decodes_equal_values(log, reader):
    ours = read_log(log)
    place = dict.fromkeys(ours.topics, 0)
    for name, log_time_ns, decoded in reader(log):
        topic, k = ours.topics[name], place[name]
        assert all(getattr(decoded, field) == topic.rows[field][k] for field in topic.columns)
        assert log_time_ns == topic.log_time_ns[k]
        place[name] += 1
    assert place == {SAMPLE: 600, COUNTS: 600}


def test_everything_known_about_the_run_is_read_back(log):
    read = read_log(log)
    assert read.run.name == "run"
    assert read.run.conditions == {"load_command_a": 0.3, "object": "spring"}
    assert read.run.instrument.serial == "0042"
    assert read.run.details == {"protocol": {"kind": "sine", "frequencies_hz": [0.5, 1.0]}}
    assert read.end == RunEnd(
        expected_samples={SAMPLE: 600},
        counters={"crc_errors": 2},
        zeros_after={"proximal_torque_n_m": 1.6e-3},
        drift={"proximal_torque_n_m": 1e-4},
        drift_verdict="within limits",
    )
    assert read.marks == (Mark(0.1, "finger on the jaw"),)
    assert read.stretches == (Stretch(0.2, 0.3, Flag.SUSPECT, "re-index", "spindle_angle_rad"),)
    assert read.attachments[0].data == b"[rig]\nname = 'bench 1'\n"
    assert [f.unit for f in read.topics[SAMPLE].stream.fields][:4] == ["s", "A", "rad", "N m"]


def test_only_the_wanted_topics_are_read(log):
    assert list(read_log(log, [COUNTS]).topics) == [COUNTS]
    assert read_log(log, ()).topics == {}
    with pytest.raises(UsageError, match="no topic /rig/nothing"):
        read_log(log, ["/rig/nothing"])


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.NONE])
def test_a_file_of_another_writer_with_interleaved_streams_is_read(tmp_path, compression):
    """Schemas inside the chunks, two streams alternating, and a stream of variable size."""
    other = Stream("/u", "p/msg/Q", (Field("y", "int32"),))
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4096, compression=compression)
        writer.start("ros2", library="other")
        numbers = {}
        for stream in (STREAM, other):
            text = stream.schema_text.encode()
            schema = writer.register_schema(stream.message_type, "ros2msg", text)
            numbers[stream.topic] = writer.register_channel(stream.topic, "cdr", schema)
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        numbers["/s"] = writer.register_channel("/s", "cdr", text)
        head = b"\x00\x01\x00\x00"
        for k in range(500):
            x = np.array((k / 7, k, 0), STREAM.dtype).tobytes()
            y = np.array((-k,), other.dtype).tobytes()
            writer.add_message(numbers["/t"], k, head + x, k)
            writer.add_message(numbers["/u"], k + 5, head + y, k)
            writer.add_message(numbers["/s"], k, head + b"\x02\0\0\0a\0", k)
        writer.finish()
    read = read_log(path)
    assert read.unread == ("/s",)
    np.testing.assert_array_equal(read.topics["/t"].rows["x_a"], np.arange(500) / 7)
    np.testing.assert_array_equal(read.topics["/u"].rows["y"], -np.arange(500))
    np.testing.assert_array_equal(read.topics["/u"].log_time_ns, np.arange(500) + 5)


def test_an_exception_closes_the_log_and_reports_why_it_is_not_clean(tmp_path):
    path = tmp_path / "a.mcap"

    def record():
        with LogWriter(path, RunInfo("a"), [STREAM]) as writer:
            writer.write("/t", rows(5), times(5))
            assert [item.name for item in tmp_path.iterdir()] == ["a.mcap.part"]
            raise RuntimeError("motor stalled")

    with pytest.raises(RuntimeError, match="motor stalled"):
        record()
    assert [item.name for item in tmp_path.iterdir()] == ["a.mcap"]
    read = read_log(path)
    assert len(read.topics["/t"]) == 5
    assert (read.end.clean, read.end.reason) == (False, "RuntimeError: motor stalled")


@pytest.mark.parametrize("taken", ["a.mcap", "a.mcap.part"])
def test_a_log_is_never_overwritten(tmp_path, taken):
    (tmp_path / taken).write_bytes(b"precious")
    with pytest.raises(LogExistsError, match="already"):
        LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM])
    assert (tmp_path / taken).read_bytes() == b"precious"


def test_a_full_disk_is_reported_and_leaves_the_part(tmp_path, monkeypatch):
    def full(channel, messages):
        raise OSError(28, "No space left on device")

    def record():
        with LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM]) as writer:
            writer.write("/t", rows(5), times(5))
            writer.flush()
            monkeypatch.setattr(writer._container, "add_chunk", full)
            writer.write("/t", rows(5, 5), times(5, 5))

    with pytest.raises(LogWriteError, match="No space left") as caught:
        record()
    assert "rig log repair" in caught.value.fix
    assert len(read_log(tmp_path / "a.mcap.part", tolerant=True).topics["/t"]) == 5


def on_disk(path):
    """Number of messages the operating system has of a log being written."""
    return len(read_log(path, tolerant=True).topics["/t"])


def test_a_sample_is_in_the_system_within_a_quarter_second_and_a_mark_at_once(tmp_path):
    clock = Clock()
    with LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM], clock=clock) as writer:
        writer.write("/t", rows(1), times(1))
        assert on_disk(writer.part) == 0
        clock.now_s += 0.125
        assert not writer.poll()
        clock.now_s += 0.125
        assert writer.poll()
        assert on_disk(writer.part) == 1
        assert not writer.poll()
        writer.add(Mark(1.0, "slipped"))
        read = read_log(writer.part, tolerant=True)
        assert read.marks == (Mark(1.0, "slipped"),)
        with pytest.raises(DamagedLogError, match="not finished") as caught:
            read_log(writer.part)
        assert f"rig log repair {writer.part}" in caught.value.fix
    assert pytest.approx(MAX_LOSS_S) == FLUSH_AFTER_S + 0.05


def test_faster_than_real_time_the_data_time_sets_the_deadline(tmp_path):
    with LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM], clock=Clock()) as writer:
        for first in range(0, 3000, 20):
            writer.write("/t", rows(20, first), times(20, first))
            assert writer.received["/t"] - on_disk(writer.part) <= MAX_LOSS_S * 1000


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_needs_a_flag(tmp_path, value):
    path = tmp_path / "a.mcap"
    with LogWriter(path, RunInfo("a"), [STREAM]) as writer:
        with pytest.raises(UnflaggedSampleError, match="x_a of /t is not finite in row 0"):
            writer.write("/t", rows(3, x=value), times(3))
        writer.write("/t", rows(3, x=value, flags=Flag.MISSING), times(3))
    np.testing.assert_array_equal(read_log(path).topics["/t"].rows["x_a"], np.full(3, value))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"sequence": np.array([0, 2**32])}, "does not fit"),
        ({"sequence": np.array([-1, 0])}, "does not fit"),
        ({"flags": np.array([0.5, 0.5])}, "not a whole number"),
        ({"x_a": np.zeros(3)}, "differ in shape"),
        ({"y": np.zeros(2)}, "unknown"),
    ],
)
def test_values_that_would_change_on_the_way_are_refused(tmp_path, change, reason):
    with LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM]) as writer:
        with pytest.raises(DataError, match=reason):
            writer.write("/t", rows(2) | change, times(2))
        with pytest.raises(DataError, match="nanoseconds"):
            writer.write("/t", rows(2), np.array([0.0, 1.0]))
        with pytest.raises(DataError, match="before the epoch"):
            writer.write("/t", rows(2), np.array([-1, 1]))
        with pytest.raises(UsageError, match="no stream"):
            writer.write("/nothing", rows(2), times(2))


def test_metadata_that_is_not_finite_is_refused_before_a_file_is_made(tmp_path):
    with pytest.raises(DataError, match="conditions"):
        LogWriter(tmp_path / "a.mcap", RunInfo("a", conditions={"load_a": np.nan}), [STREAM])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("data", [b"", b"a", b"not a log at all" * 50, bytes(5000)])
def test_a_file_of_another_kind_is_named_as_such(tmp_path, data):
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    with pytest.raises(NotALogError):
        read_log(path, tolerant=True)


class Interrupted(io.FileIO):
    """A file during each write of which Ctrl-C is pressed, once it is pressed at all."""

    pressed = False

    def write(self, data):
        size = super().write(data)
        if self.pressed:
            _thread.interrupt_main()  # as from any thread: the mask of this one does not hold it
        return size


@pytest.fixture
def interruptible():
    """A process in the background of a shell ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_while_bytes_are_written_loses_and_spoils_nothing(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    monkeypatch.setattr(Path, "open", lambda path, mode: Interrupted(path, mode))
    with LogWriter(path, RunInfo("a"), [STREAM]) as writer:
        for first in range(0, 500, 50):
            writer.write("/t", rows(50, first), times(50, first))
            Interrupted.pressed = True
            with pytest.raises(KeyboardInterrupt):  # noqa: PT012
                writer.flush()
                for _ in range(1000):  # the interrupt is seen between two statements
                    time.sleep(0.001)
            Interrupted.pressed = False
    monkeypatch.undo()
    read = read_log(path)
    np.testing.assert_array_equal(read.topics["/t"].rows["sequence"], np.arange(500))
    with path.open("rb") as file:
        list(StreamReader(file, validate_crcs=True).records)


class InterruptedOnce(Interrupted):
    def write(self, data):
        size = super().write(data)
        Interrupted.pressed = False
        return size


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_while_a_log_is_begun_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "open", lambda path, mode: InterruptedOnce(path, mode))
    monkeypatch.setattr(Interrupted, "pressed", True)
    with pytest.raises(KeyboardInterrupt):
        LogWriter(tmp_path / "a.mcap", RunInfo("a"), [STREAM])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("seed", range(3))
def test_a_killed_recorder_loses_at_most_a_quarter_second(tmp_path, seed):
    killed = kill_once(tmp_path, seed)
    assert killed.handed_over >= 700
    assert killed.lost_s <= MAX_LOSS_S


NAMES = st.from_regex(re.compile(r"[a-z](_?[a-z0-9]){0,8}"), fullmatch=True)
TEXT = st.text(st.characters(codec="ascii", min_codepoint=32), max_size=20).map(str.strip)
UNITS = st.sampled_from(["", "1", "N m", "rad/s", "A"])


@st.composite
def streams(draw):
    names = draw(st.lists(NAMES, min_size=1, max_size=8, unique=True))
    kinds = draw(st.lists(st.sampled_from(sorted(NUMPY_TYPES)), min_size=8, max_size=8))
    kinds.sort(key=lambda kind: -np.dtype(NUMPY_TYPES[kind]).itemsize)
    pairs = zip(names, kinds, strict=False)
    fields = [Field(name, kind, draw(UNITS), draw(TEXT)) for name, kind in pairs]
    rate = draw(st.none() | st.floats(0.1, 1e4))
    return Stream("/a/topic", "some_msgs/msg/Kind", tuple(fields), rate)


@given(streams())
def test_a_stream_survives_its_ros2_definition(stream):
    text = stream.schema_text
    assert Stream.from_definition("/a/topic", "some_msgs/msg/Kind", text, stream.rate_hz) == stream


def test_a_plain_ros2_definition_with_comments_is_understood():
    text = "# a sample\n\nfloat64 x   # where it is\nuint32 sequence\n"
    stream = Stream.from_definition("/t", "p/msg/P", text)
    assert [(f.name, f.dtype) for f in stream.fields] == [("x", "float64"), ("sequence", "uint32")]
    for line in ("string name", "float64[] xs", "geometry_msgs/Point p", "x"):  # of variable size
        with pytest.raises(LayoutError):
            Stream.from_definition("/t", "p/msg/P", f"float64 t\n{line}\n")


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ([("a", "uint32"), ("b", "float64")], "large to small"),
        ([("a", "string")], "fixed size"),
        ([("a", "float64[3]")], "fixed size"),
        ([("A", "float64")], "field name"),
        ([("a__b", "float64")], "field name"),
        ([("a", "float64"), ("a", "float64")], "different names"),
        ([], "one or more"),
    ],
)
def test_a_layout_that_is_not_fixed_or_needs_padding_is_refused(fields, reason):
    with pytest.raises(LayoutError, match=reason):
        Stream("/t", "p/msg/P", tuple(Field(*field) for field in fields))
