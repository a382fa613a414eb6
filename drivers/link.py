"""Frames over a transport, counted and asked for again, and the thread through their samples."""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.counters import TRIES, LinkCounters
from drivers.errors import LinkTimeoutError
from drivers.framing import DELIMITER, FrameStream, encode_frame
from drivers.transport.transport import Transport, time_left

_WRAP = 2**32
REPLY_TIMEOUT_S = 0.1
"""Time for one answer. A full queue of a USB port is emptied in a fraction of it."""


class FramedLink:
    """Frames to and from one device.

    Frames with payloads of `payload_size` bytes are the device's stream and wait in bulk; all
    others wait one by one.
    """

    def __init__(self, transport: Transport, payload_size: int) -> None:
        self.transport = transport
        self.counters = LinkCounters()
        self._payload_size = payload_size
        self._stream = FrameStream(payload_size)
        self._in_step = False
        self._bulk: list[NDArray[np.uint8]] = []
        self._others: deque[bytes] = deque()

    def poll(self, timeout_s: float) -> bool:
        """Take in what the device sent, waiting at most `timeout_s`; return whether bytes came."""
        data = self.transport.read(timeout_s)
        if not data:
            return False
        frames = self._stream.feed(data)
        good = len(frames.payloads) + len(frames.others)
        bad = frames.bad
        if not self._in_step and good + bad:
            self._in_step = True
            bad -= min(bad, 1)  # the first frame may have begun before anyone listened
        self.counters.frames += good
        self.counters.crc_errors += bad
        self.counters.discarded_bytes += frames.bad_bytes
        if len(frames.payloads):
            self._bulk.append(frames.payloads)
        self._others.extend(frames.others)
        return True

    @property
    def stream_waits(self) -> bool:
        """Whether stream frames have been received and not been taken."""
        return bool(self._bulk)

    def take_stream(self) -> NDArray[np.uint8]:
        """Return the stream frames received since the last call, shape (n, payload_size)."""
        if len(self._bulk) == 1:
            return self._bulk.pop()
        taken, self._bulk = self._bulk, []
        if not taken:
            return np.empty((0, self._payload_size), np.uint8)
        return np.concatenate(taken)

    def take_others(self) -> list[bytes]:
        """Return the other frames' payloads received since the last call."""
        taken = list(self._others)
        self._others.clear()
        return taken

    def send(self, payload: bytes) -> None:
        """Send one frame and wait for nothing."""
        self.transport.write(encode_frame(payload))

    def break_frame(self) -> None:
        """End whatever half frame the device may still hold from an earlier program."""
        self.transport.write(DELIMITER)

    def request(self, payload: bytes, answers: Callable[[bytes], bool]) -> bytes:
        """Send a frame until another that `answers` accepts comes back; others stay waiting.

        Raises:
            LinkTimeoutError: No answer to `TRIES` frames in `REPLY_TIMEOUT_S` each.
        """
        for attempt in range(TRIES):
            if attempt:
                self.counters.retries += 1
            self.send(payload)
            for remaining_s in time_left(self.transport, REPLY_TIMEOUT_S):
                self.poll(remaining_s)
                answer = self._take_first(answers)
                if answer is not None:
                    return answer
        raise LinkTimeoutError(
            f"The device at {self.transport.url} does not answer.",
            f"{TRIES} commands had {REPLY_TIMEOUT_S:g} s each.",
            "Check that it is powered and runs the rig's firmware.",
        )

    def _take_first(self, answers: Callable[[bytes], bool]) -> bytes | None:
        for index, payload in enumerate(self._others):
            if answers(payload):
                del self._others[index]
                return payload
        return None


class Continuity:
    """The thread through a stream of samples."""

    def __init__(self, counters: LinkCounters) -> None:
        self._counters = counters
        self._last_sequence = -1
        self._last_tick_us: int | None = None
        self.lost = 0
        """Samples lost since `restart`."""

    def restart(self) -> None:
        """Expect sequence number 0 next; the clock goes on."""
        self._last_sequence = -1
        self.lost = 0

    def follow(self, samples: NDArray[np.void]) -> tuple[NDArray[np.void], NDArray[np.int64]]:
        """Return the samples that are new, and their ticks without the wrap, microseconds.

        A repeated or late sample is dropped and counted. Between two samples less than 2^32 us
        (71.6 min) may pass.
        """
        if not len(samples):
            return samples, np.empty(0, np.int64)
        before = self._last_sequence
        steps = wrapped_steps(samples["sequence"], before)
        if (steps == 1).all():
            self._last_sequence = before + len(samples)
            return samples, self._unwrap(samples["tick_us"])
        sequence = before + np.cumsum((steps + _WRAP // 2) % _WRAP - _WRAP // 2)
        newest_before = np.maximum.accumulate(np.concatenate(([before], sequence[:-1])))
        fresh = sequence > newest_before
        if not fresh.all():
            self._counters.duplicates += int(np.count_nonzero(~fresh))
            samples, sequence = samples[fresh], sequence[fresh]
        if len(samples):
            missing = np.diff(sequence, prepend=before) - 1
            self._counters.gaps += int(np.count_nonzero(missing))
            self._counters.lost += int(missing.sum())
            self.lost += int(missing.sum())
            self._last_sequence = int(sequence[-1])
        return samples, self._unwrap(samples["tick_us"])

    def _unwrap(self, wrapped_us: NDArray[np.uint32]) -> NDArray[np.int64]:
        if not len(wrapped_us):
            return np.empty(0, np.int64)
        last_us = int(wrapped_us[0]) if self._last_tick_us is None else self._last_tick_us
        tick_us = last_us + np.cumsum(wrapped_steps(wrapped_us, last_us))
        self._last_tick_us = int(tick_us[-1])
        return tick_us


def wrapped_steps(wrapped: NDArray[np.uint32], before: int) -> NDArray[np.int64]:
    """Return how far a 32-bit count went with each value, 0 to 2^32 - 1, from `before` on."""
    count = np.empty(len(wrapped) + 1, np.uint32)
    count[0] = before % _WRAP
    count[1:] = wrapped
    return (count[1:] - count[:-1]).astype(np.int64)
