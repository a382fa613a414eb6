"""Recordings survive the log, and logs open as campaigns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from estimation.campaign import CampaignError
from estimation.channels import CHANNELS
from estimation.recording import Flag, Instrument, Mark, Recording, Stretch
from rig.errors import DataError
from rig.importers.log import IMPORTER
from rig.importers.registry import open_campaign
from rig.log.check import Verdict, check_log
from rig.log.convert import recording_from_log, write_recording
from rig.log.messages import UnflaggedSampleError
from rig.log.reader import DamagedLogError, read_log
from rig.log.repair import repair_log
from tests.conftest import ROOT
from tests.rig.log.conftest import flip, write_log

TEXT = st.text(max_size=20)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
NAMES = st.sampled_from(sorted(set(CHANNELS) - {"time_s"}))


@st.composite
def recordings(draw):
    count = draw(st.integers(0, 40))
    steps = draw(hnp.arrays(np.float64, count, elements=st.floats(1e-6, 10)))
    column = hnp.arrays(np.float64, count, elements=FINITE)
    marks = st.lists(st.builds(Mark, FINITE, TEXT), max_size=3)
    stretch = st.builds(
        Stretch, FINITE, FINITE, st.sampled_from(list(Flag)), TEXT, st.none() | NAMES
    )
    word = st.none() | TEXT
    return Recording(
        name=draw(TEXT),
        time_s=np.cumsum(steps),
        columns=draw(st.dictionaries(NAMES, column, max_size=4)),
        flags=draw(hnp.arrays(np.uint8, count)),
        conditions=draw(st.dictionaries(TEXT, FINITE | TEXT, max_size=3)),
        rig=draw(TEXT),
        instrument=Instrument(*(draw(word) for _ in range(4)), draw(st.none() | st.integers(0))),
        notes=draw(TEXT),
        marks=tuple(draw(marks)),
        stretches=tuple(draw(st.lists(stretch, max_size=3))),
        started_at_ns=draw(st.none() | st.integers(0, 2**62)),
        calibrations=draw(st.dictionaries(TEXT, TEXT, max_size=2)),
        source="bench",
        excluded=draw(word),
    )


def assert_equal(one, other):
    for name in (
        *("name", "rig", "instrument", "notes", "marks", "stretches", "started_at_ns"),
        *("source", "excluded"),
    ):
        assert getattr(one, name) == getattr(other, name), name
    assert dict(one.conditions) == dict(other.conditions)
    assert dict(one.calibrations) == dict(other.calibrations)
    assert list(one.columns) == list(other.columns)
    for name in ("time_s", *one.columns):
        assert one[name].tobytes() == other[name].tobytes(), name
    assert one.flags.tobytes() == other.flags.tobytes()


@given(recording=recordings())
def test_a_recording_survives_the_log(tmp_path, recording):
    path = tmp_path / "a.mcap"
    path.unlink(missing_ok=True)
    write_recording(path, recording)
    assert_equal(recording_from_log(read_log(path)), recording)


def simple(name="run", started_at_ns=None, **changes):
    fields = {"time_s": np.arange(50) * 1e-3, "columns": {"motor_current_a": np.ones(50)}}
    return Recording(name, **(fields | changes), started_at_ns=started_at_ns)


def test_a_value_that_is_not_a_number_survives_where_it_is_flagged(tmp_path):
    values = np.ones(50)
    values[7] = np.nan
    recording = simple(columns={"motor_current_a": values})
    with pytest.raises(UnflaggedSampleError, match="motor_current_a"):
        write_recording(tmp_path / "a.mcap", recording)
    assert list(tmp_path.iterdir()) == []
    flagged = recording.with_stretch(Stretch(7e-3, 7e-3, Flag.MISSING, "not received"))
    write_recording(tmp_path / "a.mcap", flagged)
    assert_equal(
        recording_from_log(read_log(tmp_path / "a.mcap")),
        Recording(**{**flagged.__dict__, "source": str(tmp_path / "a.mcap")}),
    )


def test_an_estimate_may_be_absent_from_a_whole_log(tmp_path):
    estimate = np.full(50, np.nan)
    columns = {"motor_current_a": np.ones(50), "estimated_distal_torque_n_m": estimate}
    log = write_recording(tmp_path / "a.mcap", simple(columns=columns))
    assert check_log(log).verdict is Verdict.COMPLETE


@pytest.mark.parametrize(
    ("start_s", "started_at_ns", "fits"),
    [(-5.0, None, True), (-5.0, 10**18, True), (-5.0, 10**9, False), (1e12, None, False)],
)
def test_times_before_1970_or_beyond_reach_are_refused(tmp_path, start_s, started_at_ns, fits):
    recording = simple(started_at_ns=started_at_ns, time_s=start_s + np.arange(50))
    if fits:
        write_recording(tmp_path / "a.mcap", recording)
        back = recording_from_log(read_log(tmp_path / "a.mcap"))
        np.testing.assert_array_equal(back.time_s, recording.time_s)
    else:
        with pytest.raises(DataError, match="times cannot be written"):
            write_recording(tmp_path / "a.mcap", recording)
        assert list(tmp_path.iterdir()) == []


def test_a_folder_of_campaigns_opens_as_one_in_the_order_of_the_starts(tmp_path):
    for place in ("first", "second"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "notes.txt").write_text("not a log")
        for name in ("a", "b"):
            start_ns = 10**18 * (1 + (name == "a") + 4 * (place == "second"))
            write_recording(tmp_path / place / f"{name}.mcap", simple(name, start_ns))
    assert IMPORTER.recognises(tmp_path)
    campaign = IMPORTER.open(tmp_path)
    assert campaign.names == ("first/b", "first/a", "second/b", "second/a")
    assert all(recording.started_at_ns for recording in campaign)
    assert [recording.name for recording in campaign] == list(campaign.names)


def kill(path):
    """Leave what a killed recorder leaves."""
    data = path.read_bytes()
    part = path.with_name(path.name + ".part")
    part.write_bytes(data[: data.find(b"rig.end") - 20])
    path.unlink()
    return part


def test_an_unclosed_log_is_opened_but_is_no_evidence_until_repaired(tmp_path):
    write_recording(tmp_path / "whole.mcap", simple("whole"))
    part = kill(write_log(tmp_path / "killed.mcap"))
    campaign = IMPORTER.open(tmp_path)
    assert set(campaign.names) == {"whole", "killed"}
    assert campaign.evidence.names == ("whole",)
    killed = next(r for r in campaign if r.name == "killed")
    assert len(killed) == 600
    assert "rig log repair" in killed.excluded

    repair_log(part)
    campaign = IMPORTER.open(tmp_path)
    assert set(campaign.evidence.names) == {"whole", "killed"}
    killed = next(r for r in campaign if r.name == "killed")
    assert "did not end as planned: repaired" in killed.notes


def test_a_run_recorded_again_stands_before_the_repair_of_its_first_half(tmp_path):
    first = kill(write_log(tmp_path / "sine.mcap", samples=300))
    repair_log(first)
    first.rename(tmp_path / "sine.aborted-1.mcap.part")  # as a resumed recording does
    write_log(tmp_path / "sine.mcap", samples=600)
    (run,) = IMPORTER.open(tmp_path).runs
    assert run.source == tmp_path / "sine.mcap"
    assert run.excluded is None
    assert len(run.recording()) == 600


def test_the_repair_of_a_closed_log_stands_in_for_it(tmp_path):
    log = write_log(tmp_path / "sine.mcap")
    flip(log, log.read_bytes().find(b"zstd") + 60)
    repaired = repair_log(log).repaired
    (run,) = IMPORTER.open(tmp_path).runs
    assert run.source == repaired


def test_two_whole_logs_of_one_name_are_refused(tmp_path):
    write_recording(tmp_path / "a.mcap", simple("twin"))
    write_recording(tmp_path / "b.mcap", simple("twin"))
    with pytest.raises(CampaignError, match="twin"):
        IMPORTER.open(tmp_path)


def test_a_damaged_log_is_not_half_imported(tmp_path, log):
    whole = log.read_bytes()
    damaged = log.rename(tmp_path / "run.mcap")
    flip(damaged, whole.find(b"zstd") + 60)
    campaign = IMPORTER.open(damaged)
    with pytest.raises(DamagedLogError, match="rig log repair"):
        campaign.runs[0].recording()
    damaged.write_bytes(whole[:-1])
    with pytest.raises(DamagedLogError, match="does not end as MCAP"):
        IMPORTER.open(damaged)


def test_a_folder_without_logs_is_not_recognised(tmp_path):
    (tmp_path / "a.mcap").write_text("only the name of a log")
    assert not IMPORTER.recognises(tmp_path)
    (tmp_path / "a.mcap").unlink()
    with pytest.raises(DataError, match="no log"):
        IMPORTER.open(tmp_path)


def test_one_file_that_is_no_log_does_not_close_the_others(tmp_path):
    write_log(tmp_path / "a.mcap")
    (tmp_path / "bad.mcap").write_bytes(b"\x89MCAP0\r\nnothing")
    campaign = open_campaign(tmp_path)
    assert len(campaign) == 2
    good, bad = campaign.runs
    assert len(good.recording()) > 0
    with pytest.raises(DataError, match=r"bad\.mcap is not an MCAP file"):
        bad.recording()
    kept = open_campaign(tmp_path, skip_bad=True)
    assert kept.evidence.names == (good.name,)
    (tmp_path / "a.mcap").unlink()
    with pytest.raises(DataError, match="not an MCAP file"):
        open_campaign(tmp_path)


EXAMPLE = ROOT / "logs" / "example"


def test_the_example_is_whole_and_reads_as_a_run():
    (log,) = EXAMPLE.glob("*.mcap")
    assert check_log(log).verdict is Verdict.COMPLETE
    (run,) = open_campaign(EXAMPLE)
    assert len(run) == 2000
    assert run.conditions["load_command_a"] == 0.5
    assert run.conditions["frequency_hz"] == 0.5
    np.testing.assert_allclose(run["load_command_a"], 0.5)
    grasp_rad = np.ptp(run["spindle_angle_rad"])
    assert 0.98 * np.pi / 3 < grasp_rad < 1.02 * np.pi / 3
