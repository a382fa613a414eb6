"""Devices that send samples by themselves, without a clock to be read: what their drivers share."""

from collections.abc import Callable, Mapping

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
Samples = tuple[Mapping[str, NDArray[np.float64]], NDArray[np.uint8]]
"""Values by channel and the `SampleFlag` bits of samples, each of shape (n,)."""
Check = Callable[[NDArray[np.uint8]], NDArray[np.bool_]]
"""Returns for each row of candidates, shape (m, size), whether its checksum is right."""


class Arrivals:
    """Numbers the samples of a stream that does not, and notices its silences."""

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


class SlidingFrames:
    """Finds the frames in a byte stream, however it is cut and wherever it begins.

    To get in step, `agree` frames in a row must hold. In step, a frame is believed when it and the
    next one hold: a lost byte then lets a wrong frame through once in the square of the checksum's
    range, not once in the range.
    """

    def __init__(self, size: int, check: Check, counters: DeviceCounters, agree: int = 4) -> None:
        self._size = size
        self._check = check
        self._counters = counters
        self._agree = agree
        self.restart()

    def restart(self) -> None:
        """Forget what is held, and expect a stream that may begin within a frame."""
        self._held = b""
        self._in_step = self._was_in_step = False

    def feed(self, data: bytes) -> NDArray[np.uint8]:
        """Take the next bytes and return the frames they confirm, shape (n, size)."""
        stream = np.frombuffer(self._held + data, np.uint8)
        if stream.size < self._size:
            self._held = stream.tobytes()
            return np.empty((0, self._size), np.uint8)
        candidates = np.lib.stride_tricks.sliding_window_view(stream, self._size)
        good = self._check(candidates)
        found = []
        position = 0
        while True:
            if not self._in_step:
                position, self._in_step = self._search(good, position)
                if not self._in_step:
                    break
                self._was_in_step = True
            holds = good[position :: self._size]
            bad = np.flatnonzero(~holds)
            run = int(bad[0]) if bad.size else len(holds)
            believed = max(0, run - 1)
            found.append(candidates[position : position + believed * self._size : self._size])
            position += believed * self._size
            if not bad.size:
                break
            self._in_step = False
            self._counters.crc_errors += 1
        self._held = stream[position:].tobytes()
        frames = np.concatenate(found) if found else np.empty((0, self._size), np.uint8)
        self._counters.frames += len(frames)
        return frames

    def read(self, transport: Transport, timeout_s: float, early: bytes = b"") -> NDArray[np.uint8]:
        """Return the next frames, shape (n, size), waiting for the first; `early` came before."""
        give_up_s = transport.now_s + timeout_s
        while True:
            wait_s = 0.0 if early else max(0.0, give_up_s - transport.now_s)
            data = early + transport.read(wait_s)
            early = b""
            frames = self.feed(data)
            if len(frames) or not data or transport.now_s >= give_up_s:
                return frames

    def _search(self, good: NDArray[np.bool_], first: int) -> tuple[int, bool]:
        """Return where `agree` frames in a row hold, or where to go on searching."""
        span = (self._agree - 1) * self._size
        last = len(good) - span
        if last <= first:
            return first, False
        agreeing = good[first:last].copy()
        for frame in range(1, self._agree):
            start = first + frame * self._size
            agreeing &= good[start : start + last - first]
        places = np.flatnonzero(agreeing)
        skipped = int(places[0]) if places.size else last - first
        if self._was_in_step:  # before, it may have begun before anyone listened
            self._counters.discarded_bytes += skipped
        return first + skipped, bool(places.size)


class StreamedDevice(LinkedDevice):
    """A device that streams by itself.

    A driver gives `channels`, `identify`, `begin`, `receive` and `stop`.
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

    def receive(self, timeout_s: float) -> Samples:
        """Return the samples that have come."""
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
        """End the stream and wait until nothing more comes (`LinkTimeoutError`: it goes on)."""
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
