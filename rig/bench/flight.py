"""The flight recorder: every byte this computer sent to the board, and the board's tick then.

Commands decide what the board's core does; with them, the core and the plant a simulated run can be
made again (`rig replay --core`). On a simulated rig the tick is the one at which the core took the
bytes. On a real one it is that of the newest sample that had come, some milliseconds before.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.transport.transport import Transport
from rig.log.streams import FLIGHT_BYTES, FLIGHT_STREAM


class FlightRecorder:
    """A transport that keeps what is written. Has the interface of `Transport`.

    `tick_us` returns the board's clock now, us, as far as it is known.
    """

    def __init__(self, way: Transport, tick_us: Callable[[], int]) -> None:
        self._way = way
        self._tick_us = tick_us
        self._sent: list[tuple[int, bytes]] = []
        self.url = way.url
        self.read = way.read
        self.close = way.close

    @property
    def now_s(self) -> float:
        """The clock of the way."""
        return self._way.now_s

    def write(self, data: bytes) -> None:
        """Send bytes, and keep them."""
        self._sent.append((self._tick_us(), data))
        self._way.write(data)

    def rows(self, since: int) -> tuple[NDArray[np.void], int]:
        """Return the sendings since a number as rows of the log, and how many there are."""
        pieces = [
            (tick_us, data[cut : cut + FLIGHT_BYTES])
            for tick_us, data in self._sent[since:]
            for cut in range(0, len(data), FLIGHT_BYTES)
        ]
        whole = b"".join(data.ljust(FLIGHT_BYTES, b"\0") for _, data in pieces)
        rows = np.zeros(len(pieces), FLIGHT_STREAM.dtype)
        words = np.frombuffer(whole, "<u8").reshape(len(pieces), -1)
        for k in range(words.shape[1]):
            rows[f"word_{k}"] = words[:, k]
        rows["tick_us"] = [tick_us for tick_us, _ in pieces]
        rows["size"] = [len(data) for _, data in pieces]
        return rows, len(self._sent)
