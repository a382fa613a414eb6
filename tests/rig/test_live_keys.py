"""Keys of the live display, its recordings, and what it reports of calibrations."""

import os
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calibration.linear import shipped_calibration_set
from calibration.record import Validity, record_of_line
from calibration.store import CalibrationStore
from rig.live.block import DeviceStatus, through
from rig.live.keys import display_keys
from rig.live.session_blocks import session_blocks
from rig.log.reader import read_log
from tests.rig.simulated import short_protocol, simulated, transport


def watched(config, keys, tmp_path, duration_s=2.0, plans=()):
    script = iter(keys)
    stream = session_blocks(
        config, lambda: transport(config), plans, (), lambda: next(script, ""), tmp_path
    )
    return list(through(stream, duration_s=duration_s))


def status(block, name):
    return next((d for d in block.devices if d.name == name), None)


def test_keys_start_mark_and_stop_a_recording_that_is_whole(tmp_path, monkeypatch):
    blocks = watched(simulated(), ["", "r", "", "m", "r", ""], tmp_path)
    (path,) = tmp_path.glob("*.mcap")
    log = read_log(path)
    recorded = blocks[1:4]
    assert log.end.clean
    assert len(log.topics["/rig/sample"]) == sum(len(block) for block in recorded)
    assert [mark.text for mark in log.marks] == ["mark 1"]
    assert log.run.zeros_before
    assert status(blocks[0], "recording") is None
    assert [status(block, "recording").state for block in blocks[1:5]] == ["on"] * 3 + ["off"]


def test_a_recording_that_nobody_stops_is_closed_with_the_stream(tmp_path):
    watched(simulated(), ["r"], tmp_path, duration_s=0.5)
    (path,) = tmp_path.glob("*.mcap")
    assert read_log(path).end.clean


def test_a_tare_takes_the_zero_of_a_rig_at_rest_only(tmp_path):
    *_, after = watched(simulated(), ["", "t", ""], tmp_path)
    assert status(after, "recording") == DeviceStatus("recording", "off", "tared")
    assert abs(after.columns["distal_torque_n_m"].mean()) < 1e-3
    moving = watched(simulated(), ["", "t"], tmp_path, plans=short_protocol(1).plans())
    assert "no tare while the rig moves" in status(moving[-1], "recording").detail


def test_a_stop_disarms_a_moving_rig_and_goes_on_watching(tmp_path):
    config = simulated()
    link = transport(config)
    script = iter(["", "s"])
    stream = session_blocks(
        config, lambda: link, short_protocol(1).plans(), (), lambda: next(script, ""), tmp_path
    )
    before = next(stream)
    pressed = next(stream)
    assert status(before, "logger").state == "armed"
    assert status(pressed, "stop") == DeviceStatus("stop", "disarmed", "confirmed by the board")
    after = list(through(stream, duration_s=1.0))
    assert {status(block, "logger").state for block in after[1:]} == {"disarmed"}
    assert np.ptp(after[-1].columns["spindle_angle_rad"]) < 1e-2


def test_q_quits_and_a_mark_needs_a_recording(tmp_path):
    blocks = watched(simulated(), ["m", "", "q"], tmp_path, duration_s=60.0)
    assert len(blocks) == 2
    assert "r starts one" in status(blocks[0], "recording").detail


@pytest.mark.parametrize(
    ("low", "days_old", "state", "words"),
    [
        (-1e6, 3, "ok", "1 record, oldest 3 days (proximal_torque_n_m)"),
        (-1e6, 12, "stale", "12 days old, good for 10"),
        (5e5, 3, "suspect", "outside its range: proximal_torque_n_m"),
    ],
)
def test_age_and_range_of_calibrations_are_shown(tmp_path, low, days_old, state, words):
    store = CalibrationStore(tmp_path / "store")
    record = record_of_line(
        shipped_calibration_set("reference").channels["proximal_torque_n_m"],
        kind="torque",
        made_at=(datetime.now(UTC) - timedelta(days=days_old)).isoformat(timespec="seconds"),
        operator="Ada",
        validity=Validity(low, 1e6, 10),
    )
    store.use(store.add(record), "2026-01-01T00:00:00+00:00", "Ada")
    config = simulated().model_copy(update={"calibration_store": str(store.folder)})
    (block, *_) = watched(config, [], tmp_path, duration_s=0.2)
    said = status(block, "calibration")
    assert said.state == state
    assert words in said.detail


def test_keys_are_read_from_a_terminal_and_it_is_given_back(monkeypatch):
    import pty
    import termios

    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r+b", buffering=0) as terminal:
        stdin = SimpleNamespace(isatty=lambda: True, fileno=terminal.fileno)
        monkeypatch.setattr(sys, "stdin", stdin)
        before = termios.tcgetattr(theirs)
        with display_keys() as keys:
            assert keys() == ""
            os.write(ours, b"rM")
            assert keys() == "rm"
        assert termios.tcgetattr(theirs) == before
    os.close(ours)
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with display_keys() as keys:
            assert keys is None
