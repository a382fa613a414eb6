"""`rig live` on the simulated rig: what it shows, and that it leaves the rig safe."""

import json

import numpy as np
import pytest

from estimation import model_file
from estimation.rest import in_motion
from rig.configuration.config import load_config
from rig.live.block import through
from rig.live.estimator import ModelEstimator
from rig.live.session_blocks import session_blocks
from rig.protocols.protocol import load_protocol
from tests.rig.simulated import is_armed, short_protocol, simulated, transport

pytestmark = pytest.mark.integration


def test_a_plan_is_played_and_every_sample_shown_once():
    config = simulated()
    plans = short_protocol(1).plans()
    blocks = list(session_blocks(config, lambda: transport(config), plans, ()))
    time_s = np.concatenate([block.time_s for block in blocks])
    np.testing.assert_allclose(np.diff(time_s), 1e-3)
    assert blocks[0].devices[0].state == "armed"
    assert {limit.name for limit in blocks[0].limits} <= set(config.limits.model_dump())
    assert max(block.columns["distal_torque_n_m"].max() for block in blocks) > 5e-3


def test_without_a_plan_the_rig_is_watched_for_the_asked_device_time_and_never_armed():
    config = simulated()
    stream = session_blocks(config, lambda: transport(config), [], ())
    blocks = list(through(stream, duration_s=0.5))
    assert {block.devices[0].state for block in blocks} == {"disarmed"}
    assert 0.5 <= blocks[-1].time_s[-1] - blocks[0].time_s[0] < 0.75


def test_closing_the_stream_disarms_the_rig():
    config = simulated()
    link = transport(config)
    stream = session_blocks(config, lambda: link, short_protocol(1).plans(), ())
    for _ in range(5):
        assert next(stream).devices[0].state == "armed"
    stream.close()
    assert not is_armed(link.board)


def test_the_shipped_model_is_live_as_good_as_its_file_states():
    """In motion, where the file's error was measured; the quick protocol is not the fitted one."""
    config = load_config()
    stated = model_file.read(config.model_path).evidence
    estimator = ModelEstimator(config.model_path, 1000.0)
    plans = load_protocol("quick").plans()
    stream = session_blocks(config, lambda: transport(config), plans, [estimator])
    blocks = list(through(stream, duration_s=60.0))
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
