"""`rig live` on the simulated rig: what it shows, and that it leaves the rig safe."""

import json

import numpy as np
import pytest

from estimation import model_file
from rig.cli.main import main
from rig.config import load_config
from rig.live.session_blocks import session_blocks
from rig.live.until import until
from tests.rig.simulated import is_armed, short_protocol, simulated, transport


def test_a_plan_is_played_and_every_sample_shown_once():
    config = simulated()
    plans = short_protocol(1).plans()
    blocks = list(session_blocks(config, lambda: transport(config), plans, None))
    time_s = np.concatenate([block.time_s for block in blocks])
    np.testing.assert_allclose(np.diff(time_s), 1e-3)
    assert blocks[0].devices[0].state == "armed"
    assert {limit.name for limit in blocks[0].limits} <= set(config.limits.model_dump())
    assert max(block.columns["distal_torque_n_m"].max() for block in blocks) > 5e-3


def test_without_a_plan_the_rig_is_watched_and_never_armed():
    config = simulated()
    blocks = list(until(session_blocks(config, lambda: transport(config), [], None), 1.0))
    assert {block.devices[0].state for block in blocks} == {"disarmed"}


def test_closing_the_stream_disarms_the_rig():
    config = simulated()
    link = transport(config)
    stream = session_blocks(config, lambda: link, short_protocol(1).plans(), None)
    for _ in range(5):
        assert next(stream).devices[0].state == "armed"
    stream.close()
    assert not is_armed(link.board)


@pytest.mark.parametrize("duration_s", [0.5, 1.0])
def test_it_ends_after_the_asked_device_time(duration_s):
    config = simulated()
    blocks = list(until(session_blocks(config, lambda: transport(config), [], None), duration_s))
    shown_s = blocks[-1].time_s[-1] - blocks[0].time_s[0]
    assert duration_s <= shown_s < duration_s + 0.25


def test_the_shipped_model_is_live_as_good_as_its_file_states(capsys):
    stated = model_file.read(load_config().model_path).evidence
    assert main(["live", "--json", "--pace", "0", "--duration", "60"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    frames = [line for line in lines if line["kind"] == "frame"]
    assert all(f["channels"]["distal_torque_n_m"]["estimate"] is not None for f in frames[10:])
    summary = lines[-1]["summary"]
    assert summary["lost"] == 0
    # the quick protocol is not the one it was fitted on, and live filters lag
    assert summary["error_rms"] < 1.5 * stated.rmse_with_means
