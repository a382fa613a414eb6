"""A recording replayed: through the stream, and through the command."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.estimators.model import ModelEstimator
from estimation.fitting import fit
from estimation.model_file import write_all
from estimation.recording import Flag, Recording, Stretch
from rig.errors import DataError, ExitCode, UsageError
from rig.live.estimator import LiveEstimator
from rig.live.options import ShowOptions
from rig.live.replay import lost_samples, replay_blocks
from rig.live.state import LiveState
from rig.live.text import plain_line
from rig.log.convert import write_recording
from tests.estimation.causes.synthetic import gearbox, geared, motor

GRIP = "distal_torque_n_m"
ESTIMATED = "estimated_distal_torque_n_m"


def recording(name="07", seconds=2.0, **changes):
    time_s = np.arange(int(seconds * 1000)) / 1000
    current_a = 0.3 + 0.1 * np.sin(3 * time_s)
    parts = {
        "name": name,
        "time_s": time_s,
        "columns": {"motor_current_a": current_a, GRIP: 0.4 * current_a},
    }
    return Recording(**parts | changes)


@pytest.fixture
def virtual(monkeypatch):
    """A clock that only sleeping advances."""

    class Time:
        now_s = 100.0

        def monotonic(self):
            return self.now_s

        def sleep(self, seconds):
            assert seconds > 0
            self.now_s += seconds

    time = Time()
    monkeypatch.setattr("rig.live.replay.time", time)
    return time


def test_a_target_that_is_a_difference_of_angles_is_read_from_both():
    runs = geared()
    fitted = fit(gearbox(), Campaign.of(runs), bootstrap=0)
    estimator = LiveEstimator(ModelEstimator(fitted), runs[0].sample_rate_hz)
    blocks = list(replay_blocks(runs[0], (estimator,), None))
    read = np.concatenate([block.columns[fitted.target] for block in blocks])
    angles = runs[0]["motor_angle_rad"] / 35.0 - runs[0]["spindle_angle_rad"]
    np.testing.assert_allclose(np.abs(read), np.abs(angles), atol=1e-12)


def test_keys_pause_hasten_skip_and_leave_a_replay(virtual):
    def keyed(*pressed):
        began_s, script = virtual.now_s, iter(pressed)
        blocks = list(replay_blocks(recording(seconds=20), (), 1.0, lambda: next(script, "")))
        return blocks, virtual.now_s - began_s

    _, plain_s = keyed()
    _, paused_s = keyed("", " ", "", "", "", " ")
    _, hastened_s = keyed("+")
    seen, skipped_s = keyed("", "f")
    left, _ = keyed("", "", "q")
    assert plain_s == pytest.approx(20, abs=0.1)
    assert paused_s == pytest.approx(20 + 4 * 0.1, abs=0.1)
    assert hastened_s == pytest.approx(10, abs=0.1)
    assert skipped_s == pytest.approx(15, abs=0.1)
    assert len(seen) == 400  # every block is shown, and every estimator sees it
    assert len(left) <= 2


def test_blocks_together_are_the_recording():
    source = recording(seconds=1.234)
    blocks = list(replay_blocks(source, (), speed=None))
    assert len(blocks) == 25
    assert max(len(b) for b in blocks) <= 51
    np.testing.assert_array_equal(np.concatenate([b.time_s for b in blocks]), source.time_s)
    for name in source.columns:
        joined = np.concatenate([b.columns[name] for b in blocks])
        np.testing.assert_array_equal(joined, source[name])


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_pace_is_that_of_the_recording_times_speed(speed, virtual):
    for block in replay_blocks(recording(), (), speed):
        due = 100.0 + block.time_s[-1] / speed
        assert virtual.now_s == pytest.approx(due), "a block comes when its last sample was taken"
    assert virtual.now_s - 100.0 == pytest.approx(1.999 / speed)


def test_recorded_estimates_are_shown_unless_an_estimator_replaces_them():
    source = recording().with_columns(**{ESTIMATED: np.full(2000, 0.5)})
    first = next(replay_blocks(source, (), None))
    assert set(first.estimates[GRIP]) == {0.5}
    zero = SimpleNamespace(target_channel=GRIP, push=lambda _, time_s: np.zeros(time_s.size))
    estimated = next(replay_blocks(source, [zero], None))
    assert set(estimated.estimates[GRIP]) == {0.0}


def test_gaps_and_missing_samples_count_as_lost():
    flags = np.zeros(2000, np.uint8)
    flags[10:15] = Flag.MISSING
    source = recording(flags=flags)
    keep = np.r_[0:500, 700:2000]
    holed = Recording(
        "h", source.time_s[keep], {GRIP: source[GRIP][keep]}, flags=source.flags[keep]
    )
    assert lost_samples(holed)[[9, 14, 499, 500, -1]].tolist() == [0, 5, 5, 205, 205]
    assert list(replay_blocks(holed, (), None))[-1].lost == 205


def test_a_flagged_segment_has_its_reason():
    source = recording().with_stretch(Stretch(1.0, 1.1, Flag.SUSPECT, "runaway: command 1.06"))
    states = [b.devices[0] for b in replay_blocks(source, (), None)]
    assert states[0].state == "ok"
    assert (states[20].state, states[20].detail) == ("suspect", "runaway: command 1.06")
    assert states[-1].state == "ok"


def test_nothing_to_show_is_an_error():
    empty = Recording("none", np.empty(0), {GRIP: np.empty(0)})
    with pytest.raises(DataError, match="no samples"):
        replay_blocks(empty, (), None)
    with pytest.raises(UsageError, match="speed"):
        replay_blocks(recording(), (), -1.0)


@pytest.fixture
def logs(monkeypatch, tmp_path):
    """Make every path open as the campaign given."""

    def use(*recordings):
        campaign = Campaign.of(recordings)
        monkeypatch.setattr("rig.machines.recordings.open_campaign", lambda *_: campaign)
        return tmp_path

    return use


@pytest.fixture
def frames(said):
    """Replay as JSON lines; return the frames and the summary."""

    def run(path, words=""):
        printed = said("replay --json --speed 0", path, words)
        assert printed.err == ""
        *found, last = map(json.loads, printed.out.splitlines())
        return found, last["summary"]

    return run


def test_a_recording_of_another_machine_is_shown_by_a_channel_that_it_has(logs, frames):
    current_a = recording()["motor_current_a"]
    columns = {"motor_angle_rad": current_a, "motor_current_a": current_a}
    found, _ = frames(logs(recording(columns=columns)))
    (shown,) = found[-1]["channels"].items()
    assert shown[0] == "motor_current_a"
    assert shown[1]["sensor"] is not None


def test_command_writes_json_lines(logs, frames):
    found, summary = frames(logs(recording()), "--lever-mm 10")
    assert len(found) == 20
    grip = found[5]["channels"][GRIP]
    assert grip["tip_force_n"] == pytest.approx(grip["sensor"] / 0.010)
    assert grip["tip_force_from"] == "sensor"
    assert summary["samples"] == 2000


def test_command_writes_plain_lines_and_reports_which_run(logs, said):
    path = logs(recording("00").exclude("runaway"), recording("01"), recording("02"))
    out, err = said("replay --plain --speed 0", path)
    assert err == "Run 01, 2 of 3; --run NAME shows another.\n"
    assert "Finished after 2.0 s: 2000 samples, lost 0." in out


@pytest.mark.parametrize(
    ("channel", "size", "shown"),
    [
        ("link_torque_n_m", 30.0, "sensor 30.000 N m"),
        ("link_torque_n_m", 0.03, "sensor 30.0 mN m"),
        ("link_deflection_rad", 0.001, "sensor 1.000 mrad"),
        ("link_deflection_rad", 0.1, "sensor 5.73 deg"),
    ],
)
def test_torques_and_angles_are_shown_in_a_unit_of_their_size(channel, size, shown):
    time_s = np.arange(0, 2, 1e-3)
    run = Recording("a", time_s, {channel: np.full(time_s.size, size)})
    state = LiveState((channel,))
    for block in replay_blocks(run, (), None):
        state.feed(block)
    assert shown in plain_line(state.snapshot(), ShowOptions(title="", channels=(channel,)))


def test_of_two_equations_of_a_target_the_first_is_named_and_another_can_be_chosen(
    logs, said, tmp_path
):
    runs = geared()[:6]
    one = fit(motor(), Campaign.of(runs), bootstrap=0)
    file = tmp_path / "two.toml"
    write_all([one, replace(one, name="other", balance="other")], file)
    words = ("replay --plain --speed 0", logs(*runs), "--model", file)
    first = "Estimate of proximal_torque_n_m by the equation motor; two.toml has other of it, too: "
    assert f"{first}--equation NAME chooses." in said(*words).err
    assert "by the equation" not in said(*words, "--equation other").err
    assert "Declared: motor, other." in said(*words, "--equation none", code=2).err


@pytest.mark.parametrize("words", ["--run 99", "--speed -1", "--speed nan", "--lever-mm 0"])
def test_command_refuses_what_cannot_be(logs, words, said):
    said("replay", logs(recording()), words, code=2)


def test_a_reader_that_closes_early_causes_no_message(tmp_path):
    """As in `rig replay LOG --json | head -1`."""
    log = str(write_recording(tmp_path / "log.mcap", recording(seconds=20.0)))
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, "-m", "rig", "replay", log, "--speed", "0", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(root)},
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == ExitCode.UNREAD
