"""`rig diagnose` of recordings that decide nothing: it reports what and why, and names nothing."""

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.recording import Instrument, Recording
from rig.cli.main import main
from rig.diagnosis import subject
from tests.estimation.campaigns import runs, spring

pytestmark = pytest.mark.long

Spoil = Callable[[list[Recording]], list[Recording]]


def without(channel: str, places: slice = slice(None)) -> Spoil:
    """Take a channel out of some runs."""

    def spoilt(recordings: list[Recording]) -> list[Recording]:
        chosen = {r.name for r in recordings[places]}
        return [
            replace(r, columns={n: v for n, v in r.columns.items() if n != channel})
            if r.name in chosen
            else r
            for r in recordings
        ]

    return spoilt


def every(change: Callable[[Recording], Recording]) -> Spoil:
    """Change every run."""
    return lambda recordings: [change(r) for r in recordings]


def standing(r: Recording) -> Recording:
    """The rig stands, with current and torque held."""
    return r.with_columns(**{name: np.full(len(r), float(v[0])) for name, v in r.columns.items()})


def holed(r: Recording) -> Recording:
    """Some samples of a channel are not numbers, and no flag says so."""
    current = r["motor_current_a"].copy()
    current[700:720] = np.nan
    return r.with_columns(motor_current_a=current)


def of_two(**names: object) -> Spoil:
    """Every other run is of something else."""
    return lambda recordings: [
        replace(r, **names) if k % 2 else r for k, r in enumerate(recordings)
    ]


CASES: dict[str, tuple[Spoil, str]] = {
    "one run": (lambda r: r[:1], "too few to diagnose"),
    "two runs that do not repeat": (lambda r: r[:2], "does not repeat itself"),
    "no run": (lambda _: [], "too few to diagnose"),
    "no current": (without("motor_current_a"), "motor_current_a"),
    "no current in one run": (without("motor_current_a", slice(1)), "motor_current_a"),
    "no torque": (without("proximal_torque_n_m"), "proximal_torque_n_m"),
    "NaN throughout": (
        every(lambda r: r.with_columns(motor_current_a=np.full(len(r), np.nan))),
        "not finite",
    ),
    "NaN in one run": (lambda r: [holed(r[0]), *r[1:]], "not finite"),
    "a rig that stands": (every(standing), "Record runs in which the rig moves"),
    "two rigs": (of_two(rig="another rig"), "2 rigs"),
    "two instruments": (
        of_two(instrument=Instrument(model="Maryland", serial="another")),
        "2 instruments",
    ),
}


def diagnosed(monkeypatch, folder: Path, recordings: list[Recording]) -> dict[str, Any]:
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    words = ["diagnose", str(folder), "--equation", "motor", "--quick"]
    words += ["--ledger", str(folder / "looks.jsonl"), "--json-out", str(folder / "diagnosis.json")]
    assert main(words) == 0
    found: dict[str, Any] = json.loads((folder / "diagnosis.json").read_text())
    return found


def test_with_few_runs_something_may_be_missing_and_nothing_has_a_name(monkeypatch, tmp_path):
    found = diagnosed(monkeypatch, tmp_path, runs(spring, count=6, seconds=2.0))
    assert len(found["runs"]["discover"]) == 4
    assert {f["family"] for f in found["findings"]} <= {"unknown"}
    assert any("fewer than 5 no effect is named" in note for note in found["notes"])


def test_what_never_varies_is_reported(monkeypatch, tmp_path):
    held = [
        r.with_columns(load_command_a=np.full(len(r), 0.5))
        for r in runs(spring, count=6, seconds=2.0)
    ]
    found = diagnosed(monkeypatch, tmp_path, held)
    assert any(n.startswith("load_command_a never varies") for n in found["notes"])


@pytest.mark.parametrize("what", CASES)
def test_nothing_is_decided_and_the_reason_is_reported(monkeypatch, tmp_path, capsys, what) -> None:
    spoil, reason = CASES[what]
    recordings = spoil(runs(spring, count=9, seconds=2.0))
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    ledger, out = tmp_path / "looks.jsonl", tmp_path / "diagnosis.json"
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--quick"]
    assert main([*words, "--ledger", str(ledger), "--json-out", str(out)]) == 5
    said = capsys.readouterr().err
    assert reason in " ".join(said.split())
    assert "spring" not in said
    assert not ledger.exists()
    assert not out.exists()


@pytest.mark.parametrize("option", ["--json-out", "--report", "--model-out", "--protocol-out"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(option, tmp_path, capsys):
    """The held-out runs would be used up, and nobody would have seen the result."""
    ledger = tmp_path / "looks.jsonl"
    words = ["diagnose", str(tmp_path / "no such recordings"), "--ledger", str(ledger)]
    assert main([*words, option, "/dev/null/x"]) == 2
    assert "/dev/null/x" in capsys.readouterr().err
    assert not ledger.exists()


def test_a_ledger_that_cannot_be_written_is_refused_before_the_work(monkeypatch, tmp_path, capsys):
    recordings = runs(spring, count=9, seconds=2.0)
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    out = tmp_path / "diagnosis.json"
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--quick", "--json-out", str(out)]
    assert main([*words, "--ledger", "/dev/null/x"]) == 5
    assert "reading the recordings" not in capsys.readouterr().err
    assert not out.exists()


def test_a_diagnosis_that_leaves_nothing_does_not_use_up_the_runs(monkeypatch, tmp_path):
    """A fault while its page is made, after the held-out runs were opened."""

    def broken(*_: object) -> str:
        raise ValueError("no page")

    recordings = runs(spring, count=9, seconds=2.0)
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    monkeypatch.setattr("rig.reports.diagnosis.page", broken)
    ledger = tmp_path / "looks.jsonl"
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--quick", "--ledger", str(ledger)]
    assert main([*words, "--report", str(tmp_path)]) == 70
    assert not ledger.exists()


def test_a_reader_that_leaves_early_has_the_files(monkeypatch, tmp_path):
    class Left(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", Left())
    recordings = runs(spring, count=9, seconds=2.0)
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    out, ledger = tmp_path / "diagnosis.json", tmp_path / "looks.jsonl"
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--quick", "--ledger", str(ledger)]
    main([*words, "--json-out", str(out)])
    assert json.loads(out.read_text())["schema"] == "rig.diagnosis/1"
    assert len(ledger.read_text().splitlines()) == 1


def test_a_rig_that_lacks_nothing_has_a_page(monkeypatch, tmp_path):
    monkeypatch.setattr(
        subject, "open_campaign", lambda *_: Campaign.of(runs(count=9, seconds=2.0))
    )
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--quick", "--report", str(tmp_path)]
    assert main([*words, "--ledger", str(tmp_path / "looks.jsonl")]) == 0
    assert "motor: measured and estimated" in (tmp_path / "diagnosis.html").read_text()
