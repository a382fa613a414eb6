"""`rig study loop` on made recordings whose friction changes along the travel and sticks."""

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.effects import effect
from estimation.recording import Instrument, Recording
from rig.errors import DataError
from rig.studies.loop import study as loop

pytestmark = pytest.mark.long

STICKING = effect("friction.position.sticking")
FEW = ("friction.position", "friction.viscous", "inertia.missing", "spring.position")


def run(index: int, seconds: float = 8.0) -> Recording:
    """Return a run that closes and opens against its own load, with rests at both ends."""
    random = np.random.default_rng(index)
    time_s = np.arange(int(seconds * 1000)) / 1000.0
    swing = 0.55 * np.clip(1.3 * np.sin(2 * np.pi * (0.3 + 0.05 * index) * time_s), -1, 1)
    spindle = swing - 0.5
    smooth = np.convolve(np.gradient(spindle, 1e-3), np.ones(60) / 60, "same")
    wanted = 0.1 + 0.03 * index + 0.05 * spindle + 0.03 * np.tanh(smooth / 0.05)
    command = wanted + 0.02 * np.sin(2 * np.pi * 1.3 * time_s + index)
    inputs = {"travel": 35.0 * spindle, "drive": command, "position": spindle}
    lost = STICKING.columns(inputs, [0.3, 0.05, 0.2]) @ np.array([0.03, -0.02, 0.01, 0.005])
    torque = 0.9 * command - lost + 0.002 + 1e-4 * random.standard_normal(len(time_s))
    columns = {
        "motor_command_ratio": command,
        "motor_angle_rad": 35.0 * spindle,
        "spindle_angle_rad": spindle,
        "proximal_torque_n_m": torque,
    }
    conditions = {"load_command_a": 0.1 * (index % 3), "frequency_hz": 0.3 + 0.05 * index}
    return Recording(
        f"run-{index}", time_s, columns, conditions=conditions, instrument=Instrument("made", "1")
    )


@pytest.fixture
def made(monkeypatch):
    every = loop.candidates
    monkeypatch.setattr(loop, "open_campaign", lambda path: Campaign.of([run(k) for k in range(9)]))
    monkeypatch.setattr(
        loop,
        "candidates",
        lambda *args, **more: [c for c in every(*args, **more) if c.effect.family in FEW],
    )


def test_friction_that_sticks_is_found_and_proved_on_runs_kept_back(made, tmp_path):
    study = loop.run_study(tmp_path, tasks=[loop.TASKS[1]])
    (row,) = study.rows
    assert row.steps[0].effect == "friction.position.sticking"
    assert row.rmse < 0.25 * row.linear
    assert row.runs_improved == len(row.rmse_by_run) == len(study.sealed.confirm)
    assert set(row.rmse_by_run) == set(study.sealed.confirm)
    assert row.parameters == 2 + sum(step.parameters for step in row.steps) <= 15


def test_the_command_writes_tables_and_json(made, tmp_path, answered):
    page = tmp_path / "loop.md"
    found = answered("study loop --task 1 --data", tmp_path, "--out", page)
    assert found["rows"][0]["task"]["samples"] == "closing"
    text = page.read_text()
    assert "held-out test runs" in text
    assert all(step["effect"] in text for step in found["rows"][0]["steps"])


def test_a_missing_channel_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(loop, "open_campaign", lambda path: Campaign.of([run(k) for k in range(9)]))
    with pytest.raises(DataError, match="distal_torque_n_m"):
        loop.run_study(tmp_path, tasks=[loop.TASKS[2]])
