"""Frames of one size with a checksum and no mark where they begin: slide until checksums agree."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.counters import DeviceCounters
from drivers.transport.transport import Transport

Check = Callable[[NDArray[np.uint8]], NDArray[np.bool_]]
"""Returns for each row of candidates, shape (m, size), whether its checksum is right."""


class SlidingFrames:
    """Finds the frames in a byte stream, however it is cut and wherever it begins.

    To get in step, `agree` frames in a row must hold. In step, a frame is believed when it and the
    next one hold: a lost byte then lets a wrong frame through once in the square of the checksum's
    range, not once in the range.

    Args:
        size: Bytes of a frame.
        check: The checksum.
        counters: Counters of frames, bad ones and discarded bytes.
        agree: Frames in a row that must hold.
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
        """Read until a frame is confirmed or nothing comes; return the frames, shape (n, size).

        Args:
            transport: Where the bytes come from.
            timeout_s: Longest wait for the first.
            early: Bytes that came before.
        """
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
