"""What `check` reports of a log, and what `repair` saves of a damaged one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.cli.main import main
from rig.errors import DataError, ExitCode, UsageError
from rig.log.check import Verdict, check_log
from rig.log.reader import DamagedLogError, read_log
from rig.log.repair import RepairError, repair_log, repaired_path
from rig.log.run import RunEnd, RunInfo
from rig.log.schema import Field, Stream
from rig.log.streams import COUNTS, SAMPLE
from rig.log.writer import LogExistsError, LogWriter
from tests.rig.log.conftest import flip, write_log

NUMBERED = Stream(
    "/t",
    "p/msg/P",
    (Field("x", "float64"), Field("sequence", "uint32"), Field("flags", "uint32")),
    rate_hz=1000,
)


def write_numbered(path, sequence, x=None, log_time_ns=None, end=None):
    count = len(sequence)
    with LogWriter(path, RunInfo("a"), [NUMBERED]) as writer:
        zeros = np.zeros(count, int)
        rows = {"x": zeros if x is None else x, "flags": zeros}
        rows["sequence"] = np.array(sequence, int)
        writer.write("/t", rows, np.arange(count) if log_time_ns is None else log_time_ns)
        writer.close(end)
    return path


@pytest.mark.parametrize(
    ("written", "of_sample"),
    [({"drop": frozenset(range(580, 600))}, 580), ({"samples": 590, "duration_s": 0.6}, 590)],
    ids=["the recorder's count", "the plan"],
)
def test_samples_lost_at_the_very_end_are_known(tmp_path, written, of_sample):
    report = check_log(write_log(tmp_path / "a.mcap", **written))
    assert report.verdict is Verdict.INCOMPLETE
    assert f"{of_sample} of 600" in report.problems[0]


def test_a_gap_over_the_wrap_is_numbered_as_the_device_counts(tmp_path):
    report = check_log(write_numbered(tmp_path / "a.mcap", [2**32 - 2, 3]))
    gap = report.topics[0].gaps[0]
    assert (gap.first_sequence, gap.last_sequence, gap.samples) == (2**32 - 1, 2, 4)


def test_repeats_time_that_runs_back_and_an_aborted_run(tmp_path):
    end = RunEnd(clean=False, reason="operator pressed stop")
    path = write_numbered(
        tmp_path / "a.mcap", [1, 2, 2, 1, 2], log_time_ns=[5, 6, 7, 4, 8], end=end
    )
    report = check_log(path)
    assert report.verdict is Verdict.INCOMPLETE
    assert (report.topics[0].repeats, report.topics[0].time_steps_back) == (2, 1)
    assert "operator pressed stop" in report.problems[-1]


def test_a_damaged_chunk_is_found_and_the_rest_is_saved(tmp_path, log):
    data = log.read_bytes()
    flip(log, data.find(b"zstd", len(data) // 3) + 200, 0x10)
    before = log.read_bytes()
    with pytest.raises(DamagedLogError, match="rig log repair"):
        read_log(log)
    report = check_log(log)
    assert report.verdict is Verdict.DAMAGED
    assert report.verdict.exit_code == ExitCode.DATA
    assert any("checksum" in d.what or "unpacked" in d.what for d in report.damage)

    result = repair_log(log)
    assert log.read_bytes() == before
    assert result.repaired == tmp_path / "run.repaired.mcap"
    assert sum(result.recovered.values()) + sum(result.lost.values()) == 1200
    assert 0 < sum(result.lost.values()) <= 250
    assert check_log(result.repaired).verdict is Verdict.INCOMPLETE
    repaired = read_log(result.repaired)
    assert repaired.run.conditions == {"load_command_a": 0.3, "object": "spring"}
    assert repaired.attachments == read_log(log, tolerant=True).attachments
    assert repaired.end.counters == {"crc_errors": 2}
    assert repaired.metadata[0][0] == "rig.repair"


def test_a_damaged_length_does_not_hide_what_follows(log):
    """The length of the first chunk grows by 64 KiB: a plain walk would lose every later chunk."""
    whole = read_log(log)
    flip(log, log.read_bytes().find(b"\x04\0\0\0zstd") - 34)
    read = read_log(log, tolerant=True)
    assert read.run == whole.run
    assert read.end == whole.end
    assert len(read.topics[COUNTS]) == 600
    assert 340 <= len(read.topics[SAMPLE]) < 600


def test_a_repair_never_overwrites(tmp_path, log):
    log.write_bytes(log.read_bytes()[:-100])
    repaired_path(log).write_bytes(b"precious")
    with pytest.raises(LogExistsError):
        repair_log(log)
    assert repaired_path(log).read_bytes() == b"precious"
    with pytest.raises(UsageError):
        repair_log(log, log)


def test_a_log_that_lost_its_streams_cannot_be_repaired(log):
    data = log.read_bytes()
    log.write_bytes(data[: data.find(b"rig_msgs") - 30])
    with pytest.raises(RepairError):
        repair_log(log)
    assert check_log(log).verdict is Verdict.DAMAGED


def test_a_log_without_a_readable_sample_is_no_success(tmp_path, capsys):
    path = write_numbered(tmp_path / "a.mcap", range(100))
    data = path.read_bytes()
    path.write_bytes(data[: data.find(b"\x04\0\0\0zstd") + 60])
    assert main(["log", "repair", str(path)]) == ExitCode.DATA
    assert f"No sample of {path} is readable." in " ".join(capsys.readouterr().out.split())
    assert main(["log", "info", str(path)]) == ExitCode.OK
    assert main(["log", "check", str(path)]) == ExitCode.DATA


def test_whole_messages_of_a_torn_chunk_are_salvaged(tmp_path):
    """A chunk of several compressed blocks, torn in the last one: the earlier blocks are whole."""
    count = 40_000
    x = np.random.default_rng(0).normal(size=count)
    path = write_numbered(tmp_path / "a.mcap", range(count), x=x)
    data = path.read_bytes()
    path.write_bytes(data[: data.find(b"\x04\0\0\0zstd") + 300_000])
    read = read_log(path, tolerant=True)
    got = read.topics["/t"].rows["x"]
    assert read.salvaged == {"/t": got.size}
    assert got.size > 1000
    np.testing.assert_array_equal(got, x[: got.size])
    result = repair_log(path)
    assert result.salvaged == {"/t": got.size}
    np.testing.assert_array_equal(read_log(result.repaired).topics["/t"].rows["x"], got)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"proximal_torque_n_m", b"proximal_torque_n_s"),
        (b"float64 motor", b"uint64_ motor"),
        (b"# [rad] ", b"# [rae] "),
        (b"/rig/sample", b"/rig/samplf"),
    ],
)
def test_an_unfinished_log_never_gives_a_field_a_wrong_name_or_unit(log, old, new):
    data = log.read_bytes()
    cut = data[: data.find(b"rig.end") - 20]
    assert old in cut
    log.write_bytes(cut.replace(old, new))
    read = read_log(log, tolerant=True)
    assert list(read.topics) == [COUNTS]
    report = check_log(log)
    assert report.verdict is Verdict.DAMAGED
    assert any("definition" in problem for problem in report.problems)
    assert repair_log(log).recovered == {COUNTS: 600}


def test_a_closed_log_has_its_definitions_twice(log):
    whole = read_log(log)
    log.write_bytes(log.read_bytes().replace(b"proximal_torque_n_m", b"proximal_torque_n_s", 1))
    read = read_log(log, tolerant=True)
    assert read.topics[SAMPLE].stream == whole.topics[SAMPLE].stream
    assert read.topics[SAMPLE].rows.tobytes() == whole.topics[SAMPLE].rows.tobytes()


def test_a_changed_condition_is_lost_rather_than_wrong(log):
    data = log.read_bytes()
    log.write_bytes(data.replace(b'"load_command_a": 0.3', b'"load_command_a": 0.7'))
    result = repair_log(log)
    assert any("RunInfo" in problem for problem in result.problems)
    assert read_log(result.repaired).run.conditions == {}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A log small enough that random places hit everything in it."""
    path = tmp_path_factory.mktemp("small") / "a.mcap"
    random = np.random.default_rng(3)
    with LogWriter(path, RunInfo("a", conditions={"load_a": 0.3}), [NUMBERED]) as writer:
        for first in range(0, 60, 20):
            rows = {"x": random.normal(size=20), "sequence": np.arange(first, first + 20)}
            writer.write("/t", rows | {"flags": np.zeros(20, int)}, rows["sequence"])
            writer.flush()
    return path.read_bytes(), read_log(path)


def examine(folder, data, truth):
    """Check and repair a file: nothing but DataError may come.

    No sample, no name or unit of a field and nothing known about the run may have changed.
    """
    path = folder / "fuzzed.mcap"
    path.write_bytes(data)
    repaired_path(path).unlink(missing_ok=True)
    try:
        verdict = check_log(path).verdict
        repaired = repair_log(path).repaired
        found = read_log(repaired or path)
    except DataError:
        return Verdict.DAMAGED
    assert found.run == truth.run or "is lost" in found.run.notes
    for name, topic in found.topics.items():
        assert topic.stream == truth.topics[name].stream
        # every row is one of the true ones, byte for byte
        assert topic.rows.tobytes() == truth.topics[name].rows[topic.rows["sequence"]].tobytes()
    return verdict


@settings(max_examples=150)
@given(
    place=st.floats(0, 1, exclude_max=True),
    junk=st.binary(max_size=40),
    keep=st.integers(0, 40) | st.none(),
    bit=st.integers(0, 7) | st.none(),
)
def test_no_change_of_a_file_is_called_whole_or_changes_a_sample(
    tmp_path, small, place, junk, keep, bit
):
    """One bit flipped; else bytes replaced by junk; else the rest cut off."""
    data, truth = small
    start = int(place * len(data))
    if bit is not None:
        changed = data[:start] + bytes([data[start] ^ 1 << bit]) + data[start + 1 :]
    else:
        changed = data[:start] + (b"" if keep is None else junk + data[start + keep :])
    verdict = examine(tmp_path, changed, truth)
    assert verdict is Verdict.DAMAGED or changed == data
