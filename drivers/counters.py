"""Counters of the link to a device."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass

from drivers.errors import LinkTimeoutError

TRIES = 3
"""How often a question is asked before its device is taken for silent."""


@dataclass(slots=True)
class LinkCounters:
    """Counters of a link since it was opened."""

    frames: int = 0  # good frames received
    crc_errors: int = 0  # frames dropped: wrong CRC, not COBS, or too long
    discarded_bytes: int = 0  # bytes in dropped frames, and those before the first whole frame
    unknown_frames: int = 0  # good frames of an unexpected kind or version
    gaps: int = 0  # places where samples are missing
    lost: int = 0  # samples missing in those places
    duplicates: int = 0  # samples dropped because they had come before
    retries: int = 0  # commands sent again because no answer came

    def as_dict(self) -> dict[str, int]:
        """Return the counters by name."""
        return asdict(self)


@dataclass(slots=True)
class DeviceCounters(LinkCounters):
    """Counters of a link since it was opened; see also `LinkCounters`.

    `crc_errors` counts checksums that do not fit, whatever their kind.
    """

    timeouts: int = 0  # answers that did not come in time, after the retries
    stalls: int = 0  # silences of a stream longer than it should ever be silent
    late: int = 0  # packets dropped because later ones had come before them
    device_errors: int = 0  # samples in which the device itself reports a fault
    restarts: int = 0  # number of restarts of the device's own numbering

    def attempts(self) -> Iterator[int]:
        """Yield the numbers of the attempts at a question, from 0.

        Each but the first is counted as a retry, and a time-out when all have been used.
        """
        for attempt in range(TRIES):
            self.retries += attempt > 0
            yield attempt
        self.timeouts += 1


def silent(title: str, where: str, timeout_s: float, check: str) -> LinkTimeoutError:
    """Return the error of a device that answers no question, and what a person should check."""
    why = f"It was asked {TRIES} times and had {timeout_s:g} s each."
    return LinkTimeoutError(f"No {title} answers at {where}.", why, check)
