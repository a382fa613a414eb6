"""The verbs as they are typed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.recording import Recording
from rig.errors import ExitCode
from rig.importers.registry import open_campaign
from rig.log.convert import write_recording
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS_STREAM
from rig.log.writer import LogWriter
from rig.recording.campaign import open_campaign_folder
from tests.rig.log.conftest import write_log
from tests.rig.simulated import short_protocol, simulated


@pytest.fixture
def rig(said, answered):
    """Run `rig log ...`; return what it printed, as JSON where that is asked for."""
    return lambda *words, json=False, code=0: (answered if json else said)("log", *words, code=code)


def test_info_for_people(rig, log):
    out, err = rig("info", log)
    assert err == ""
    for words in ("run of bench 1", "load_command_a = 0.3", "/rig/sample", "1000.00", "rig.toml"):
        assert words in out
    assert "2026-09-21T" in out


def test_the_first_line_of_info_is_what_was_lost(rig, tmp_path):
    first = write_log(tmp_path / "a.mcap")
    assert rig("info", first).out.startswith(f"{first}: complete, nothing lost")
    second = write_log(tmp_path / "b.mcap", drop=frozenset({30, 31}))
    assert "2 samples" in rig("info", second).out.splitlines()[0]
    (found,) = rig("info", second, json=True)["logs"]
    assert found["lost"]["/rig/sample"] == 2
    assert found["problems"]
    assert rig("info", tmp_path).out.startswith("2 logs, 1 of them not complete.")


def test_brackets_and_colons_are_printed_as_they_were_typed(rig, tmp_path, log):
    name, notes = "br[ack]et :x:", "jaw [/] cleaned [red]twice[/red] :warning:"
    run, end = RunInfo(name, rig="bench [1]", notes=notes), RunEnd(clean=False, reason="[limits] a")
    folder = tmp_path / name
    folder.mkdir()
    with LogWriter(folder / "a.mcap", run, [COUNTS_STREAM]) as writer:
        writer.close(end)
    out, err = rig("info", folder)
    assert err == ""
    for words in (str(folder / "a.mcap"), name, notes, "bench [1]", "[limits] a"):
        assert words in out
    assert str(folder / "a.mcap") in rig("check", folder, code=1).out


def test_check_of_a_folder_ends_with_the_worst_code(rig, tmp_path):
    write_log(tmp_path / "a.mcap")
    rig("check", tmp_path)
    write_log(tmp_path / "b.mcap", drop=frozenset({30, 31, 350}))
    out = rig("check", tmp_path, code=ExitCode.FAILED).out
    for gap in ("0.0290 s, 3.0 ms: 2 samples, 30 to 31", "0.3490 s, 2.0 ms: 1 sample, 350\n"):
        assert out.count(f"gap at {gap}") == 2  # in each of two streams
    whole = write_log(tmp_path / "c.mcap")
    whole.write_bytes(whole.read_bytes()[:-1])
    out = rig("check", tmp_path, json=True, code=ExitCode.DATA)
    assert out["exit_code"] == ExitCode.DATA
    assert [log["verdict"] for log in out["logs"]] == ["complete", "incomplete", "damaged"]
    complete, incomplete, _ = out["logs"]
    assert complete["problems"] == []
    for log, samples, gaps in ((complete, 600, 0), (incomplete, 597, 2)):
        assert log["topics"][0]["expected_by_recorder"] == 600
        found = [(t["received"], t["expected"], len(t["gaps"])) for t in log["topics"]]
        assert found == 2 * [(samples, 600, gaps)]


def test_check_does_not_count_what_was_recorded_again(rig, tmp_path):
    data = write_log(tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.aborted-1.mcap.part").write_bytes(data[: data.find(b"rig.end") - 20])
    write_log(tmp_path / "b.mcap")
    out = rig("check", tmp_path).out
    assert f"superseded  {tmp_path / 'a.aborted-1.mcap.part'}" in out
    last = out.splitlines()[-1]
    assert last == "2 of 2 runs complete, 1200 of 1200 samples; 1 superseded log not counted."
    (tmp_path / "a.mcap").unlink()
    assert rig("check", tmp_path, json=True, code=ExitCode.DATA)["superseded"] == []


def test_a_whole_log_that_was_set_aside_is_no_second_run(rig, tmp_path):
    whole = write_log(tmp_path / "a.mcap")
    aside = tmp_path / "a.aborted-1.mcap"
    aside.write_bytes(whole.read_bytes())
    assert rig("check", tmp_path, json=True)["superseded"] == [str(aside)]
    assert len(open_campaign(tmp_path).runs) == 1


def test_check_names_the_runs_of_a_campaign_that_are_missing(rig, tmp_path):
    todo = open_campaign_folder(tmp_path, short_protocol(2), simulated(), resume=False)
    first, second = todo
    time_s = np.arange(1000) / 1000
    made = Recording(first.name, time_s, {"motor_current_a": time_s})
    write_recording(tmp_path / f"{first.name}.mcap", made)
    out = rig("check", tmp_path, code=ExitCode.FAILED).out
    assert f"missing     {second.name}. Record it: rig record --resume {tmp_path}" in out
    assert out.splitlines()[-1].startswith("1 of 2 runs complete")


def test_repair_reports_what_was_saved_and_lost(rig, log):
    assert "not damaged" in rig("repair", log).out
    assert [*log.parent.iterdir()] == [log]
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    out = rig("repair", log, json=True)
    assert out["repaired"].endswith("run.repaired.mcap")
    assert 0 < out["recovered"]["/rig/sample"] < 600
    assert "already" in rig("repair", log, code=2).err
    told = rig("repair", log, "--out", log.with_name("again.mcap")).out
    assert "read it back equal" in told
    assert "is unchanged" in told


def test_export(rig, log, tmp_path):
    assert len(rig("export", log, "--format npz", json=True)["written"]) == 2
    told = rig("export", log, "--topic /rig/sample --out", tmp_path / "x.csv").out
    assert told == f"wrote {tmp_path / 'x.csv'}\n"
    assert "csv, parquet, npz" in rig("export", log, "--format xls", code=2).err
    log.write_bytes(log.read_bytes()[:-50])
    assert "rig log repair" in rig("export", log, "--out", tmp_path / "y.csv", code=5).err
    assert not (tmp_path / "y.csv").exists()


@pytest.mark.parametrize("format_name", ["parquet", "csv"])
def test_a_campaign_is_exported_as_one_table_with_units_and_conditions(rig, tmp_path, format_name):
    from pyarrow import csv, parquet

    folder, time_s = tmp_path / "campaign", np.arange(50) / 1000
    folder.mkdir()
    for k, name in enumerate(("a", "b", "bad")):
        columns = {"motor_current_a": time_s + k} | ({"jaw_angle_rad": time_s} if k else {})
        made = Recording(name, time_s, columns, conditions={"load_a": 0.1 * k, "object": "spring"})
        excluded = "cable slipped" if name == "bad" else None
        write_recording(folder / f"{name}.mcap", replace(made, excluded=excluded, notes="dry"))
    assert "cable slipped" in rig("export", folder, "--format", format_name).err
    path = tmp_path / f"campaign.{format_name}"
    table = parquet.read_table(path) if format_name == "parquet" else csv.read_csv(path)
    rows = table.to_pydict()
    assert rows["run"] == ["a"] * 50 + ["b"] * 50
    assert rows["condition_load_a"] == [0.0] * 50 + [0.1] * 50
    assert np.isnan(np.array(rows["jaw_angle_rad"], float)).sum() == 50
    if format_name == "parquet":
        assert table.schema.field("motor_current_a").metadata[b"unit"] == b"A"
    else:
        beside = json.loads((tmp_path / "campaign.csv.json").read_text())
        assert beside["units"]["motor_current_a"] == "A"
    assert "already" in rig("export", folder, "--format", format_name, code=2).err
    rig("export", folder, "--force --format", format_name)
    rig("export", folder, "--format", format_name, "--out", tmp_path / "tables")
    assert (tmp_path / "tables" / f"{folder.name}.{format_name}").is_file()
    log = folder / "a.mcap"
    before = log.read_bytes()
    for source, more in ((folder, ""), (log, "--topic /rig/sample")):
        words = ("export", source, "--force", more, "--format", format_name, "--out", log)
        assert "not replaced" in rig(*words, code=2).err
    assert log.read_bytes() == before


def test_a_file_that_is_no_log_is_listed_among_the_logs_of_its_folder(rig, tmp_path):
    write_log(tmp_path / "a.mcap")
    (tmp_path / "z.mcap").write_text("hello")
    out = rig("check", tmp_path, code=5).out
    for words in ("complete    ", "no log      ", "z.mcap is not an MCAP file"):
        assert words in out
    assert "z.mcap is not an MCAP file" in rig("info", tmp_path).err
    rig("check", tmp_path / "z.mcap", code=5)
