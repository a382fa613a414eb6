"""A board whose bytes are lost or changed on the way, for tests."""

from collections.abc import Callable

from drivers.transport.simulated import Board

Fault = Callable[[bytes], bytes]


def no_fault(data: bytes) -> bytes:
    return data


class FaultyBoard:
    """Any board behind a bad cable: `to_board` and `from_board` change what goes through."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.to_board: Fault = no_fault
        self.from_board: Fault = no_fault

    def receive(self, data: bytes) -> None:
        self.board.receive(self.to_board(data))

    def advance(self, ticks: int) -> None:
        self.board.advance(ticks)

    def transmit(self) -> bytes:
        return self.from_board(self.board.transmit())


def once(fault: Fault) -> Fault:
    """Return a fault that strikes the first non-empty bytes only."""
    struck = False

    def strike(data: bytes) -> bytes:
        nonlocal struck
        if struck or not data:
            return data
        struck = True
        return fault(data)

    return strike
