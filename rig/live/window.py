"""The last seconds of several signals, reduced to one count, sum and range for each time bin."""

import numpy as np
from numpy.typing import NDArray

from rig.live.block import FloatArray


class Window:
    """Bins of equal device time, the newest last; memory does not grow.

    Every array has shape (signals, bins). A value that is not finite counts as not there.

    Attributes:
        count: Values in each bin.
        total: Their sum.
        low: The least of them, NaN in a bin without any.
        high: The greatest of them, NaN in a bin without any.
    """

    def __init__(self, signals: int, span_s: float, bin_s: float) -> None:
        """Make an empty window.

        Args:
            signals: Number of signals.
            span_s: Time the window reaches back, s.
            bin_s: Width of a bin, s.
        """
        self._bin_s = bin_s
        self._shape = signals, round(span_s / bin_s)
        self.clear()

    def clear(self) -> None:
        """Forget everything, as when the device clock restarts."""
        self._newest: int | None = None
        self.count: NDArray[np.int64] = np.zeros(self._shape, np.int64)
        self.total: FloatArray = np.zeros(self._shape)
        self.low: FloatArray = np.full(self._shape, np.nan)
        self.high: FloatArray = np.full(self._shape, np.nan)

    def recent(self, span_s: float) -> slice:
        """Return the bins of the last span_s seconds, to index the second axis with."""
        return slice(-max(1, round(span_s / self._bin_s)), None)

    def add(self, time_s: FloatArray, values: FloatArray) -> None:
        """Add samples that are newer than all before them.

        Args:
            time_s: Device time, shape (n,), increasing, n at least 1.
            values: Shape (signals, n); NaN without a value.
        """
        bin_of = np.floor(time_s / self._bin_s).astype(np.int64)
        newest = int(bin_of[-1])
        self._advance(newest)
        column = bin_of - newest + self._shape[1] - 1
        inside = column >= 0
        column, values = column[inside], values[:, inside]
        starts = np.flatnonzero(np.diff(column, prepend=column[0] - 1))
        into = column[starts]
        present = np.isfinite(values)
        zeroed, blanked = np.where(present, values, 0.0), np.where(present, values, np.nan)
        self.count[:, into] += np.add.reduceat(present, starts, axis=1, dtype=np.int64)
        self.total[:, into] += np.add.reduceat(zeroed, starts, axis=1)
        lows, highs = (f.reduceat(blanked, starts, axis=1) for f in (np.fmin, np.fmax))
        self.low[:, into] = np.fmin(self.low[:, into], lows)
        self.high[:, into] = np.fmax(self.high[:, into], highs)

    def _advance(self, newest: int) -> None:
        """Move the bins along so that the last one is the newest."""
        steps = 0 if self._newest is None else newest - self._newest
        if steps >= self._shape[1]:
            self.clear()
        elif steps > 0:
            blanks = ((self.count, 0), (self.total, 0.0), (self.low, np.nan), (self.high, np.nan))
            for array, blank in blanks:
                array[:, :-steps] = array[:, steps:].copy()
                array[:, -steps:] = blank
        self._newest = newest
