"""Devices that send samples by themselves, without a clock to be read: what their drivers share."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.counters import DeviceCounters
from drivers.device import Batch, LinkedDevice
from drivers.errors import DriverError, LinkTimeoutError
from drivers.transport.transport import Transport

LONGEST_SILENCE_S = 0.1
"""Shortest time without a sample that may count as a silence, s."""
QUIET_S = 0.05
"""A stopped stream has ended when nothing arrives for this long, s."""
ENDS_S = 1.0


class Arrivals:
    """Numbers the samples of a stream that does not, and notices its silences.

    Args:
        counters: Counters to add silences to.
        longest_silence_s: Longest time between samples that is not a fault, s.
    """

    def __init__(self, counters: DeviceCounters, longest_silence_s: float) -> None:
        self._counters = counters
        self._longest_silence_s = longest_silence_s
        self.restart(0.0)

    def restart(self, now_s: float) -> None:
        """Begin to count at 0 and to listen from now on."""
        self._next = 0
        self._heard_s = now_s
        self._silent = False

    def number(self, count: int, now_s: float) -> NDArray[np.int64]:
        """Return the numbers of `count` samples that have come, int64, shape (count,).

        Call it with 0 when nothing came, too: a silence is then counted once, while it lasts.
        """
        if now_s - self._heard_s > self._longest_silence_s and not self._silent:
            self._counters.stalls += 1
            self._silent = True
        if count:
            self._heard_s = now_s
            self._silent = False
        numbers = np.arange(self._next, self._next + count, dtype=np.int64)
        self._next += count
        return numbers


class StreamedDevice(LinkedDevice):
    """A device that streams by itself.

    A driver gives `channels`, `identify`, `begin`, `receive` and `stop`.

    Args:
        transport: The way to it; the device closes it.
        rate_hz: Samples a second.
        title: The device in messages.
    """

    def __init__(self, transport: Transport, rate_hz: float, title: str) -> None:
        super().__init__(transport, rate_hz)
        self._transport = transport
        self._title = title
        self._arrivals = Arrivals(self._counters, max(LONGEST_SILENCE_S, 5 / rate_hz))
        self._bad_at_start = 0

    def begin(self) -> None:
        """Let the stream begin."""
        raise NotImplementedError

    def receive(
        self, timeout_s: float
    ) -> tuple[Mapping[str, NDArray[np.float64]], NDArray[np.uint8]]:
        """Return the values by channel and the `SampleFlag` bits of the samples that have come."""
        raise NotImplementedError

    def start(self) -> None:
        """Let the stream begin; sequence numbers begin at 0.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The device refuses.
        """
        if not self._identified:
            self.identify()
        self.begin()
        self._bad_at_start = self._counters.crc_errors
        self._arrivals.restart(self._transport.now_s)

    def read(self, timeout_s: float) -> Batch:
        """Return the samples that have come, stamped with the time of this read.

        Raises:
            DriverError: Neither `identify` nor `start` has been called.
        """
        if not self._identified:
            raise DriverError(f"The {self._title} is not known.", fix="Call start first.")
        columns, flags = self.receive(timeout_s)
        now_s = self._transport.now_s
        return Batch(
            columns,
            np.full(flags.size, now_s),
            "host",
            self._arrivals.number(flags.size, now_s),
            flags,
            self._counters.crc_errors - self._bad_at_start,
        )

    def quieten(self) -> None:
        """End the stream and wait until nothing more comes.

        Raises:
            LinkTimeoutError: It goes on.
        """
        self.stop()
        give_up_s = self._transport.now_s + ENDS_S
        while self._transport.read(QUIET_S):
            if self._transport.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"The {self._title} at {self._transport.url} does not end its stream.",
                    f"It was stopped and continued for {ENDS_S:g} s.",
                    "Check the adapter's sending side and the bit rate, or switch the device off"
                    " and on.",
                )
