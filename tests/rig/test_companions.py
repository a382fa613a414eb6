"""A further device beside the logger: its silence, its limits, its times in a log."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.errors import LinkTimeoutError
from drivers.ft300.fake import Ft300Fake
from rig.bench.companions import refuse_shared_names
from rig.bench.session import Session
from rig.configuration.config import SHIPPED, SIMULATED
from rig.errors import SafetyTripError, UsageError
from rig.importers.registry import open_campaign
from rig.log.check import Verdict, check_log
from rig.log.devices import topic_of
from rig.log.reader import read_log
from rig.log.run import RunInfo
from rig.recording.campaign import open_campaign_folder, record_campaign
from rig.recording.recorder import LiveRecorder
from rig.recording.session_log import SessionLog
from tests.rig.simulated import is_armed, session, short_protocol, simulated, transport

pytestmark = pytest.mark.integration

FT = '\n[devices.ft]\ndriver = "ft300"\nurl = "sim://"\n'


def with_ft(**changes):
    """The simulated rig with a force and torque sensor beside it."""
    return simulated().changed(devices={"ft": {"driver": "ft300", "url": "sim://"}}, **changes)


def narrow(rig, limits):
    rig.companions[0]._limits = limits.further


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
    frame = json.loads(printed.splitlines()[0])
    assert {"name": "ft", "state": "ok", "detail": "ft300"} in frame["devices"]
    assert np.isfinite(frame["channels"]["ft_force_z_n"]["sensor"])


def test_its_channels_are_those_of_a_recording(tmp_path):
    with session(with_ft()) as rig:
        recorder = LiveRecorder(rig, tmp_path)
        recorder.start()
        for reading in rig.rest(2.0):
            recorder.write(reading, rig.take_beside())
        recorder.stop()
    (run,) = open_campaign(tmp_path).runs
    recording = run.recording()
    assert recording.valid[20:-20].all()
    force_n = recording["ft_force_z_n"][20:-20]
    time_s = recording.time_s[20:-20]
    turn = np.stack([np.sin(2 * np.pi * time_s), np.cos(2 * np.pi * time_s)], axis=1)
    found, *_ = np.linalg.lstsq(turn, force_n)
    assert np.hypot(*found) == pytest.approx(90.0, rel=0.02)  # a sine of 1 Hz
    assert np.abs(force_n - turn @ found).max() < 1.0


def test_a_device_whose_channel_is_another_ones_is_refused():
    with session(with_ft()) as rig:
        refuse_shared_names(rig.companions, rig.calibrations.channels)
        with pytest.raises(UsageError, match=r"\[logger\] both have the channel 'ft_force_z_n'"):
            refuse_shared_names(rig.companions, ["ft_force_z_n"])


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


def test_a_crossed_limit_of_one_trips_the_rig_and_its_samples_are_in_the_log(tmp_path):
    config, runs = with_ft(limits={"ft.force_z_n": 1000.0}), short_protocol(1)
    plans = open_campaign_folder(tmp_path, runs, config, resume=False)
    link = transport(config)
    limits = config.changed(limits={"ft.force_z_n": 1.0}).limits
    with Session(config, link) as rig:
        campaign = record_campaign(rig, plans, tmp_path, on_progress=lambda *_: narrow(rig, limits))
        with pytest.raises(SafetyTripError, match=r"ft\.force_z_n reached"):
            list(campaign)
        assert not is_armed(link.board)
    (log,) = tmp_path.glob("*.mcap*")
    rows = read_log(log, tolerant=True).topics[topic_of("ft")].rows
    assert abs(rows["force_z_n"][-1]) > 1.0


@pytest.mark.parametrize(
    ("rig", "limit", "message"),
    [
        ("moteus_simulated", "temperatur_k = 303.0", "'temperature_k'"),
        ("moteus_simulated", '"ft.force_zz_n" = 1.0', "'ft.force_z_n'"),
        ("moteus_simulated", "ft.force_zz_n = 1.0", "'ft.force_z_n'"),
        ("simulated", '"gt.force_z_n" = 1.0', "gt.force_z_n"),
    ],
)
def test_a_limit_on_a_channel_that_no_device_has_is_refused(tmp_path, said, rig, limit, message):
    path = tmp_path / "rig.toml"
    text = (SHIPPED / f"{rig}.toml").read_text() + FT
    path.write_text(text.replace("[limits]", f"[limits]\n{limit}"))
    assert message in said("config check", path, code=2).out
    printed = said("record -p unloaded -c", path, "-o", tmp_path / "runs", code=2).err
    assert message in printed
    assert "nothing was armed" in printed


def test_a_limit_that_no_device_can_have_is_no_key(tmp_path, said):
    path = tmp_path / "rig.toml"
    path.write_text(SIMULATED.read_text().replace("[limits]", "[limits]\nmotor_current = 1.0"))
    assert "did you mean 'motor_current_a'?" in said("config check", path, code=2).err
    path.write_text(SIMULATED.read_text().replace("[limits]", "[limits]\nft.force_z_n = 1e3") + FT)
    assert "is sound" in said("config check", path).out


def test_its_times_increase_while_the_clocks_are_fitted_again(tmp_path, monkeypatch):
    path = tmp_path / "run.mcap"
    with session(with_ft()) as rig:
        (ft,) = rig.companions
        next(rig.rest(0.5))
        line = rig.clock.line
        with SessionLog(rig, path, RunInfo(name="run")) as log:
            for number, reading in enumerate(rig.rest(2.0)):
                moved = replace(line, host_s=line.host_s + 0.03 * (number % 2))
                monkeypatch.setattr(rig, "clock", SimpleNamespace(line=moved))
                log.write_reading(reading)
                log.write_beside(rig.take_beside())
    rows = read_log(path, tolerant=True).topics[topic_of("ft")].rows
    time_s, sequence = rows["time_s"], rows["sequence"]
    assert np.diff(time_s).min() > 0.004
    off_s = (time_s - time_s[0]) - (sequence - sequence[0]) / ft.rate_hz
    assert np.abs(off_s).max() < 0.05


def test_one_that_goes_on_sending_is_read_on():
    with session(with_ft()) as rig:
        for _ in rig.rest(5.0):
            pass
        assert len(rig.companions[0].take().sequence) == pytest.approx(500, abs=10)
