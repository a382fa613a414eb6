"""`rig reference` on the firmware core: a restarted board arms only after it and ends a session."""

import dataclasses
import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import CommandRefusedError
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.teensy.driver import SampleBatch, TeensyLogger
from drivers.teensy.protocol import STATUS_REFERENCED, Kind, Result
from drivers.teensy.reference import Limits
from drivers.transport.simulated import SimulatedTransport
from rig.bench.session import Session
from rig.bench.trips import BoardResetError
from rig.simulation.bench import SimulatedBench
from rig.simulation.places import JAW_ANGLE, SPINDLE_ANGLE
from tests.drivers.raw_host import RawHost
from tests.rig.simulated import simulated

OPENS = "rig.bench.logger.open_logger"
STILL = (np.full(50, 0.3), np.zeros(50))


@pytest.fixture
def restarted(library: Path, monkeypatch: pytest.MonkeyPatch) -> FirmwareBoard:
    """A board without zeros; every link that the command opens goes to it."""
    board = FirmwareBoard(SimulatedBench(), BoardStart(boot=9, simulated=False), library)
    monkeypatch.setattr(OPENS, lambda config: SimulatedTransport(board, "sim://"))
    return board


def played(board: FirmwareBoard) -> float:
    """Return the largest deviation of the spindle from 0.3 rad while it is held there."""
    with Session(simulated(), SimulatedTransport(board, "sim://")) as session:
        return max(abs(session.here[0] - 0.3) for _ in session.play(*STILL))


def test_a_restarted_board_moves_only_after_the_command(restarted, answered):
    with pytest.raises(CommandRefusedError, match="Run: rig reference"):
        played(restarted)
    assert answered("reference --sim --yes --at 0.3")["boot"] == 9
    assert played(restarted) < 0.02


@pytest.mark.parametrize("angle", ["nan", "inf", "1e9"])
def test_what_is_not_an_angle_of_a_mark_is_refused(restarted, angle, said):
    err = said("reference --sim --yes --at", angle, code=2).err
    assert "not an angle of a mark" in err
    assert "--at" in err


def test_without_a_confirmation_nothing_is_referenced(restarted, monkeypatch, said):
    monkeypatch.setattr("sys.stdin", StringIO("n\n"))
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    said("reference --sim", code=130)
    with pytest.raises(CommandRefusedError, match="Run: rig reference"):
        played(restarted)


@pytest.mark.parametrize("more", ["", "--hard-stop closed"])
def test_without_a_terminal_the_answer_is_an_option(restarted, more, monkeypatch, said):
    monkeypatch.setattr("sys.stdin", StringIO())
    printed = said("reference --sim --json", more, code=2)
    assert "--yes" in json.loads(printed.out)["error"]["fix"]


def test_the_index_stands_for_the_mark(restarted, said):
    words = "reference --sim --index --at 0.3"
    assert "through its index" in said(words, code=3).err
    restarted.index()
    said(words)
    assert played(restarted) < 0.02


@pytest.mark.parametrize("stop", ["closed", "open"])
def test_a_gentle_drive_finds_the_same_stop_from_two_places(library, monkeypatch, stop, said):
    found_rad = []
    for start_count in (900, 300):
        bench = SimulatedBench(start_count=start_count)
        board = FirmwareBoard(bench, BoardStart(boot=9, simulated=False), library)
        monkeypatch.setattr(OPENS, lambda config, b=board: SimulatedTransport(b, "sim://"))
        said("reference --sim --yes --at 0 --hard-stop", stop)
        found_rad.append(bench.state[SPINDLE_ANGLE])
        assert not board.in_force
    assert abs(found_rad[0] - found_rad[1]) < 0.02
    stands = -0.05 if stop == "open" else 1.45
    assert abs(bench.state[JAW_ANGLE] - stands) < 0.05


def test_a_board_that_sends_nothing_is_not_driven_to_a_stop(restarted, monkeypatch, said):
    nothing = SampleBatch(np.empty(0), np.empty(0, np.int64), 0)
    monkeypatch.setattr(TeensyLogger, "read", lambda self, timeout_s: nothing)
    err = said("reference --sim --yes --hard-stop closed", code=3).err
    assert "The logger sends nothing" in err


def test_a_shaft_that_does_not_turn_is_no_stop(restarted, said):
    words = "reference --sim --yes --hard-stop closed"
    said(words)
    assert "did not turn" in said(words, code=2).err


def test_a_board_without_reference_moves_only_gently(library):
    board = FirmwareBoard(SimulatedBench(), BoardStart(simulated=False), library)
    host = RawHost(board, gains=np.array([20.0, 0.2, 4.0, 0.3, 600.0]))
    host.command(Kind.START)
    host.run(1500)
    gentle = dataclasses.replace(Limits(), hold_command_e4=600)
    assert host.arm(gentle) is Result.NOT_REFERENCED
    assert host.arm(dataclasses.replace(gentle, hold_command_e4=599, seek=1)) is Result.BAD_VALUE
    assert host.arm(dataclasses.replace(gentle, seek=1)) is Result.OK
    host.run(5)
    assert not host.samples()["status"][-1] & STATUS_REFERENCED


def test_a_session_detects_that_its_board_was_reset_and_reports_what_to_do(library):
    bench = SimulatedBench()
    link = SimulatedTransport(FirmwareBoard(bench, BoardStart(boot=4), library), "sim://")
    with Session(simulated(), link) as session:
        assert session.board["board_start"] == "4"
        next(session.rest(0.5))
        link.board = FirmwareBoard(bench, BoardStart(boot=5, simulated=False), library)
        with pytest.raises(BoardResetError, match="rig reference") as caught:
            list(session.rest(5.0))
    assert "is 5 and was 4" in caught.value.why
