"""Follows a Net F/T's stream: lost, late and repeated records, restarts, and whether it is alive.

UDP may lose the request for the stream as well as a record of it, so a stream that does not come
is requested again. A device that is gone sends nothing, and one whose sensor has stopped sends the
same internal sample for ever: neither shows in the numbers of the records.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.counters import DeviceCounters
from drivers.errors import DriverError, LinkTimeoutError

_WRAP = 2**32
RESTART_STEP = 1000
"""A number this far behind the newest is from a restarted device, not from a late packet.

A stream that the host has requested again may restart at any number. Whether it does is open for
as many records: a device may as well go on counting.
"""
ASK_AGAIN_S = 0.5
"""Silence after which the stream is requested again, and at every such time from then on."""
DEAD_S = 1.0
"""Silence that is an error."""
FROZEN_S = 0.1
"""Time for which the internal sample number may stay: 500 samples of the slowest sensor's."""
LEAST_REPEATS = 5


class RecordSequence:
    """The thread through a stream of records that may be lost, repeated or overtaken."""

    def __init__(self, counters: DeviceCounters) -> None:
        self._counters = counters
        self.restart()

    def restart(self) -> None:
        """Give the next record the number 0."""
        self._newest: int | None = None
        self._next = self._may_restart = 0
        self.lost = 0
        """Records lost since `restart`."""

    def expect_restart(self) -> None:
        """Let the device's numbers restart once, because the host has requested it."""
        self._may_restart = RESTART_STEP

    def follow(self, numbers: NDArray[np.uint32]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return which `rdt_sequence` are new and in order, and their numbers since `restart`."""
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


class StreamWatch:
    """The life of one stream of so many records a second."""

    def __init__(self, url: str, rate_hz: float, counters: DeviceCounters) -> None:
        self._url = url
        self._counters = counters
        self._most_repeats = max(LEAST_REPEATS, round(FROZEN_S * rate_hz))
        self.restart(0.0)

    def restart(self, now_s: float) -> None:
        """Expect a stream that was requested now."""
        self._heard_s = self._asked_s = now_s
        self._internal: int | None = None
        self._repeats = 0
        self._frozen = False

    def is_to_be_asked_again(self, now_s: float) -> bool:
        """Return whether the stream has been silent long enough to be requested now."""
        if now_s - max(self._heard_s, self._asked_s) < ASK_AGAIN_S:
            return False
        self._asked_s = now_s
        self._counters.retries += 1
        return True

    def follow(self, internal: NDArray[np.uint32], now_s: float) -> None:
        """Take the internal sample numbers of the records that came, shape (n,), n from 0.

        Raises:
            LinkTimeoutError: Nothing has come for `DEAD_S`; every call says so while it lasts.
            DriverError: The sensor repeats one internal sample; likewise.
        """
        if len(internal) == 0:
            self._require_life(now_s)
            return
        self._heard_s = now_s
        before = internal[0] if self._internal is None else np.uint32(self._internal)
        moved = np.flatnonzero(np.diff(internal, prepend=before))
        if self._internal is None:
            self._repeats = -1  # the first record repeats nothing
        self._repeats = (
            len(internal) - 1 - int(moved[-1]) if len(moved) else self._repeats + len(internal)
        )
        self._internal = int(internal[-1])
        if self._repeats < self._most_repeats:
            self._frozen = False
            return
        if not self._frozen:
            self._counters.device_errors += 1
        self._frozen = True
        raise DriverError(
            f"The force/torque sensor at {self._url} is frozen.",
            f"Its last {self._repeats} records carry one and the same internal sample.",
            "Check the cable between transducer and Net Box, then switch the device off and on.",
        )

    def _require_life(self, now_s: float) -> None:
        if now_s - self._heard_s <= DEAD_S:
            return
        raise LinkTimeoutError(
            f"The force/torque sensor at {self._url} has fallen silent.",
            f"No record came for {now_s - self._heard_s:.1f} s; the stream was requested again.",
            "Check its power and the network cable; another program may have taken the stream.",
        )
