"""`rig live` on the simulated rig: what it shows and records, its keys, and its safe end."""

import json
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
from estimation import model_file
from estimation.rest import in_motion
from rig.configuration.config import load_config
from rig.live.block import DeviceStatus, through
from rig.live.estimator import estimators_of
from rig.live.keys import display_keys
from rig.live.session_blocks import session_blocks
from rig.log.reader import read_log
from rig.protocols.protocol import load_protocol
from tests.rig.simulated import is_armed, short_protocol, simulated, transport

pytestmark = pytest.mark.integration


def stream(config, folder, plans=(), keys=(), estimators=(), link=None):
    """The blocks of a session, with keys pressed one after the other, a block each."""
    script = iter(keys)
    opened = link or transport(config)
    return session_blocks(
        config, lambda: opened, plans, estimators, lambda: next(script, ""), folder
    )


def status(block, name):
    return next((d for d in block.devices if d.name == name), None)


def test_a_plan_is_played_and_every_sample_shown_once(tmp_path):
    config = simulated()
    blocks = list(stream(config, tmp_path, short_protocol(1).plans()))
    time_s = np.concatenate([block.time_s for block in blocks])
    np.testing.assert_allclose(np.diff(time_s), 1e-3)
    assert status(blocks[0], "logger").state == "armed"
    assert {limit.name for limit in blocks[0].limits} <= set(config.limits.model_dump())
    assert max(block.columns["distal_torque_n_m"].max() for block in blocks) > 5e-3


def test_without_a_plan_the_rig_is_watched_for_the_asked_device_time_and_never_armed(tmp_path):
    blocks = list(through(stream(simulated(), tmp_path), duration_s=0.5))
    assert {status(block, "logger").state for block in blocks} == {"disarmed"}
    assert 0.5 <= blocks[-1].time_s[-1] - blocks[0].time_s[0] < 0.75


def test_closing_the_stream_disarms_the_rig(tmp_path):
    config = simulated()
    link = transport(config)
    blocks = stream(config, tmp_path, short_protocol(1).plans(), link=link)
    for _ in range(5):
        assert status(next(blocks), "logger").state == "armed"
    blocks.close()
    assert not is_armed(link.board)


def test_the_shipped_model_is_live_as_good_as_its_file_states(tmp_path):
    """In motion, where the file's error was measured; the quick protocol is not the fitted one."""
    config = load_config()
    stated = model_file.read(config.model_path).evidence
    estimators = estimators_of(config.model_path, 1000.0)
    played = stream(config, tmp_path, load_protocol("quick").plans(), estimators=estimators)
    blocks = list(through(played, duration_s=60.0))
    truth = np.concatenate([b.columns["distal_torque_n_m"] for b in blocks])
    error = np.concatenate([b.estimates["distal_torque_n_m"] for b in blocks]) - truth
    motor_rad = np.concatenate([b.columns["motor_angle_rad"] for b in blocks])
    moving = in_motion(np.gradient(motor_rad, 1e-3), np.ones(len(motor_rad), bool), 1000.0, 0.7)
    assert moving.mean() > 0.3
    # live filters lag
    assert np.sqrt(np.mean(error[moving] ** 2)) < 1.5 * stated.rmse_with_means


def test_the_command_shows_an_estimate_in_every_frame(said):
    printed = said("live --json --pace 0 --duration 4").out
    *frames, last = (json.loads(line) for line in printed.splitlines())
    assert {frame["kind"] for frame in frames} == {"frame"}
    assert all(f["channels"]["distal_torque_n_m"]["estimate"] is not None for f in frames[10:])
    assert last["summary"]["lost"] == 0


def test_keys_start_mark_and_stop_a_recording_that_is_whole(tmp_path):
    script = ["", "r", "", "m", "r", ""]
    blocks = list(through(stream(simulated(), tmp_path, keys=script), duration_s=2.0))
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
    list(through(stream(simulated(), tmp_path, keys=["r"]), duration_s=0.5))
    (path,) = tmp_path.glob("*.mcap")
    assert read_log(path).end.clean


def test_a_tare_takes_the_zero_of_a_rig_at_rest_only(tmp_path):
    *_, after = through(stream(simulated(), tmp_path, keys=["", "t", ""]), duration_s=2.0)
    assert status(after, "recording") == DeviceStatus("recording", "off", "tared")
    assert abs(after.columns["distal_torque_n_m"].mean()) < 1e-3
    *_, moving = stream(simulated(), tmp_path, short_protocol(1).plans(), ["", "t"])
    assert "no tare while the rig moves" in status(moving, "recording").detail


def test_a_stop_disarms_a_moving_rig_and_goes_on_watching(tmp_path):
    blocks = stream(simulated(), tmp_path, short_protocol(1).plans(), ["", "s"])
    before, pressed = next(blocks), next(blocks)
    assert status(before, "logger").state == "armed"
    assert status(pressed, "stop") == DeviceStatus("stop", "disarmed", "confirmed by the board")
    after = list(through(blocks, duration_s=1.0))
    assert {status(block, "logger").state for block in after[1:]} == {"disarmed"}
    assert np.ptp(after[-1].columns["spindle_angle_rad"]) < 1e-2


def test_q_quits_and_a_mark_needs_a_recording(tmp_path):
    blocks = list(stream(simulated(), tmp_path, keys=["m", "", "q"]))
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
    said = status(next(stream(config, tmp_path)), "calibration")
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
