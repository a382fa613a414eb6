"""Counters of the link to a device, and numbers for samples without any."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.link import LinkCounters


@dataclass(slots=True)
class DeviceCounters(LinkCounters):
    """Counters of a link since it was opened; see also `drivers.link.LinkCounters`.

    `crc_errors` counts checksums that do not fit, whatever their kind.

    Attributes:
        timeouts: Answers that did not come in time, after the retries.
        stalls: Silences of a stream longer than it should ever be silent.
        late: Packets dropped because later ones had come before them.
        device_errors: Samples in which the device itself reports a fault.
        restarts: Number of restarts of the device's own numbering.
    """

    timeouts: int = 0
    stalls: int = 0
    late: int = 0
    device_errors: int = 0
    restarts: int = 0


class Arrivals:
    """Numbers the samples of a stream that does not, and notices its silences.

    Args:
        counters: Counters to add silences to.
        longest_silence_s: Longest time between samples that is not a fault, s.
    """

    def __init__(self, counters: DeviceCounters, longest_silence_s: float) -> None:
        self._counters = counters
        self._longest_silence_s = longest_silence_s
        self._next = 0
        self._heard_s = 0.0
        self._silent = False

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
