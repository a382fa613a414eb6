"""`rig diagnose` of recordings that decide nothing: it reports what and why, and names nothing."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.recording import Instrument, Recording
from rig.diagnosis import subject
from tests.estimation.synthetic import runs, spring

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
    "a torque sensor that is stuck": (
        every(lambda r: r.with_columns(proximal_torque_n_m=np.full(len(r), 0.12))),
        "proximal_torque_n_m is constant at 0.12 N m",
    ),
    "clocks that jump": (every(jumping), "its clock jumps"),
    "two rigs": (of_two(rig="another rig"), "2 rigs"),
    "two instruments": (
        of_two(instrument=Instrument(model="Maryland", serial="another")),
        "2 instruments",
    ),
}


@pytest.fixture
def diagnose(monkeypatch, tmp_path, said):
    """Diagnose recordings and return what is printed."""

    def run(recordings, *words, code=5):
        monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
        files = ("--ledger", tmp_path / "looks.jsonl", "--json-out", tmp_path / "diagnosis.json")
        return said("diagnose --equation motor --quick", tmp_path, *files, *words, code=code).err

    return run


def test_what_limits_a_diagnosis_is_reported(diagnose, tmp_path):
    few = [
        r.with_columns(load_command_a=np.full(len(r), 0.5))
        for r in runs(spring, count=6, seconds=2.0)
    ]
    diagnose([jumping(few[0]), *few[1:]], code=0)
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert len(found["runs"]["discover"]) == 4
    assert few[0].name not in {*found["runs"]["discover"], *found["runs"]["confirm"]}
    assert any("jumps by 0.401 s at 0.699 s" in note for note in found["notes"])
    assert {f["family"] for f in found["findings"]} <= {"unknown"}
    assert any("fewer than 5 no effect is named" in note for note in found["notes"])
    assert any(n.startswith("load_command_a never varies") for n in found["notes"])


@pytest.mark.parametrize("what", CASES)
def test_nothing_is_decided_and_the_reason_is_reported(diagnose, tmp_path, what):
    spoil, reason = CASES[what]
    printed = diagnose(spoil(runs(spring, count=9, seconds=2.0)))
    assert reason in " ".join(printed.split())
    assert "spring" not in printed
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("option", ["--json-out", "--report", "--model-out", "--protocol-out"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(option, tmp_path, said):
    """The held-out runs would be used up, and nobody would have seen the result."""
    ledger = tmp_path / "looks.jsonl"
    words = ("diagnose", tmp_path / "no such recordings", "--ledger", ledger)
    assert "/dev/null/x" in said(*words, option, "/dev/null/x", code=2).err
    assert not ledger.exists()


@pytest.mark.parametrize("option", ["--model-out", "--protocol-out"])
def test_a_model_or_a_protocol_is_never_written_over(option, tmp_path, said):
    there = tmp_path / "mine.toml"
    there.write_text('schema = "rig.model/1"\n' if option == "--model-out" else "[[runs]]\n")
    words = ("diagnose", tmp_path / "no such recordings", option, there)
    assert "is there already" in said(*words, code=2).err


def test_a_ledger_that_cannot_be_written_is_refused_before_the_work(diagnose, tmp_path):
    printed = diagnose(runs(spring, count=9, seconds=2.0), "--ledger /dev/null/x")
    assert "reading the recordings" not in printed
    assert not [*tmp_path.iterdir()]
