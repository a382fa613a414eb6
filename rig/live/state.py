"""State of the display: accumulates blocks, and returns one picture of them on request.

No input or output and no clock but the device's, so every number here is tested without a terminal.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.channels import unit_of
from estimation.recording import Flag
from rig.errors import ExitCode
from rig.live.block import DeviceStatus, FloatArray, LimitStatus, SampleBlock
from rig.live.window import Window

BIN_S = 0.02
VALUE_S = 0.1
"""A value is the mean of this long: the time between two frames."""
RATE_S = 2.0
ERROR_S = 5.0
TRACE_S = 10.0
SILENT_BLOCKS = 2
"""After this many consecutive blocks without samples, the last value is out of date."""

FLAGS = tuple(flag for flag in Flag if flag)
RECEIVED, ROWS, FIRST_FLAG = 0, 1, 2
FIRST_CHANNEL = FIRST_FLAG + len(FLAGS)
ESTIMATE, SENSOR, SQUARED_ERROR = range(3)


@dataclass(frozen=True, slots=True)
class Value:
    """A number, or the reason why there is none.

    Attributes:
        number: The value, or None.
        missing: Why the value is missing; empty when it is not.
    """

    number: float | None
    missing: str = ""


@dataclass(frozen=True, eq=False)
class Reading:
    """One quantity: estimate and sensor reading.

    Attributes:
        channel: Name of the channel.
        unit: Its SI unit.
        has_estimator: Whether the stream carries estimates of it.
        estimate: Mean estimate of the last 0.1 s.
        sensor: Mean sensor value of the last 0.1 s.
        error_rms: Root mean square of estimate minus sensor over the last 5 s, or None.
        estimate_trace: Least and greatest estimate in each 20 ms of the last 10 s, shape (2, 500),
            oldest first, NaN where there is none.
        sensor_trace: The same of the sensor.
    """

    channel: str
    unit: str
    has_estimator: bool
    estimate: Value
    sensor: Value
    error_rms: float | None
    estimate_trace: FloatArray
    sensor_trace: FloatArray

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
    """One picture of the stream.

    Attributes:
        time_s: Device time of the newest sample, or None before the first.
        samples: Samples received since the start.
        lost: Samples lost since the start.
        sample_rate_hz: Samples received over device time in the last 2 s, or None.
        flagged: Name of each flag seen in the last 10 s and on how many samples.
        readings: The watched quantities, the main one first.
        devices: State of each device.
        limits: Watched limits.
    """

    time_s: float | None
    samples: int
    lost: int
    sample_rate_hz: float | None
    flagged: Mapping[str, int]
    readings: tuple[Reading, ...]
    devices: tuple[DeviceStatus, ...]
    limits: tuple[LimitStatus, ...]


@dataclass(frozen=True, slots=True)
class Summary:
    """Summary of a whole stream.

    Attributes:
        ended: `finished` when the stream ended, `interrupted` when a person left.
        duration_s: Device time covered, s.
        samples: Samples received.
        lost: Samples lost.
        flagged: Name of each flag seen and on how many samples.
        channel: The main quantity.
        error_rms: Root mean square of its estimate minus its sensor value, SI, or None.
        error_samples: Samples in that number: those not flagged and with both values.
        inside_rms: The same within the fitted range of the estimator, or None.
        inside_samples: Samples in that number.
    """

    ended: str
    duration_s: float
    samples: int
    lost: int
    flagged: Mapping[str, int]
    channel: str
    error_rms: float | None
    error_samples: int
    inside_rms: float | None = None
    inside_samples: int = 0

    @property
    def exit_code(self) -> ExitCode:
        """What a command that showed the stream ends with."""
        return ExitCode.INTERRUPTED if self.ended == "interrupted" else ExitCode.OK


class LiveState:
    """Accumulates blocks. Flagged samples count as received but give no value."""

    def __init__(self, channels: tuple[str, ...], all_columns: bool = False) -> None:
        """Start with nothing seen.

        Args:
            channels: The quantities to watch, the main one first.
            all_columns: Watch all other columns of the first block, too.
        """
        self.channels = channels
        self._takes_all = all_columns
        self._window = Window(FIRST_CHANNEL + 3 * len(channels), TRACE_S, BIN_S)
        self._time_s: float | None = None
        self._last: SampleBlock | None = None
        self._estimated: frozenset[str] = frozenset()
        self._sensed: frozenset[str] = frozenset()
        self._silent = 0
        self._duration_s = 0.0
        self._samples = 0
        self._flagged = np.zeros(len(FLAGS), np.int64)
        self._squared_error = 0.0
        self._error_samples = 0
        self._inside_squared = 0.0
        self._inside_samples = 0

    @property
    def time_s(self) -> float | None:
        """Device time of the newest sample, or None before the first."""
        return self._time_s

    def feed(self, block: SampleBlock) -> None:
        """Take in one block; where time runs backwards, a device restarted and so do the traces."""
        self._last = block
        self._silent = self._silent + 1 if len(block) == 0 else 0
        if self._silent:
            return
        if self._takes_all:
            self._takes_all = False
            self.channels = tuple(dict.fromkeys((*self.channels, *block.columns)))
            self._window = Window(FIRST_CHANNEL + 3 * len(self.channels), TRACE_S, BIN_S)
        self._estimated, self._sensed = frozenset(block.estimates), frozenset(block.columns)
        first_s, last_s = float(block.time_s[0]), float(block.time_s[-1])
        if self._time_s is not None and first_s <= self._time_s:
            self._window.clear()
            self._time_s = None
        self._duration_s += last_s - (first_s if self._time_s is None else self._time_s)
        self._time_s = last_s
        signals = self._signals(block)
        self._window.add(block.time_s, signals)
        self._samples += int(np.isfinite(signals[RECEIVED]).sum())
        self._flagged += np.isfinite(signals[FIRST_FLAG:FIRST_CHANNEL]).sum(axis=1)
        squared = self._squared_error_of(block)
        self._squared_error += float(np.nansum(squared))
        self._error_samples += int(np.isfinite(squared).sum())
        inside = block.inside.get(self.channels[0])
        if inside is not None:
            self._inside_squared += float(np.nansum(squared[inside]))
            self._inside_samples += int(np.isfinite(squared[inside]).sum())

    def _signals(self, block: SampleBlock) -> FloatArray:
        """Return the values of a block for the window, shape (signals, n), NaN where missing."""
        nan = np.full(len(block), np.nan)
        valid = block.flags == 0
        received = (block.flags & Flag.MISSING) == 0
        rows = [np.where(received, block.time_s, nan), np.ones(len(block))]
        rows += [np.where(block.flags & flag, 1.0, nan) for flag in FLAGS]
        for channel in self.channels:
            estimate = np.where(valid, block.estimates.get(channel, nan), nan)
            sensor = np.where(valid, block.columns.get(channel, nan), nan)
            estimate = np.where(block.inside.get(channel, valid), estimate, nan)
            rows += [estimate, sensor, (estimate - sensor) ** 2]
        return np.stack(rows)

    def _squared_error_of(self, block: SampleBlock) -> FloatArray:
        """Return the squared error of the main estimate, outside its range too, shape (n,)."""
        main, nan = self.channels[0], np.full(len(block), np.nan)
        error = block.estimates.get(main, nan) - block.columns.get(main, nan)
        return np.where(block.flags == 0, error**2, nan)

    def snapshot(self) -> Snapshot:
        """Return the picture of now."""
        last = self._last
        return Snapshot(
            time_s=self._time_s,
            samples=self._samples,
            lost=last.lost if last is not None else 0,
            sample_rate_hz=self._sample_rate_hz(),
            flagged=_named(self._window.count[FIRST_FLAG:FIRST_CHANNEL].sum(axis=1)),
            readings=tuple(self._reading(index) for index in range(len(self.channels))),
            devices=last.devices if last is not None else (),
            limits=last.limits if last is not None else (),
        )

    def summary(self, ended: str) -> Summary:
        """Return the summary since the start; `ended` is the reason of the end."""
        n, known = self._error_samples, self._inside_samples
        return Summary(
            ended=ended,
            duration_s=self._duration_s,
            samples=self._samples,
            lost=self._last.lost if self._last is not None else 0,
            flagged=_named(self._flagged),
            channel=self.channels[0],
            error_rms=math.sqrt(self._squared_error / n) if n else None,
            error_samples=n,
            inside_rms=math.sqrt(self._inside_squared / known) if known else None,
            inside_samples=known,
        )

    def _sample_rate_hz(self) -> float | None:
        part = self._window.recent(RATE_S)
        received = int(self._window.count[RECEIVED, part].sum())
        if received < 2:
            return None
        first_s = np.nanmin(self._window.low[RECEIVED, part])
        last_s = np.nanmax(self._window.high[RECEIVED, part])
        return float((received - 1) / (last_s - first_s))

    def _reading(self, index: int) -> Reading:
        channel = self.channels[index]
        row = FIRST_CHANNEL + 3 * index
        window = self._window
        part = window.recent(ERROR_S)
        has_range = self._last is not None and channel in self._last.inside
        beyond = "outside what it was fitted on" if has_range else "not a number"
        errors = int(window.count[row + SQUARED_ERROR, part].sum())
        squared = float(window.total[row + SQUARED_ERROR, part].sum())
        return Reading(
            channel=channel,
            unit=unit_of(channel),
            has_estimator=channel in self._estimated,
            estimate=self._value(
                row + ESTIMATE, "" if channel in self._estimated else "no estimator", beyond
            ),
            sensor=self._value(row + SENSOR, "" if channel in self._sensed else "no sensor"),
            error_rms=math.sqrt(squared / errors) if errors else None,
            estimate_trace=np.stack([window.low[row + ESTIMATE], window.high[row + ESTIMATE]]),
            sensor_trace=np.stack([window.low[row + SENSOR], window.high[row + SENSOR]]),
        )

    def _value(self, row: int, absent: str, otherwise: str = "not a number") -> Value:
        """Return the mean of the last 0.1 s, or why there is none.

        A mean over less than half of the samples would stand for the time when all was well, not
        for now, so it is not shown.
        """
        if self._time_s is None or self._silent >= SILENT_BLOCKS:
            return Value(None, "no samples arriving")
        if absent:
            return Value(None, absent)
        part = self._window.recent(VALUE_S)
        rows = int(self._window.count[ROWS, part].sum())
        usable = int(self._window.count[row, part].sum())
        if 2 * usable >= rows:
            return Value(float(self._window.total[row, part].sum()) / usable)
        seen = _named(self._window.count[FIRST_FLAG:FIRST_CHANNEL, part].sum(axis=1))
        return Value(None, ", ".join(seen) or otherwise)


def _named(counts: NDArray[np.int64]) -> dict[str, int]:
    """Return the flags that were seen, by name, most frequent first."""
    seen = {str(f.name).lower(): int(n) for f, n in zip(FLAGS, counts, strict=True) if n}
    return dict(sorted(seen.items(), key=lambda item: -item[1]))
