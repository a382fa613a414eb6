"""Follows sequence numbers and device ticks: what is missing, and the wraps of the clock."""

import numpy as np
from numpy.typing import NDArray

from drivers.counters import LinkCounters

_WRAP = 2**32


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
