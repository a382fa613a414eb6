"""`rig reference` on the firmware core: a restarted board arms only after it."""

from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from drivers.errors import CommandRefusedError
from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.transport.simulated import SimulatedTransport
from rig.bench import referencing
from rig.bench.session import Session
from rig.cli.main import main
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import simulated

STILL = (np.full(50, 0.3), np.zeros(50))


@pytest.fixture
def restarted(library: Path, monkeypatch: pytest.MonkeyPatch) -> FirmwareBoard:
    """A board without zeros; every link that the command opens goes to it."""
    board = FirmwareBoard(SimulatedBench(), BoardStart(boot=9, simulated=False), library)
    monkeypatch.setattr(
        referencing, "open_logger", lambda config: SimulatedTransport(board, "sim://")
    )
    return board


def played(board: FirmwareBoard) -> float:
    """Return the largest deviation of the spindle from 0.3 rad while it is held there."""
    with Session(simulated(), SimulatedTransport(board, "sim://")) as session:
        return max(abs(session.spindle_angle_rad - 0.3) for _ in session.play(*STILL))


def test_a_restarted_board_moves_only_after_the_command(
    restarted: FirmwareBoard, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(CommandRefusedError, match="Run: rig reference"):
        played(restarted)
    assert main(["reference", "--sim", "--yes", "--at", "0.3", "--json"]) == 0
    assert '"boot": 9' in capsys.readouterr().out
    assert played(restarted) < 0.02


def test_without_a_confirmation_nothing_is_referenced(
    restarted: FirmwareBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", StringIO("n\n"))
    assert main(["reference", "--sim"]) == 130
    with pytest.raises(CommandRefusedError, match="Run: rig reference"):
        played(restarted)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-c", "canopen"], "no board to reference"),
        (["--sim", "--at", "0", "--at", "1"], "spindle_angle_rad"),
        (["-c", "grasper", "--at", "0"], "yaw_angle_rad, jaw_1_angle_rad, jaw_2_angle_rad"),
    ],
)
def test_a_place_that_does_not_fit_the_rig_is_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reference", "--yes", *words]) == 2
    assert message in capsys.readouterr().err
