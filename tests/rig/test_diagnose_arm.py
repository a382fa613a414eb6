"""`rig diagnose` on recordings of an arm: its joints are balances, in the same JSON and page."""

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.diagnosis.split import cut_and_split, path_of
from estimation.recording import Recording
from rig.arm.simulated import RATE_HZ, draw_arm, excitation, recorded, simulate
from rig.diagnosis import subject
from rig.diagnosis.run import repeats
from rig.diagnosis.schema import DiagnosisSchema

pytestmark = pytest.mark.long

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")


def runs() -> Campaign:
    """Runs of an arm whose second joint has friction with memory that no model declares."""
    rng = np.random.default_rng(11)
    arm = draw_arm(rng)
    hidden = np.zeros_like(arm.hidden)
    hidden[0, 1] = arm.hidden[0, 1]
    made = []
    for k in range(8):
        run = simulate(replace(arm, hidden=hidden), excitation(rng, 12.0), rng)
        made.append(recorded(f"run {k}", run.position, run.torque, RATE_HZ))
    return Campaign.of(made)


def test_a_joint_is_diagnosed_like_any_balance(tmp_path, monkeypatch, said):
    campaign = runs()
    monkeypatch.setattr(subject, "open_campaign", lambda *_: campaign)
    out, report = tmp_path / "diagnosis.json", tmp_path / "report"
    words = ("--quick --json-out", out, "--report", report, "--ledger", tmp_path / "looks.jsonl")
    said("diagnose --equation joint.2", tmp_path, *words)
    found = json.loads(out.read_text())
    DiagnosisSchema.model_validate(found)
    assert set(found["rmse_before"]) == {"joint.2"}
    first = next(f for f in found["findings"] if f["balance"] == "joint.2")
    assert first["family"].startswith("hysteresis.")
    assert "history" in first["depends_on"]
    page = (report / "diagnosis.html").read_text()
    assert first["family"] in page
    assert "joint.2: residual over joint 2" in page
    said("diagnose --equation joint.2", tmp_path, *words)
    assert json.loads(out.read_text())["exploratory"] is True
    assert "joint.6" in said("diagnose --equation joint.9", tmp_path, *words, code=2).err


def test_whole_periods_of_one_path_are_repeats():
    time_s = np.arange(1700) / 100
    angles = [np.sin(time_s * 2 * np.pi / period_s) for period_s in (4.0, 5.0)]
    paths = [
        Recording(n, time_s, {"joint_1_angle_rad": a}) for n, a in zip("ab", angles, strict=True)
    ]
    pieces, _ = cut_and_split(paths)
    lengths = {piece.name: len(piece) for piece in pieces}
    pairs = repeats(pieces)
    assert {path_of(name) for pair in pairs for name in pair} == {"a", "b"}
    assert all(path_of(one) == path_of(other) for one, other in pairs)
    assert all(lengths[one] == lengths[other] for one, other in pairs)
    assert len(pairs) == 6 + 3  # four whole periods and three; a rest of a period repeats nothing
    assert repeats(paths) == []


def test_parts_of_one_recording_repeat_nothing():
    walk = np.cumsum(np.random.default_rng(0).normal(size=3000))
    recording = Recording("a", np.arange(3000) / 100, {"joint_1_angle_rad": walk})
    pieces, _ = cut_and_split([recording])
    assert len(pieces) > 5
    assert repeats(pieces) == []
