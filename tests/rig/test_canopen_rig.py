"""A rig whose motor is an EPOS4, in virtual time and as a process of its own in real time."""

import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from drivers.epos4.driver import Epos4
from drivers.epos4.fake import Epos4Fake
from drivers.epos4.faults import DriveFaultError
from drivers.epos4.protocol import State
from drivers.errors import CommandRefusedError, LinkError
from drivers.teensy.driver import TeensyLogger
from drivers.transport.simulated import SimulatedTransport
from drivers.transport.simulated_can import SimulatedCanBus
from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.canopen.simulated import open_simulated_bus, open_simulated_canopen
from rig.configuration.config import Config, load_config
from rig.log.check import check_log
from rig.log.devices import topic_of
from rig.log.reader import read_log
from rig.logic.link import LogicLink
from rig.machines.choose import machine_of
from rig.machines.reading import Reading
from rig.protocols.protocol import Protocol
from rig.recording.campaign import open_campaign_folder, record_campaign
from tests.rig.playing import playing

pytestmark = pytest.mark.integration

STILL = (np.full(3000, -1.04), np.zeros(3000))


def config(**changes: object) -> Config:
    return load_config(Path("canopen_simulated")).changed(**changes)


def drive_of(link: LogicLink) -> Epos4Fake:
    """The fake at the far end of a simulated rig."""
    (drive,) = link._device._bus._nodes
    return drive


@pytest.fixture
def alone() -> tuple[Config, LogicLink]:
    """A rig without further devices, and the link to it."""
    settings = config(devices={})
    return settings, open_simulated_canopen(settings)


def test_a_drive_that_was_left_in_force_is_disarmed_by_opening_it():
    drive = Epos4Fake()
    drive.state = State.OPERATION_ENABLED
    bus = SimulatedCanBus([drive])
    LogicLink(Epos4(bus), bus.url).close()
    assert drive.state is State.SWITCH_ON_DISABLED


def test_a_fault_of_the_drive_ends_the_session_in_its_own_words(alone):
    settings, link = alone
    with pytest.raises(DriveFaultError, match=r"2310"), Session(settings, link) as rig:  # noqa: PT012
        for k, _ in enumerate(rig.play(*STILL)):
            if k == 5:
                drive_of(link).fail(0x2310, 2)
    assert drive_of(link).torque_n_m == 0


def test_a_campaign_is_recorded_with_the_further_devices_on_the_loggers_time(tmp_path):
    fakes = {"jaw_force": "ati-can", "torque_cell": "qia128"}
    devices = {name: {"driver": driver, "url": "sim://"} for name, driver in fakes.items()}
    settings = config(devices=devices)
    table = {"kind": "sine", "frequencies_hz": [1.0], "loads_a": [0.0], "duration_s": 1.0}
    protocol = Protocol.model_validate({"name": "short", "runs": [table]})
    todo = open_campaign_folder(tmp_path / "runs", protocol, settings, resume=False)
    with Session(settings, open_simulated_canopen(settings)) as session:
        (result,) = record_campaign(session, todo, tmp_path / "runs")
    assert result.complete
    assert check_log(result.path).verdict.exit_code == 0
    log = read_log(result.path)
    assert "clock_residual_s_logger" in log.run.details
    for name, rate_hz in (("jaw_force", 200), ("torque_cell", 1300)):
        rows = log.topics[topic_of(name)].rows
        assert abs(len(rows) - rate_hz) <= 0.02 * rate_hz + 60
        np.testing.assert_allclose(np.diff(rows["time_s"]), 1 / rate_hz, rtol=1e-3)
        assert 0 <= rows["time_s"][0] < 0.02
        assert (rows["flags"] == 0).all()


def test_rig_clear_clears_the_fault_of_the_configured_drive(monkeypatch, said):
    drive = Epos4Fake()
    drive.fail(0x8130, 0x10)
    monkeypatch.setattr("rig.bench.clearing.open_can", lambda url: SimulatedCanBus([drive], url))
    told = said("clear -c canopen --json")
    assert '"code": 33072' in told.out
    assert "heartbeat of the host" in told.err
    assert drive.state is State.SWITCH_ON_DISABLED
    assert "nothing is latched" in said("clear -c canopen").out


def test_rig_clear_clears_the_trip_of_a_board_by_its_code(monkeypatch, said):
    settings = load_config(Path("simulated"))
    link = open_logger(settings)
    machine = machine_of(settings)
    logger = TeensyLogger(link, machine.profile)
    limits = machine.untroubled(machine.board_limits(settings, settings.calibration_set()))
    logger.arm(machine.gains(settings), limits)
    for _ in range(100):
        logger.read(0.05)  # nobody beats: the watchdog trips
    monkeypatch.setattr("rig.bench.clearing.open_logger", lambda _: link)
    told = said("clear -c simulated").out
    assert "received nothing from this computer" in told
    assert "cleared" in told
    assert TeensyLogger(SimulatedTransport(link.board)).trip().code == 0


def test_a_real_drives_motor_counts_as_warm_at_the_start_of_every_session():
    settings = config(devices={})
    machine = machine_of(settings)
    limits = machine.board_limits(settings, settings.calibration_set())
    bus = open_simulated_bus(settings)
    with TeensyLogger(LogicLink(Epos4(bus), bus.url, is_cold=False), machine.profile) as logger:
        with pytest.raises(CommandRefusedError, match="half of the heat"):
            logger.arm(machine.gains(settings), limits)
        for _ in range(200):
            logger.read(0.02)
        logger.arm(machine.gains(settings), limits)


def test_a_session_runs_on_it_and_nothing_is_lost_while_the_host_pauses():
    for _ in range(3):  # a busy machine may itself stop the process for longer than a tick waits
        readings = readings_of_a_host_that_pauses()
        setpoint = np.concatenate([r.setpoint for r in readings])
        assert np.array_equal(setpoint[setpoint >= 0], np.arange(800))
        tick_us = np.concatenate([r.tick_us for r in readings])
        assert (np.diff(tick_us) > 0).all()
        moved = np.concatenate([r.columns["spindle_angle_rad"] for r in readings])
        assert moved[-1] - moved[0] > 0.05
        if readings[-1].lost == 0:
            return
    pytest.fail(f"{readings[-1].lost} samples were lost in the last of three sessions")


def readings_of_a_host_that_pauses() -> list[Reading]:
    settings = load_config(Path("canopen_virtual"))
    settings = settings.changed(devices={}, safety={"watchdog_s": 1.0})
    readings = []
    with Session(settings, open_logger(settings)) as session:
        next(session.rest(0.1))
        start = session.here[0]
        for k, reading in enumerate(session.play(start + np.linspace(0, 0.1, 800), np.zeros(800))):
            readings.append(reading)
            if k == 3:
                time.sleep(0.2)  # what is behind is read later; the ticks went on meanwhile
    return readings


def test_a_drive_that_cannot_be_reached_is_reported_with_what_to_type():
    settings = load_config(Path("canopen")).changed(
        logger={"url": "can:slcan:/dev/nonesuch?bitrate=1000000"}
    )
    with pytest.raises(LinkError, match="nonesuch"):
        open_logger(settings)


def standing() -> list[str]:
    return playing("canopen_virtual", load_a=0.0, devices={}, safety={"watchdog_s": 1.0})


def test_a_host_that_is_killed_leaves_no_process_behind():
    with subprocess.Popen(
        standing(), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as host:
        worker = int(host.stdout.readline())
        host.kill()
        host.stdout.read()
    give_up_s = time.monotonic() + 60
    with suppress(OSError):  # it is gone
        while Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            assert time.monotonic() < give_up_s, "the process is still there"
            time.sleep(0.01)


def test_ctrl_c_of_the_whole_group_lets_the_host_disarm_first():
    with subprocess.Popen(
        standing(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as host:
        host.stdout.readline()
        os.killpg(host.pid, signal.SIGINT)
        os.killpg(host.pid, signal.SIGINT)
        told = host.stderr.read()
    assert told.splitlines()[-1] == "KeyboardInterrupt"
    assert "not confirm" not in told
