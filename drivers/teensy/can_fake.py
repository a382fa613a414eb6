"""A logger board on a CAN bus in this process: any board, its frames cut into pieces."""

from drivers.device import Device
from drivers.framing import cobs_decode, cobs_encode
from drivers.teensy.can_device import TeensyCanDevice
from drivers.teensy.can_segments import BOARD_ID, HOST_ID, Joiner, Splitter
from drivers.teensy.can_transport import CanTransport
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.transport.can_bus import CanFrame
from drivers.transport.faulty import Faults
from drivers.transport.faulty_can import FaultyCanBus
from drivers.transport.simulated import Board
from drivers.transport.simulated_can import SimulatedCanBus


class BoardNode:
    """A board with the interface of `drivers.transport.simulated_can.CanNode`."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self._splitter = Splitter()
        self._joiner = Joiner()
        self._unsent = b""

    def receive(self, frame: CanFrame) -> None:
        """Take a frame from the bus."""
        if frame.can_id == HOST_ID and not frame.extended:
            for body in self._joiner.join(frame.data):
                self.board.receive(cobs_encode(body) + b"\x00")

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass."""
        self.board.advance(ticks)

    def transmit(self) -> list[CanFrame]:
        """Give the frames to be sent."""
        *whole, self._unsent = (self._unsent + self.board.transmit()).split(b"\x00")
        return [
            CanFrame(BOARD_ID, piece)
            for encoded in whole
            if encoded
            for piece in self._splitter.split(cobs_decode(encoded))
        ]


def open_fake(faults: Faults) -> Device:
    """Open the device on a fake board behind a CAN bus with faults."""
    bus = SimulatedCanBus([BoardNode(PythonBoard(HandMovedBench()))])
    return TeensyCanDevice(CanTransport(FaultyCanBus(bus, faults)))
