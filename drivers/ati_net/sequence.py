"""Follows the numbers of RDT records: lost, late and repeated ones, wraps and restarts."""

import numpy as np
from numpy.typing import NDArray

from drivers.counters import DeviceCounters

_WRAP = 2**32
RESTART_STEP = 1000
"""A number this far behind the newest is from a restarted device, not from a late packet.

A stream that the host has requested again may restart at any number. Whether it does is open for
as many records: a device may as well go on counting.
"""


class RecordSequence:
    """The thread through a stream of records that may be lost, repeated or overtaken.

    Args:
        counters: Counters of its errors.
    """

    def __init__(self, counters: DeviceCounters) -> None:
        self._counters = counters
        self._newest: int | None = None
        self._next = 0
        self._may_restart = 0
        self.lost = 0
        """Records lost since `restart`."""

    def restart(self) -> None:
        """Give the next record the number 0."""
        self._newest = None
        self._next = 0
        self._may_restart = 0
        self.lost = 0

    def expect_restart(self) -> None:
        """Let the device's numbers restart once, because the host has requested it."""
        self._may_restart = RESTART_STEP

    def follow(self, numbers: NDArray[np.uint32]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return which records are new and in order, with their numbers from 0 since `restart`.

        Args:
            numbers: `rdt_sequence` of the records as they came, shape (n,).

        Returns:
            A mask of shape (n,), and the numbers of the records it keeps.
        """
        kept = np.zeros(len(numbers), np.bool_)
        given = []
        for index, number in enumerate(numbers.tolist()):
            if self._take(number):
                kept[index] = True
                given.append(self._next - 1)
        return kept, np.array(given, np.int64)

    def _take(self, number: int) -> bool:
        step = 1
        if self._newest is not None:
            step = (number - self._newest + _WRAP // 2) % _WRAP - _WRAP // 2
        if step < 0 and self._may_restart:
            self._may_restart = 0
            step = 1
        elif step <= -RESTART_STEP:
            self._counters.restarts += 1
            step = 1
        self._may_restart = max(0, self._may_restart - 1)
        if step <= 0:
            if step == 0:
                self._counters.duplicates += 1
            else:
                self._counters.late += 1
            return False
        if step > 1:
            self._counters.gaps += 1
            self._counters.lost += step - 1
            self.lost += step - 1
        self._newest = number
        self._next += step
        return True
