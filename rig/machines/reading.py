"""Readings of a session: a segment of samples, as counts and in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from drivers.teensy.driver import SampleBatch
from drivers.teensy.protocol import (
    STATUS_ARMED,
    STATUS_LIMIT_TRIPPED,
    STATUS_QUEUE_DRY,
    STATUS_SATURATED,
    STATUS_WATCHDOG_TRIPPED,
)
from estimation.recording import Flag


@dataclass(frozen=True, eq=False)
class Reading:
    """A stretch of samples, as counts and in SI."""

    counts: NDArray[np.void]  # raw samples, structured, shape (n,)
    tick_us: NDArray[np.int64]  # device clock without its wrap, us, shape (n,)
    time_s: NDArray[np.float64]  # device clock since the session's first sample, s, shape (n,)
    columns: Mapping[str, NDArray[np.float64]]  # SI channels, closing-positive, each of shape (n,)
    flags: NDArray[np.uint8]  # `Flag` bits, shape (n,)
    # index of the setpoint played in each sample, -1 where none was, shape (n,)
    setpoint: NDArray[np.int64]
    lost: int  # samples lost since the session began

    @property
    def armed(self) -> bool:
        """Whether the logger was armed in the newest sample."""
        return bool(has_status(self.counts["status"], STATUS_ARMED)[-1])

    def __len__(self) -> int:
        return int(self.time_s.size)

    def where(self, keep: NDArray[np.bool_]) -> "Reading":
        """Return the samples a mask keeps."""
        return Reading(
            self.counts[keep],
            self.tick_us[keep],
            self.time_s[keep],
            {name: values[keep] for name, values in self.columns.items()},
            self.flags[keep],
            self.setpoint[keep],
            self.lost,
        )


def has_status(status: NDArray[np.uint16], bits: int) -> NDArray[np.bool_]:
    """Return which samples have any of these status bits, shape (n,)."""
    present: NDArray[np.bool_] = (status & np.uint16(bits)) != 0
    return present


def reading_of(
    batch: SampleBatch, calibrations: CalibrationSet, zeros: Mapping[str, float], first_tick_us: int
) -> Reading:
    """Convert a batch of samples, at least one, to SI units, with the board's complaints as flags.

    `zeros` holds the measured zero of a channel, counts; `first_tick_us` is the device clock at the
    session's first sample, us.
    """
    status = batch.samples["status"]
    tripped = has_status(status, STATUS_WATCHDOG_TRIPPED | STATUS_LIMIT_TRIPPED)
    flags = np.zeros(len(status), np.uint8)
    flags[has_status(status, STATUS_SATURATED)] |= np.uint8(Flag.SATURATED)
    flags[tripped] |= np.uint8(Flag.SUSPECT)
    if "flags" in (batch.samples.dtype.names or ()):  # a device's own
        flags |= batch.samples["flags"]
    return Reading(
        batch.samples,
        batch.tick_us,
        np.multiply(batch.tick_us - first_tick_us, 1e-6),
        calibrations.apply(batch.samples, zeros),
        flags,
        np.full(len(flags), -1),
        batch.lost,
    )


def with_setpoints(reading: Reading, played: int, planned: int, before: int | None) -> Reading:
    """Number the setpoints played, and flag samples that should have had one and had none.

    The logger plays one setpoint a tick and none in a tick in which its queue is dry. Lost samples
    are taken to have played theirs: the sequence numbers give their count. `played` is the first of
    the `planned` setpoints that is not played yet; `before` is the sequence number of the sample
    before these, None when nothing was played yet.
    """
    status = reading.counts["status"]
    playing = has_status(status, STATUS_ARMED) & ~has_status(status, STATUS_QUEUE_DRY)
    sequence = reading.counts["sequence"].astype(np.int64)
    step = np.diff(sequence, prepend=sequence[0] - 1 if before is None else before)
    newest = played - 1 + np.cumsum(np.where(playing, step, 0))
    held = ~playing & (newest >= 0) & (newest < planned - 1)
    flags = np.where(held, reading.flags | np.uint8(Flag.STALE), reading.flags).astype(np.uint8)
    return replace(reading, setpoint=np.where(playing, newest, -1), flags=flags)
