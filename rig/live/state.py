"""State of the display: accumulates blocks, and returns one picture of them on request.

No input or output and no clock but the device's, so every number here is tested without a terminal.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.channels import unit_of
from estimation.recording import Flag, FloatArray
from rig.errors import ExitCode
from rig.live.block import DeviceStatus, LimitStatus, SampleBlock

BIN_S = 0.02
VALUE_S = 0.1
"""A value is the mean of this long: the time between two frames."""
RATE_S = 2.0
ERROR_S = 5.0
TRACE_S = 10.0
BINS = round(TRACE_S / BIN_S)
SILENT_BLOCKS = 2
"""After this many consecutive blocks without samples, the last value is out of date."""

FLAGS = tuple(flag for flag in Flag if flag)
TIME, RECEIVED, FIRST_FLAG = range(3)
FIRST_CHANNEL = FIRST_FLAG + len(FLAGS)
ESTIMATE, SENSOR, SQUARED_ERROR = range(3)
"""Rows of the signals: first those of all samples, then three for each channel."""

NOTHING = SampleBlock(np.empty(0), {}, np.empty(0, np.uint8), {}, 0, ())


@dataclass(frozen=True, slots=True)
class Value:
    """A number, or the reason why it is missing."""

    number: float | None
    missing: str = ""


@dataclass(frozen=True, eq=False)
class Reading:
    """One quantity: estimate and sensor reading, means of the last 0.1 s."""

    channel: str
    unit: str
    has_estimator: bool  # whether the stream carries estimates of it
    estimate: Value
    sensor: Value
    error_rms: float | None  # root mean square of estimate minus sensor over the last 5 s, or None
    # least and greatest estimate in each 20 ms of the last 10 s, shape (2, 500), oldest first, NaN
    # where there is none
    estimate_trace: FloatArray
    sensor_trace: FloatArray  # the same of the sensor

    @property
    def source(self) -> str:
        """Where the main value is from: the estimate, or the sensor where nothing estimates it."""
        return "estimate" if self.has_estimator else "sensor"

    @property
    def main(self) -> Value:
        """The main value."""
        return self.estimate if self.has_estimator else self.sensor


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One picture of the stream."""

    time_s: float | None  # device time of the newest sample, or None before the first
    samples: int  # samples received since the start, as `lost`
    lost: int
    sample_rate_hz: float | None  # samples received over device time in the last 2 s, or None
    flagged: Mapping[str, int]  # name of each flag seen in the last 10 s and on how many samples
    readings: tuple[Reading, ...]  # the watched quantities, the main one first
    devices: tuple[DeviceStatus, ...]
    limits: tuple[LimitStatus, ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """Summary of a whole stream."""

    ended: str  # `finished` when the stream ended, `interrupted` when a person left
    duration_s: float  # device time covered
    samples: int
    lost: int
    flagged: Mapping[str, int]  # name of each flag seen and on how many samples
    channel: str
    error_rms: float | None  # root mean square of its estimate minus its sensor value, SI, or None
    error_samples: int  # samples in that number: those not flagged and with both values
    inside_rms: float | None = None  # the same within the fitted range of the estimator, or None
    inside_samples: int = 0  # samples in that number

    @property
    def exit_code(self) -> ExitCode:
        """What a command that showed the stream ends with."""
        return ExitCode.INTERRUPTED if self.ended == "interrupted" else ExitCode.OK


class LiveState:
    """Accumulates blocks. Flagged samples count as received but give no value."""

    def __init__(self, channels: tuple[str, ...], all_columns: bool = False) -> None:
        """Start with nothing seen; `all_columns` watches all columns of the first block too."""
        self.channels = channels
        self._takes_all = all_columns
        self._held: deque[FloatArray] = deque()
        self._time_s: float | None = None
        self._last = self._last_full = NOTHING
        self._silent = 0
        self._duration_s = 0.0
        self._samples = 0
        self._flagged = np.zeros(len(FLAGS), np.int64)
        self._error = np.zeros(2)  # sum of squares, samples
        self._inside_error = np.zeros(2)

    def feed(self, block: SampleBlock) -> None:
        """Take in one block; where time runs backwards, a device restarted and so do the traces."""
        self._last = block
        self._silent = self._silent + 1 if len(block) == 0 else 0
        if self._silent:
            return
        if self._takes_all:
            self._takes_all = False
            self.channels = tuple(dict.fromkeys((*self.channels, *block.columns)))
        self._last_full = block
        first_s, last_s = float(block.time_s[0]), float(block.time_s[-1])
        if self._time_s is not None and first_s <= self._time_s:
            self._held.clear()
            self._time_s = None
        self._duration_s += last_s - (first_s if self._time_s is None else self._time_s)
        self._time_s = last_s
        signals = self._signals(block)
        self._held.append(signals)
        while last_s - self._held[0][TIME, -1] > TRACE_S:
            self._held.popleft()
        self._samples += int(np.isfinite(signals[RECEIVED]).sum())
        self._flagged += np.isfinite(signals[FIRST_FLAG:FIRST_CHANNEL]).sum(axis=1)
        # the error of the main estimate, outside its range too
        main, nan = self.channels[0], np.full(len(block), np.nan)
        error = block.estimates.get(main, nan) - block.columns.get(main, nan)
        squared = np.where(block.flags == 0, error**2, nan)
        self._error += np.nansum(squared), np.isfinite(squared).sum()
        if (inside := block.inside.get(main)) is not None:
            self._inside_error += np.nansum(squared[inside]), np.isfinite(squared[inside]).sum()

    def _signals(self, block: SampleBlock) -> FloatArray:
        """Return the signals of a block, shape (signals, n), NaN where missing."""
        nan = np.full(len(block), np.nan)
        valid = block.flags == 0
        received = (block.flags & Flag.MISSING) == 0
        rows = [block.time_s, np.where(received, block.time_s, nan)]
        rows += [np.where(block.flags & flag, 1.0, nan) for flag in FLAGS]
        for channel in self.channels:
            estimate = np.where(valid, block.estimates.get(channel, nan), nan)
            sensor = np.where(valid, block.columns.get(channel, nan), nan)
            estimate = np.where(block.inside.get(channel, valid), estimate, nan)
            rows += [estimate, sensor, (estimate - sensor) ** 2]
        return np.stack(rows)

    def snapshot(self) -> Snapshot:
        """Return the picture of now."""
        nothing = np.empty((FIRST_CHANNEL + 3 * len(self.channels), 0))
        seen = Recent(np.concatenate([nothing, *self._held], axis=1))
        return Snapshot(
            time_s=self._time_s,
            samples=self._samples,
            lost=self._last.lost,
            sample_rate_hz=seen.rate_hz(),
            flagged=_named(seen.flags(TRACE_S)),
            readings=tuple(self._reading(index, seen) for index in range(len(self.channels))),
            devices=self._last.devices,
            limits=self._last.limits,
        )

    def summary(self, ended: str) -> Summary:
        """Return the summary since the start; `ended` is the reason of the end."""
        return Summary(
            ended=ended,
            duration_s=self._duration_s,
            samples=self._samples,
            lost=self._last.lost,
            flagged=_named(self._flagged),
            channel=self.channels[0],
            error_rms=_rms(*self._error),
            error_samples=int(self._error[1]),
            inside_rms=_rms(*self._inside_error),
            inside_samples=int(self._inside_error[1]),
        )

    def _reading(self, index: int, seen: "Recent") -> Reading:
        channel, block = self.channels[index], self._last_full
        row = FIRST_CHANNEL + 3 * index
        beyond = "outside what it was fitted on" if channel in block.inside else "not a number"
        squared = seen.last(ERROR_S, row + SQUARED_ERROR)
        squared = squared[np.isfinite(squared)]
        no_estimate = "" if channel in block.estimates else "no estimator"
        no_sensor = "" if channel in block.columns else "no sensor"
        return Reading(
            channel=channel,
            unit=unit_of(channel),
            has_estimator=channel in block.estimates,
            estimate=self._value(seen, row + ESTIMATE, no_estimate, beyond),
            sensor=self._value(seen, row + SENSOR, no_sensor, "not a number"),
            error_rms=math.sqrt(squared.mean()) if squared.size else None,
            estimate_trace=seen.trace(row + ESTIMATE),
            sensor_trace=seen.trace(row + SENSOR),
        )

    def _value(self, seen: "Recent", row: int, absent: str, otherwise: str) -> Value:
        """Return the mean of the last 0.1 s, or why there is none.

        A mean over less than half of the samples would stand for the time when all was well, not
        for now, so it is not shown.
        """
        if self._time_s is None or self._silent >= SILENT_BLOCKS:
            return Value(None, "no samples arriving")
        if absent:
            return Value(None, absent)
        values = seen.last(VALUE_S, row)
        usable = values[np.isfinite(values)]
        if 2 * usable.size >= values.size:
            return Value(float(usable.mean()))
        return Value(None, ", ".join(_named(seen.flags(VALUE_S))) or otherwise)


class Recent:
    """The samples of the last 10 s, shape (signals, n).

    Signals are the time, the time where received, 1 where flagged, and values; NaN elsewhere.
    """

    def __init__(self, signals: FloatArray) -> None:
        self._signals = signals
        bins = np.floor(signals[TIME] / BIN_S).astype(np.int64)
        bins = bins - bins[-1:] + BINS - 1
        self._first = np.flatnonzero(np.diff(bins, prepend=-1))
        self._bins = bins[self._first]

    def last(self, span_s: float, row: int | slice) -> FloatArray:
        """Return the last samples of a signal, or of several."""
        time_s = self._signals[TIME]
        first = np.searchsorted(time_s, time_s[-1] - span_s + 1e-9) if time_s.size else 0
        return self._signals[row, first:]

    def flags(self, span_s: float) -> NDArray[np.int64]:
        """Return on how many of the last samples each flag was seen."""
        seen = np.isfinite(self.last(span_s, slice(FIRST_FLAG, FIRST_CHANNEL)))
        return np.asarray(seen.sum(axis=1))

    def rate_hz(self) -> float | None:
        """Return the rate of the samples received in the last 2 s."""
        received = self.last(RATE_S, RECEIVED)
        received = received[np.isfinite(received)]
        if received.size < 2:
            return None
        return float((received.size - 1) / (received[-1] - received[0]))

    def trace(self, row: int) -> FloatArray:
        """Return the least and the greatest value of each bin, shape (2, bins)."""
        shown = np.full((2, BINS), np.nan)
        inside = self._bins >= 0
        for side, extreme in enumerate((np.fmin, np.fmax)):
            values = extreme.reduceat(self._signals[row], self._first)
            shown[side, self._bins[inside]] = values[inside]
        return shown


def _rms(squared: float, samples: float) -> float | None:
    return math.sqrt(squared / samples) if samples else None


def _named(counts: NDArray[np.int64]) -> dict[str, int]:
    """Return the flags that were seen, by name, most frequent first."""
    seen = {str(f.name).lower(): int(n) for f, n in zip(FLAGS, counts, strict=True) if n}
    return dict(sorted(seen.items(), key=lambda item: -item[1]))
