"""The verbs as they are typed."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from estimation.files import OutputError
from estimation.recording import Recording
from rig.cli.log import log_app
from rig.cli.main import main
from rig.configuration.config import load_config
from rig.errors import ExitCode, UsageError
from rig.log.convert import write_recording
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS_STREAM
from rig.log.writer import LogExistsError, LogWriter
from rig.protocols.protocol import Protocol
from rig.recording.campaign import open_campaign_folder
from tests.rig.log.conftest import write_log


@pytest.fixture
def rig(capsys):
    """Run `rig log ...` and return its exit code, what is on stdout and the text on stderr."""
    app = typer.Typer()
    app.add_typer(log_app)

    def run(*words: Any) -> tuple[int, Any, str]:
        code = app(["log", *map(str, words)], standalone_mode=False)
        out, err = capsys.readouterr()
        return int(code or 0), json.loads(out) if "--json" in words else out, err

    return run


def test_info_for_people(rig, log):
    code, out, err = rig("info", log)
    assert (code, err) == (0, "")
    for words in ("run of bench 1", "load_command_a = 0.3", "/rig/sample", "1000.00", "rig.toml"):
        assert words in out
    assert "2026-09-21T" in out


def test_the_first_line_of_info_is_what_was_lost(rig, tmp_path, make_log):
    first = make_log(tmp_path / "a.mcap")
    assert rig("info", first)[1].startswith(f"{first}: complete, nothing lost")
    second = make_log(tmp_path / "b.mcap", drop=frozenset({30, 31}))
    line = rig("info", second)[1].splitlines()[0]
    assert "2 samples" in line
    found = rig("info", second, "--json")[1]["logs"][0]
    assert found["lost"]["/rig/sample"] == 2
    assert found["problems"]
    assert rig("info", tmp_path)[1].startswith("2 logs, 1 of them not complete.")


def test_brackets_and_colons_are_printed_as_they_were_typed(rig, tmp_path, log):
    name, notes = "br[ack]et :x:", "jaw [/] cleaned [red]twice[/red] :warning:"
    run, end = RunInfo(name, rig="bench [1]", notes=notes), RunEnd(clean=False, reason="[limits] a")
    folder = tmp_path / name
    folder.mkdir()
    with LogWriter(folder / "a.mcap", run, [COUNTS_STREAM]) as writer:
        writer.close(end)
    code, out, err = rig("info", folder)
    assert (code, err) == (0, "")
    for words in (str(folder / "a.mcap"), name, notes, "bench [1]", "[limits] a"):
        assert words in out
    assert str(folder / "a.mcap") in rig("check", folder)[1]


def test_check_of_a_folder_ends_with_the_worst_code(rig, tmp_path, make_log):
    make_log(tmp_path / "a.mcap")
    assert rig("check", tmp_path)[0] == ExitCode.OK
    make_log(tmp_path / "b.mcap", drop=frozenset({30, 31}))
    code, out, _ = rig("check", tmp_path)
    assert code == ExitCode.FAILED
    assert "gap at 0.0290 s, 3.0 ms: 2 samples, 30 to 31" in out
    whole = make_log(tmp_path / "c.mcap")
    whole.write_bytes(whole.read_bytes()[:-1])
    code, out, _ = rig("check", tmp_path, "--json")
    assert code == out["exit_code"] == ExitCode.DATA
    assert [log["verdict"] for log in out["logs"]] == ["complete", "incomplete", "damaged"]
    assert out["logs"][1]["topics"][0]["gaps"][0]["samples"] == 2


def test_check_does_not_count_what_was_recorded_again(rig, tmp_path, make_log):
    data = make_log(tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.aborted-1.mcap.part").write_bytes(data[: data.find(b"rig.end") - 20])
    (tmp_path / "b.mcap").write_bytes(make_log(tmp_path / "b.mcap").read_bytes())
    code, out, _ = rig("check", tmp_path)
    assert code == ExitCode.OK
    assert f"superseded  {tmp_path / 'a.aborted-1.mcap.part'}" in out
    last = out.splitlines()[-1]
    assert last == "2 of 2 runs complete, 2400 of 2400 samples; 1 superseded log not counted."
    (tmp_path / "a.mcap").unlink()
    code, out, _ = rig("check", tmp_path, "--json")
    assert code == ExitCode.DATA
    assert out["superseded"] == []


def test_check_names_the_runs_of_a_campaign_that_are_missing(rig, tmp_path):
    protocol = Protocol.model_validate(
        {"name": "p", "runs": [{"kind": "sine", "frequencies_hz": [1.0], "loads_a": [0.1, 0.2],
                                "duration_s": 1.0}]}
    )  # fmt: skip
    config = load_config(Path("simulated"))
    first, second = open_campaign_folder(tmp_path, protocol, config, resume=False)
    time_s = np.arange(1000) / 1000
    made = Recording(first.name, time_s, {"motor_current_a": time_s})
    write_recording(tmp_path / f"{first.name}.mcap", made)
    code, out, _ = rig("check", tmp_path)
    assert code == ExitCode.FAILED
    assert f"missing     {second.name}. Record it: rig record --resume {tmp_path}" in out
    assert out.splitlines()[-1].startswith("1 of 2 runs complete")


def test_repair_reports_what_was_saved_and_lost(rig, log):
    assert "not damaged" in rig("repair", log)[1]
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    code, out, _ = rig("repair", log, "--json")
    assert code == 0
    assert out["repaired"].endswith("run.repaired.mcap")
    assert 0 < out["recovered"]["/rig/sample"] < 600
    with pytest.raises(LogExistsError):
        rig("repair", log)
    told = rig("repair", log, "--out", log.with_name("again.mcap"))[1]
    assert "read it back equal" in told
    assert "is unchanged" in told


def test_export(rig, log, tmp_path):
    code, out, _ = rig("export", log, "--format", "npz", "--json")
    assert (code, len(out["written"])) == (0, 2)
    told = rig("export", log, "--topic", "/rig/sample", "--out", tmp_path / "x.csv")[1]
    assert told == f"wrote {tmp_path / 'x.csv'}\n"
    with pytest.raises(UsageError, match="csv, parquet, npz"):
        rig("export", log, "--format", "xls")


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
    code, _, err = rig("export", folder, "--format", format_name)
    assert code == ExitCode.OK
    assert "cable slipped" in err
    path = tmp_path / f"campaign.{format_name}"
    table = parquet.read_table(path) if format_name == "parquet" else csv.read_csv(path)
    rows = table.to_pydict()
    assert rows["run"] == ["a"] * 50 + ["b"] * 50
    assert rows["condition_load_a"] == [0.0] * 50 + [0.1] * 50
    np.testing.assert_array_equal(rows["motor_current_a"], [*time_s, *(time_s + 1)])
    assert np.isnan(np.array(rows["jaw_angle_rad"], float)).sum() == 50
    if format_name == "parquet":
        about = json.loads(table.schema.metadata[b"rig.runs"])
        assert table.schema.field("motor_current_a").metadata[b"unit"] == b"A"
    else:
        beside = json.loads((tmp_path / "campaign.csv.json").read_text())
        about = beside["runs"]
        assert beside["units"]["motor_current_a"] == "A"
    assert about["b"]["notes"] == "dry"
    assert about["b"]["conditions"] == {"load_a": 0.1, "object": "spring"}
    with pytest.raises(OutputError, match="already"):
        rig("export", folder, "--format", format_name)
    assert rig("export", folder, "--format", format_name, "--force")[0] == ExitCode.OK
    log = folder / "a.mcap"
    before = log.read_bytes()
    for source, more in ((folder, []), (log, ["--topic", "/rig/sample"])):
        with pytest.raises(OutputError, match="not replaced"):
            rig("export", source, "--format", format_name, "--out", log, "--force", *more)
    assert log.read_bytes() == before


def test_a_file_that_is_no_log_is_listed_among_the_logs_of_its_folder(tmp_path, capsys):
    write_log(tmp_path / "a.mcap")
    (tmp_path / "z.mcap").write_text("hello")
    assert main(["log", "check", str(tmp_path)]) == 5
    said = capsys.readouterr().out
    assert "complete    " in said
    assert "no log      " in said
    assert "z.mcap is not an MCAP file" in said
    assert main(["log", "info", str(tmp_path)]) == 0
    assert "z.mcap is not an MCAP file" in capsys.readouterr().err
    assert main(["log", "check", str(tmp_path / "z.mcap")]) == 5
