"""Questions to one moteus and its answers, as lines of an fdcanusb."""

from collections.abc import Callable
from typing import TypeVar

from drivers.counters import DeviceCounters, silent
from drivers.errors import FrameError
from drivers.moteus import protocol
from drivers.transport.transport import Transport

T = TypeVar("T")
REPLY_TIMEOUT_S = 0.02
"""Time for an answer: below a millisecond on the bus, and what USB takes."""


class FdcanusbLink:
    """One controller behind an fdcanusb.

    Args:
        transport: The way to the fdcanusb.
        device_id: The controller's identifier.
        counters: Where retries, time-outs and damaged lines are counted.
    """

    def __init__(self, transport: Transport, device_id: int, counters: DeviceCounters) -> None:
        self._transport = transport
        self._id = device_id
        self._counters = counters
        self._held = b""

    def ask(self, data: bytes, decode: Callable[[bytes], T]) -> T:
        """Send subframes and return the answer as decoded; one that cannot be is asked for again.

        Raises:
            LinkTimeoutError: Nobody answers.
        """
        line = protocol.send_line(self._id, data)
        for _ in self._counters.attempts():
            self.discard()
            self._transport.write(line)
            answer = self._receive()
            if answer is None:
                continue
            try:
                return decode(answer)
            except FrameError:
                self._counters.crc_errors += 1
        where = f"{self._transport.url}, identifier {self._id}"
        check = "Check its supply, the identifier, and both terminators of the bus."
        raise silent("moteus", where, REPLY_TIMEOUT_S, check)

    def discard(self, wait_s: float = 0.0) -> None:
        """Drop what comes unasked in a time: it is late."""
        late = self._held + self._transport.read(wait_s)
        self._counters.discarded_bytes += len(late)
        self._held = b""

    def _receive(self) -> bytes | None:
        """Return the data of the controller's next frame, None when none comes in time."""
        wanted = self._id << 8 | protocol.HOST
        give_up_s = self._transport.now_s + REPLY_TIMEOUT_S
        while True:
            line, end, rest = self._held.partition(b"\n")
            if end:
                self._held = rest
                try:
                    frame = protocol.decode_line(line)
                except FrameError:
                    self._counters.crc_errors += 1
                    self._counters.discarded_bytes += len(line)
                    continue
                if frame is not None and frame[0] == wanted:
                    return frame[1]
                continue
            if len(line) > protocol.LONGEST_LINE:
                self._held = b""
                self._counters.discarded_bytes += len(line)
            remaining_s = give_up_s - self._transport.now_s
            if remaining_s <= 0:
                return None
            self._held += self._transport.read(remaining_s)
