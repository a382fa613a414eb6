"""A further device beside the logger: its silence, its limits, its times in a log."""

import json

import pytest

from drivers.errors import LinkTimeoutError
from drivers.ft300.fake import Ft300Fake
from rig.configuration.config import SIMULATED
from rig.log.check import Verdict, check_log
from rig.recording.campaign import open_campaign_folder, record_campaign
from tests.rig.simulated import session, short_protocol, simulated

pytestmark = pytest.mark.integration

FT = '\n[devices.ft]\ndriver = "ft300"\nurl = "sim://"\n'


def with_ft(**changes):
    """The simulated rig with a force and torque sensor beside it."""
    return simulated().changed(devices={"ft": {"driver": "ft300", "url": "sim://"}}, **changes)


def silenced(monkeypatch, sends=b""):
    """Let the sensor send nothing, or something else, from 5 s on."""
    advance = Ft300Fake.advance

    def quiet(fake, ticks):
        is_quiet = fake._ticks > 5000
        fake.streaming = fake.streaming and not is_quiet
        advance(fake, ticks)
        fake._out += sends if is_quiet else b""

    monkeypatch.setattr(Ft300Fake, "advance", quiet)


def test_the_display_lists_it(tmp_path, said):
    path = tmp_path / "rig.toml"
    path.write_text(SIMULATED.read_text() + FT)
    printed = said("live --duration 0.3 --pace 0 --json -c", path).out
    devices = json.loads(printed.splitlines()[0])["devices"]
    assert {"name": "ft", "state": "ok", "detail": "ft300"} in devices


@pytest.mark.parametrize("sends", [b"", b"\x55\xaa"])
def test_one_that_falls_silent_ends_the_recording_and_the_log_is_kept(tmp_path, monkeypatch, sends):
    silenced(monkeypatch, sends)
    config, runs = with_ft(), short_protocol(1, duration_s=5.0)
    plans = open_campaign_folder(tmp_path, runs, config, resume=False)
    quiet = pytest.raises(LinkTimeoutError, match="'ft' has sent no sample for 1 s")
    with quiet, session(config) as rig:
        list(record_campaign(rig, plans, tmp_path))
    (log,) = tmp_path.glob("*.mcap*")
    assert check_log(log).verdict is Verdict.INCOMPLETE


def test_one_that_goes_on_sending_is_read_on():
    with session(with_ft()) as rig:
        for _ in rig.rest(5.0):
            pass
        assert len(rig.companions[0].take().sequence) == pytest.approx(500, abs=10)
