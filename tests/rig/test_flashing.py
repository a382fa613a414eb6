"""`rig firmware flash`: the one board that is plugged in, by its serial number, and not armed."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from drivers.errors import PortBusyError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.reference import REFERENCE
from drivers.transport import open_transport
from rig.bench import firmware
from rig.bench.flashing import board_to_flash
from rig.configuration.config import load_config
from rig.errors import SafetyTripError, UsageError
from rig.machines.choose import machine_of

pytestmark = pytest.mark.integration

TEENSY = {"vid": 0x16C0, "pid": 0x0483}


def plug_in(monkeypatch: pytest.MonkeyPatch, **boards: str) -> None:
    """Let the computer have Teensys, port by serial number, and a port of another maker."""
    ports = [SimpleNamespace(serial_number=s, device=p, **TEENSY) for s, p in boards.items()]
    other = SimpleNamespace(serial_number="x", device="/dev/ttyUSB0", vid=0x0403, pid=0x6001)
    monkeypatch.setattr(list_ports, "comports", lambda: [other, *ports])


@pytest.fixture
def run(monkeypatch):
    """The commands of PlatformIO that would have been run."""
    commands: list[list[str]] = []
    monkeypatch.setattr(firmware, "_require_platformio", lambda _: None)
    monkeypatch.setattr(firmware, "_run", commands.append)
    return commands


def test_the_one_board_is_named_with_its_state(port, monkeypatch):
    plug_in(monkeypatch, A1=port)
    found = board_to_flash("", REFERENCE)
    assert (found.serial, found.port, found.state) == ("A1", port, "it is disarmed")
    assert board_to_flash("A1", REFERENCE) == found
    with pytest.raises(UsageError, match="A1, not B2"):
        board_to_flash("B2", REFERENCE)


def test_several_boards_and_none_are_refused(monkeypatch):
    plug_in(monkeypatch, A1="/dev/ttyACM0", B2="/dev/ttyACM1")
    with pytest.raises(UsageError, match=r"A1 at /dev/ttyACM0, B2 at /dev/ttyACM1"):
        board_to_flash("B2", REFERENCE)
    plug_in(monkeypatch)
    with pytest.raises(UsageError, match="No Teensy"):
        board_to_flash("", REFERENCE)


def test_a_board_that_another_program_has_is_refused(port, monkeypatch):
    plug_in(monkeypatch, A1=port)
    link = open_transport(port)
    with pytest.raises(PortBusyError, match="may be armed"):
        board_to_flash("", REFERENCE)
    link.close()


def test_an_armed_board_is_refused_and_nothing_is_written(port, monkeypatch, run):
    plug_in(monkeypatch, A1=port)
    settings = load_config(Path("pty")).changed(
        safety={"watchdog_s": 1.0, "safe_state": "hold"}  # a slow computer finds it holding
    )
    machine = machine_of(settings)
    limits = machine.untroubled(machine.board_limits(settings, settings.calibration_set()))
    logger = TeensyLogger(open_transport(port), machine.profile)
    logger.arm(machine.gains(settings), limits)
    logger._link.transport.close()
    with pytest.raises(SafetyTripError, match="armed"):
        firmware.flash("teensy41")
    assert run == []


def test_a_disarmed_board_is_flashed(port, monkeypatch, run):
    plug_in(monkeypatch, A1=port)
    assert firmware.flash("teensy41", "A1").serial == "A1"
    (command,) = run
    assert command[-2:] == ["--target", "upload"]
