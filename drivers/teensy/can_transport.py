"""The logger on a CAN bus as a byte transport: the driver receives the bytes of a serial line."""

from drivers.framing import cobs_decode, cobs_encode
from drivers.teensy.can_segments import BOARD_ID, HOST_ID, Joiner, Splitter
from drivers.transport.can_bus import CanBus, CanFrame


class CanTransport:
    """Frames of the logger over two identifiers, with the interface of `Transport`.

    Args:
        bus: The bus; closed with this.
        host_id: Identifier of what the host sends.
        board_id: Identifier of what the board sends.
    """

    def __init__(self, bus: CanBus, host_id: int = HOST_ID, board_id: int = BOARD_ID) -> None:
        self._bus = bus
        self._host_id = host_id
        self._board_id = board_id
        self._splitter = Splitter()
        self._joiner = Joiner()
        self._unsent = b""

    @property
    def url(self) -> str:
        """The bus's URL."""
        return self._bus.url

    @property
    def now_s(self) -> float:
        """The bus's clock, seconds."""
        return self._bus.now_s

    def read(self, timeout_s: float) -> bytes:
        """Return whole frames as on a serial line, waiting at most `timeout_s` for the first."""
        give_up_s = self._bus.now_s + timeout_s
        data = b""
        while True:
            remaining_s = 0.0 if data else max(0.0, give_up_s - self._bus.now_s)
            frame = self._bus.read(remaining_s if remaining_s > 1e-9 else 0.0)
            if frame is None:
                return data
            if frame.can_id == self._board_id and not frame.extended:
                for body in self._joiner.join(frame.data):
                    data += cobs_encode(body) + b"\x00"

    def write(self, data: bytes) -> None:
        """Send the frames that `data` completes."""
        *whole, self._unsent = (self._unsent + data).split(b"\x00")
        for encoded in whole:
            if encoded:
                for piece in self._splitter.split(cobs_decode(encoded)):
                    self._bus.send(CanFrame(self._host_id, piece))

    def close(self) -> None:
        """Let go of the bus."""
        self._bus.close()
