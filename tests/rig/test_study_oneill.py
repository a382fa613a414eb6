"""`rig study oneill` on an analytic campaign, and on the measured data where it is there."""

import json
from pathlib import Path

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.recording import Flag, Recording, Stretch
from rig.errors import DataError
from rig.studies.oneill import data
from rig.studies.oneill.data import Source, open_reference
from rig.studies.oneill.page import page
from rig.studies.oneill.study import Study, StudyError, fit_line, run_study
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def result() -> Study:
    return run_study(Source(campaign(), "analytic rig", measured=False), seed=3)


def rows(result: Study) -> dict[tuple[str, str], float]:
    return {(row.surrogate, row.protocol): row.score.rmse for row in result.rows}


def test_every_surrogate_is_fitted_by_every_protocol(result):
    found = rows(result)
    assert len(found) == 3 * 5
    assert found["current", "run-wise"] > found["current", "random"] > 0
    assert found["command", "lopo"] == pytest.approx(found["current", "lopo"])  # proportional here
    assert found["gearbox", "authors"] > 3 * found["current", "authors"]
    row = next(r for r in result.rows if r.protocol == "authors" and r.surrogate == "current")
    assert row.gain_unit == "N m/A"
    assert row.gain == pytest.approx(0.94, rel=0.1)
    held_out = [r for r in result.rows if r.protocol in ("run-wise", "lofo", "lopo")]
    assert {r.score.samples for r in held_out} == {result.closing_samples}  # each run once
    assert {r.runs for r in result.rows} == {9}


def test_a_constant_surrogate_cannot_be_fitted():
    with pytest.raises(StudyError, match="closing samples"):
        fit_line(np.ones(10), np.arange(10.0))


def test_a_run_with_flagged_closing_samples_is_left_out_with_the_reason():
    runs = list(campaign())
    runs[4] = runs[4].with_stretch(Stretch(2.0, 6.0, Flag.SUSPECT, "runaway of the motor"))
    found = run_study(Source(Campaign.of(runs), "x", measured=False))
    assert found.left_out == {"11": "runaway of the motor"}
    assert len(found.runs) == 8
    assert any("Run 11 left out: runaway" in note for note in page(found).paragraphs)


def test_what_is_missing_is_reported_and_too_little_is_refused():
    runs = list(campaign())
    bare = []
    for r in runs:
        columns = {n: v for n, v in r.columns.items() if n != "motor_command_ratio"}
        bare.append(Recording(r.name, r.time_s, columns))
    found = run_study(Source(Campaign.of(bare), "x", measured=False))
    assert {row.surrogate for row in found.rows} == {"current", "gearbox"}
    assert any("no command" in note for note in found.notes)
    assert any("lopo" in note for note in found.notes)  # no conditions either
    with pytest.raises(DataError, match="too few"):
        run_study(Source(Campaign.of(runs[:1]), "x", measured=False))
    with pytest.raises(DataError, match="campaign is empty"):
        run_study(Source(Campaign(()), "x", measured=False))


def test_the_reference_part_is_picked_and_reported(tmp_path, monkeypatch):
    opened: list[Path] = []

    def opener(path: Path) -> Campaign:
        opened.append(path)
        return Campaign.of(list(campaign())[:2])

    monkeypatch.setattr(data, "open_campaign", opener)
    (tmp_path / "Tool_4_Maryland_L_4").mkdir()
    (tmp_path / "Tool_5_Maryland_L_2").mkdir()
    (tmp_path / "mrdlab-Tool_4_Maryland_L_4.tar.xz").touch()
    source = open_reference(tmp_path)
    assert opened == [tmp_path / "Tool_4_Maryland_L_4"]
    assert source.measured
    assert "Tool_4_Maryland_L_4 was taken" in source.notes[0]
    other = open_reference(tmp_path / "Tool_5_Maryland_L_2")
    assert not other.measured
    assert "do not apply" in other.notes[0]


def test_the_command_writes_tables_and_json(tmp_path, monkeypatch, said):
    monkeypatch.setattr(
        data, "open_reference", lambda path: Source(campaign(), "analytic rig", measured=False)
    )
    out = tmp_path / "d" / "oneill.md"
    printed = said("study oneill --json --seed 5 --data", tmp_path, "--out", out)
    found = json.loads(printed.out)
    assert found["schema"] == "rig.study.oneill/1"
    assert found["provenance"]["seed"] == 5
    assert len(found["rows"]) == 15
    assert "Table I: proximal torque" in printed.err
    text = out.read_text()
    assert text.startswith("# Grip torque and jaw angle")
    assert f"{found['closing_samples']:,} closing samples; the paper states 260,581" in text
    (line,) = [row for row in text.splitlines() if row.startswith("| linear: current |")]
    assert line.endswith("| 10.06 | 23.26 | 12.26 | 0.97 | 0.97 |")
    assert "14.17 (command), 14.24 (current)" in text
    assert text.index("## Table I:") < text.index("## Before comparing")
    assert "seed 5" in text


@pytest.mark.measured
def test_measured_data_gives_the_published_numbers(measured_data):
    found = run_study(open_reference(measured_data))
    rmse = {key: 1e3 * value for key, value in rows(found).items()}
    assert found.measured
    assert found.closing_samples == 308_117
    assert list(found.left_out) == ["07"]
    for surrogate, published in (("command", 14.17), ("current", 14.24), ("gearbox", 43.14)):
        assert rmse[surrogate, "authors"] == pytest.approx(published, abs=0.01)
    assert rmse["command", "run-wise"] == pytest.approx(14.05, abs=0.05)
