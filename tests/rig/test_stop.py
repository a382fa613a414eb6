"""`rig stop` and `rig firmware flash`: who has the board lets go of it, and it is not armed."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from serial.tools import list_ports

from drivers.errors import PortBusyError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_ARMED
from drivers.teensy.reference import REFERENCE
from drivers.transport import open_transport
from rig.bench import firmware
from rig.bench.flashing import board_to_flash
from rig.bench.holding import holder, holding
from rig.configuration.config import load_config
from rig.errors import ExitCode, SafetyTripError, UsageError
from rig.machines.choose import machine_of
from tests.rig.playing import playing

pytestmark = pytest.mark.integration

FOREIGN = """
import sys
from pathlib import Path
from drivers.transport import open_transport
from rig.configuration.config import load_config

link = open_transport(load_config(Path(sys.argv[1])).logger.url)
print("open", flush=True)
sys.stdin.read()
"""


def started(*words: str) -> subprocess.Popen[str]:
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    process = subprocess.Popen(words, text=True, **pipes)
    assert process.stdout.readline()
    return process


def is_armed(config: Path) -> bool:
    with TeensyLogger(open_transport(load_config(config).logger.url)) as logger:
        logger.identify()
        logger.start()
        return bool(int(logger.read(1.0).samples["status"][-1]) & STATUS_ARMED)


@pytest.mark.parametrize("hangs", [False, True])
def test_a_session_that_has_the_rig_is_asked_to_end_and_killed_if_it_hangs(
    board, answered, monkeypatch, hangs
):
    with started(*playing(board, safety={"watchdog_s": 1.0})) as session:
        if hangs:
            monkeypatch.setattr("rig.bench.holding.ENDS_S", 0.2)
            os.kill(session.pid, signal.SIGSTOP)
        (told,) = answered("stop -c", board)["rigs"]
        session.communicate()
    assert told["state"] == "disarmed"
    assert told["holder"] == {"pid": session.pid, "was_killed": hangs}
    assert (session.returncode == -signal.SIGKILL) == hangs
    assert not is_armed(board)


def test_a_program_of_another_maker_is_named_and_left_alone(board, said, answered):
    with started(sys.executable, "-c", FOREIGN, str(board)) as other:
        told = said("stop -c", board, code=ExitCode.SAFETY).err
        assert other.poll() is None
        other.communicate("")
    assert f"PID {other.pid}" in told
    assert "Cut the motor supply by hand." in told
    (result,) = answered("stop -c", board)["rigs"]
    assert (result["state"], result["holder"]) == ("disarmed", None)


def test_a_rig_is_held_once_under_any_of_its_names(tmp_path):
    port = tmp_path / "ttyACM0"
    port.touch()
    link = tmp_path / "by-id"
    link.symlink_to(port)
    with holding(str(port)):
        assert holder(str(link)) == os.getpid()
        with holding(str(link)):
            assert holder(str(port)) == os.getpid()
        assert holder(str(port)) == os.getpid()
    assert holder(str(port)) is None
    with holding("sim://"):
        assert holder("sim://") is None


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
