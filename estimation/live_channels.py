"""Filtered and derived channels as they come live, in batches of any size."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from estimation.derived import (
    CAMPAIGN_TIME,
    CLOCKS,
    derive,
    differentiated_from,
    looks_back,
    measured_channels,
    window_samples,
)
from estimation.filters import PAPER, CausalFilter, LowPass, fill_gaps
from estimation.kalman import tracker
from estimation.recording import FloatArray, Recording
from estimation.signals import Signals, reference


class CausalChannels:
    """Filtered and derived channels as they come live, in batches of any size.

    Lost samples are interpolated linearly when the next one arrives; after a gap of more than
    `LONGEST_GAP_S` the filter restarts. A sample in which a needed channel is not
    finite counts as lost, and its derived values are NaN. The result does not depend on how the
    samples are cut into batches.

    Speeds and accelerations are backward differences of the filtered angle; `tracked` ones come
    from the angle as it was measured, by the Kalman filter of `estimation.kalman`, with less lag.
    """

    LONGEST_GAP_S = 0.25

    def __init__(
        self,
        names: Iterable[str],
        sample_rate_hz: float,
        low_pass: LowPass = PAPER,
        tracked: bool = False,
        signals: Signals | None = None,
    ) -> None:
        self.names = tuple(dict.fromkeys(names))
        self._signals = signals or reference()
        wanted = [name for name in self.names if name not in CLOCKS]
        self.measured = measured_channels(wanted, self._signals)
        self._rate_hz = sample_rate_hz
        self._filter = CausalFilter(sample_rate_hz, low_pass)
        self._first_time_s: float | None = None
        self._last_time_s: float | None = None
        self._last_row: FloatArray = np.empty(0)
        self._kept = max(2, window_samples(sample_rate_hz) if looks_back(self.names) else 0)
        self._history: FloatArray = np.empty((0, 0))  # the last filtered rows
        moving = differentiated_from(self.names)
        angles = [name for name in self.measured if tracked and name.endswith("_angle_rad")]
        self._tracked = {name: self.measured.index(name) for name in angles if name in moving}
        self._tracker = tracker(sample_rate_hz) if self._tracked else None
        self._motion: dict[str, FloatArray] = {}  # the last angles, speeds and accelerations

    def step(self, time_s: ArrayLike, measured: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        """Take the next samples and return the channels for them, NaN where a needed value is lost.

        Times increase across batches. Measured channels are in SI units, others are ignored;
        campaign time may be among them, else it counts from the first sample. All are of shape
        (n,).
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        columns = [np.atleast_1d(np.asarray(measured[n], np.float64)) for n in self.measured]
        rows = np.column_stack(columns) if columns else np.empty((len(time), 0))
        channels = {name: np.full(len(time), np.nan) for name in self.names}
        good = np.flatnonzero(np.isfinite(rows).all(axis=1))
        for part in self._unbroken(time, good):
            for name, values in self._advance(time[part], rows[part]).items():
                channels[name][part] = values
        if CAMPAIGN_TIME in self.names and time.size:
            if self._first_time_s is None:
                self._first_time_s = float(time[0])
            since = np.atleast_1d(measured.get(CAMPAIGN_TIME, time - self._first_time_s))
            channels[CAMPAIGN_TIME] = np.asarray(since, np.float64)
        return channels

    def _unbroken(self, time: FloatArray, good: np.ndarray) -> list[np.ndarray]:
        """Cut the samples where the silence before them was too long."""
        if good.size == 0:
            return []
        before = time[good[0]] if self._last_time_s is None else self._last_time_s
        silence = np.diff(time[good], prepend=before)
        parts = np.split(good, np.flatnonzero(silence > self.LONGEST_GAP_S))
        return [part for part in parts if part.size]

    def _advance(self, time: FloatArray, rows: FloatArray) -> dict[str, FloatArray]:
        last_time_s, last_row, first = self._last_time_s, self._last_row, False
        if last_time_s is None or time[0] - last_time_s > self.LONGEST_GAP_S:
            self._filter.restart()
            last_time_s, last_row, first = time[0] - 1.0 / self._rate_hz, rows[0], True
        steps = np.rint(np.diff(time, prepend=last_time_s) * self._rate_hz)
        ticks = np.concatenate([[0], np.cumsum(np.maximum(steps, 1))]).astype(np.int64)
        filled = fill_gaps(ticks, np.vstack([last_row, rows]))[1:]
        filtered = self._filter.step(filled)
        if first:
            self._history = np.repeat(filtered[:1], self._kept, axis=0)
        lined = np.vstack([self._history, filtered])
        self._history = lined[-self._kept :]
        self._last_row, self._last_time_s = rows[-1], float(time[-1])
        derived = derive(
            dict(zip(self.measured, lined.T, strict=True)),
            [name for name in self.names if name not in CLOCKS],
            self._rate_hz,
            self._backward,
            self._signals,
            self._track(filled, first),
        )
        at = ticks[1:] + self._kept - 1  # tick 1 is the first row after the history
        channels = {name: values[at] for name, values in derived.items()}
        return {**channels, "time_s": time} if "time_s" in self.names else channels

    def _track(self, filled: FloatArray, first: bool) -> dict[str, FloatArray]:
        """Return angle, speed and acceleration of tracked angles, the history before them."""
        if self._tracker is None:
            return {}
        found = {}
        for name, column in self._tracked.items():
            angles = filled[:, column]
            if first:
                self._motion[name] = np.tile(self._tracker.start(angles[0]), (self._kept, 1))
            before = self._motion[name]
            moved = self._tracker.track(angles, before[-1].copy())
            found[name] = np.vstack([before, moved])
            self._motion[name] = found[name][-self._kept :]
        return found

    def _backward(self, values: FloatArray) -> FloatArray:
        # the first value is made of one sample too few, and is never handed out
        return np.diff(values, prepend=values[:1]) * self._rate_hz


def causal_channels(
    recording: Recording,
    names: Iterable[str],
    low_pass: LowPass = PAPER,
    tracked: bool = False,
    signals: Signals | None = None,
) -> Recording:
    """Return a recording of the named channels as they would have come live, see `CausalChannels`.

    Raises:
        MissingChannelError: A measured channel is not in the recording.
    """
    wanted = [name for name in dict.fromkeys(names) if name != "time_s"]
    source = CausalChannels(wanted, recording.sample_rate_hz, low_pass, tracked, signals)
    clocks = [name for name in wanted if name == CAMPAIGN_TIME]
    measured = {name: recording[name] for name in (*source.measured, *clocks)}
    return replace(recording, columns=source.step(recording.time_s, measured))
