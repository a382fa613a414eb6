"""`rig diagnose` of recordings that decide nothing: it reports what and why, and names nothing."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

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


def jumping(recording: Recording) -> Recording:
    """The clock jumps."""
    time_s = recording.time_s.copy()
    time_s[700:] += 0.4
    return replace(recording, time_s=time_s)


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
    "clocks that jump": (every(jumping), "its clock jumps"),
    "two rigs": (of_two(rig="another rig"), "2 rigs"),
    "two instruments": (
        of_two(instrument=Instrument(model="Maryland", serial="another")),
        "2 instruments",
    ),
}


def command(monkeypatch, folder: Path, recordings: list[Recording]) -> list[str]:
    """Return the words that diagnose recordings."""
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    words = ["diagnose", str(folder), "--equation", "motor", "--quick"]
    words += ["--ledger", str(folder / "looks.jsonl")]
    return [*words, "--json-out", str(folder / "diagnosis.json")]


def test_what_limits_a_diagnosis_is_reported(monkeypatch, tmp_path):
    few = [
        r.with_columns(load_command_a=np.full(len(r), 0.5))
        for r in runs(spring, count=6, seconds=2.0)
    ]
    assert main(command(monkeypatch, tmp_path, [jumping(few[0]), *few[1:]])) == 0
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert len(found["runs"]["discover"]) == 4
    assert few[0].name not in {*found["runs"]["discover"], *found["runs"]["confirm"]}
    assert any("jumps by 0.401 s at 0.699 s" in note for note in found["notes"])
    assert {f["family"] for f in found["findings"]} <= {"unknown"}
    assert any("fewer than 5 no effect is named" in note for note in found["notes"])
    assert any(n.startswith("load_command_a never varies") for n in found["notes"])


@pytest.mark.parametrize("what", CASES)
def test_nothing_is_decided_and_the_reason_is_reported(monkeypatch, tmp_path, capsys, what):
    spoil, reason = CASES[what]
    recordings = spoil(runs(spring, count=9, seconds=2.0))
    assert main(command(monkeypatch, tmp_path, recordings)) == 5
    said = capsys.readouterr().err
    assert reason in " ".join(said.split())
    assert "spring" not in said
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("option", ["--json-out", "--report", "--model-out", "--protocol-out"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(option, tmp_path, capsys):
    """The held-out runs would be used up, and nobody would have seen the result."""
    ledger = tmp_path / "looks.jsonl"
    words = ["diagnose", str(tmp_path / "no such recordings"), "--ledger", str(ledger)]
    assert main([*words, option, "/dev/null/x"]) == 2
    assert "/dev/null/x" in capsys.readouterr().err
    assert not ledger.exists()


def test_a_ledger_that_cannot_be_written_is_refused_before_the_work(monkeypatch, tmp_path, capsys):
    words = command(monkeypatch, tmp_path, runs(spring, count=9, seconds=2.0))
    assert main([*words, "--ledger", "/dev/null/x"]) == 5
    assert "reading the recordings" not in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


def test_an_unknown_equation_is_a_usage_error(tmp_path, capsys):
    assert main(["diagnose", str(tmp_path), "--equation", "elbow"]) == 2
    assert "elbow" in capsys.readouterr().err
