"""A board that is started anew while a session uses it: the firmware core on the simulated rig."""

from pathlib import Path

import pytest

from drivers.teensy.core import BoardStart, FirmwareBoard
from drivers.transport.simulated import SimulatedTransport
from rig.bench.session import Session
from rig.bench.trips import BoardResetError
from rig.simulation.bench import SimulatedBench
from tests.rig.simulated import simulated


class BoardThatIsReset:
    """Implements `drivers.transport.simulated.Board`: a board, and another start of it later."""

    def __init__(self, library: Path, reset_at_tick: int) -> None:
        self._bench, self._library = SimulatedBench(), library
        self._board = FirmwareBoard(self._bench, BoardStart(boot=4), library)
        self._left = reset_at_tick

    def receive(self, data: bytes) -> None:
        self._board.receive(data)

    def transmit(self) -> bytes:
        return self._board.transmit()

    def advance(self, ticks: int) -> None:
        if 0 < self._left <= ticks:
            self._board = FirmwareBoard(
                self._bench, BoardStart(boot=5, simulated=False), self._library
            )
        self._left -= ticks
        self._board.advance(ticks)


def test_a_session_detects_that_its_board_was_reset_and_reports_what_to_do(library):
    link = SimulatedTransport(BoardThatIsReset(library, 800), "sim://")
    with Session(simulated(), link) as session:
        assert session.board["board_start"] == "4"
        readings = session.rest(5.0)
        with pytest.raises(BoardResetError, match="rig reference") as caught:
            list(readings)
    assert "is 5 and was 4" in caught.value.why
