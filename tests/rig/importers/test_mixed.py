"""Runs of several rigs are not opened as one, and what is left out is named with its reason."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.recording import Instrument, Recording
from rig.importers.registry import MixedRunsError, left_out, open_campaign
from rig.log.convert import write_recording


def run(name: str, serial: str = "4", **changes: object) -> Recording:
    """A run of a tool, 2 s of a sine against friction."""
    time_s = np.arange(2000) / 1000
    speed = np.cos(2 * np.pi * time_s)
    columns = {
        "motor_current_a": 0.1 * np.sign(speed) + 0.05 * np.sin(2 * np.pi * time_s),
        "spindle_angle_rad": np.sin(2 * np.pi * time_s) / (2 * np.pi),
        "motor_angle_rad": 35 * np.sin(2 * np.pi * time_s) / (2 * np.pi),
        "proximal_torque_n_m": 0.05 * np.sin(2 * np.pi * time_s),
        "distal_torque_n_m": 0.04 * np.sin(2 * np.pi * time_s),
    }
    made = Recording(name, time_s, columns, rig="bench", instrument=Instrument("Maryland", serial))
    return replace(made, **changes)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (run("b", serial="5"), "instruments: a of Maryland 4, b of Maryland 5"),
        (run("b", rig="another"), "rigs: a of bench, b of another"),
    ],
)
def test_runs_of_two_rigs_are_refused(tmp_path, said, other, words):
    for recording in (run("a"), other, run("c")):
        write_recording(tmp_path / f"{recording.name}.mcap", recording)
    assert words in said("fit", tmp_path, code=5).err
    with pytest.raises(MixedRunsError):
        list(open_campaign(tmp_path))
    assert open_campaign(tmp_path).runs[1].recording().name == "b"  # one by itself is shown


def test_an_excluded_run_of_another_rig_does_no_harm(tmp_path):
    write_recording(tmp_path / "a.mcap", run("a"))
    write_recording(tmp_path / "b.mcap", run("b", serial="5", excluded="another tool"))
    campaign = open_campaign(tmp_path)
    assert [r.name for r in campaign] == ["a", "b"]
    assert left_out(tmp_path, campaign) == ["Run b does not count: another tool"]


def test_files_of_another_format_and_earlier_attempts_are_named(tmp_path, make_log, said):
    for name in ("a", "b", "c"):
        write_recording(tmp_path / f"{name}.mcap", run(name))
    whole = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.aborted-1.mcap.part").write_bytes(whole[: whole.find(b"rig.end") - 20])
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "007.TXT").write_text(make_log().text())
    (tmp_path / "notes.txt").write_text("the cable was oiled")
    err = said("fit", tmp_path).err
    assert "another format; --format mrdlab opens it: more/007.TXT." in err
    assert "an earlier attempt of a run, or repaired: a.aborted-1.mcap.part." in err
    assert "notes.txt" not in err


@pytest.mark.parametrize("words", ["fit", "diagnose --quick --equation motor"])
def test_a_damaged_run_stops_a_command_unless_it_is_asked_to_skip_it(
    tmp_path, make_log, said, words, monkeypatch
):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / "runs"
    folder.mkdir()
    for number, load_a in enumerate((0.2, 0.3, 0.4)):
        text = make_log(seconds=8.0, load_a=load_a).text()
        (folder / f"{number:03}.TXT").write_text(text)
    (folder / "003.TXT").write_text(make_log().text() + "1.0, garbage\n")
    assert "003.TXT" in said(words, folder, code=5).err
    refused = said(words, folder, "--skip-bad --exclude 004", code=5).err
    assert "has no run '004'" in refused
    assert "fix: Name one of these." in refused
    err = said(words, folder, "--skip-bad --exclude 002").err
    for part in ("Run 002 does not count", "Run 003 does not count:", "003.TXT"):
        assert part in err


def test_a_folder_without_recordings_is_described(tmp_path, said):
    assert "holds no file" in said("fit", tmp_path, code=5).err
    (tmp_path / "bench.png").write_bytes(b"\x89PNG")
    assert "1 .png" in said("fit", tmp_path, code=5).err


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_an_exported_campaign_is_read_back(tmp_path, said, ending):
    pytest.importorskip("pyarrow")
    folder, table = tmp_path / "runs", tmp_path / f"all.{ending}"
    folder.mkdir()
    flags = np.zeros(2000, np.uint8)
    flags[7] = 1
    made = [run("a", conditions={"load_command_a": 0.2}, notes="oiled"), run("b", flags=flags)]
    for recording in made:
        write_recording(folder / f"{recording.name}.mcap", recording)
    said("log export", folder, "--format", ending, "--out", table)
    for before, after in zip(made, open_campaign(table), strict=True):
        assert after.name == before.name
        assert after.instrument == before.instrument
        assert dict(after.conditions) == dict(before.conditions)
        assert after.notes == before.notes
        np.testing.assert_array_equal(after.flags, before.flags)
        for name, values in before.columns.items():
            np.testing.assert_allclose(after[name], values, rtol=1e-12, atol=1e-15)
    out = said("log info", table).out
    assert "2 runs. Channels: motor_current_a" in out
    assert "a  1.999 s, 1000 Hz  load_command_a = 0.2" in out
    assert "flagged samples: 1" in out


def test_one_run_is_fitted_without_an_error_on_others(tmp_path, said):
    write_recording(tmp_path / "a.mcap", run("a"))
    printed = said("fit --json", tmp_path)
    assert json.loads(printed.out)["held_out"] is None
    assert "One run: there is no error on runs" in printed.err
