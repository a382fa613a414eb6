"""Device clocks on one time base: a line from device time to host time, fitted as exchanges come.

An exchange is a question for the device's clock: sent and answered at known host times. The device
read its clock somewhere in between, so the middle is wrong by at most half the round trip; the
exchanges with short round trips are the good ones. `ClockFit` keeps the recent exchanges, sets
aside those with long round trips and those far off the line, and fits offset and rate by least
squares.
The idea is that of D. Mills' NTP and of Klipper's clock synchronisation; the code is neither's.

For a device that only streams, `arrival_fit` makes a line of sequence numbers and arrival times:
nothing arrives before it was sent, so the earliest arrivals carry the line.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError

WRAP_US = 2**32
"""A device's microsecond counter wraps after 71.6 minutes."""
KEPT, SPACING_S = 240, 0.25
"""Exchanges that a fit keeps, a minute of them: of each so long a stretch, s, the one with the
shortest round trip."""
MAX_DRIFT = 200e-6
"""Largest difference of rates that is a crystal's and not a reset; crystals are within 50e-6."""
RESET_S = 0.05
"""A clock further off the line than this, and than half the round trip, has restarted."""

OFF_LINE = 6.0
"""An exchange this many times the median distance off the line is an outlier."""
RESOLUTION_S = 2e-6
"""Exchanges this close to the line are always part of it; the counter's step is 1e-6."""


class ClockError(DriverError):
    """Too little is known of a device's clock."""


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Host time as a line in device time, and how well it fits.

    Attributes:
        device_s: A device time on the line, s.
        host_s: The host time there, s.
        rate: Host seconds a device second.
        residual_s: Root mean square distance of the exchanges used from the line, s.
        exchanges: Exchanges used.
    """

    device_s: float
    host_s: float
    rate: float
    residual_s: float
    exchanges: int

    def to_host(self, device_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the host times of device times, s."""
        return self.host_s + (device_s - self.device_s) * self.rate

    def to_device(self, host_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the device times of host times, s."""
        return self.device_s + (host_s - self.host_s) / self.rate


class ClockFit:
    """The line from one device's clock to the host's, kept up to date."""

    def __init__(self) -> None:
        self._newest_us: int | None = None
        self._exchanges: deque[tuple[float, float, float]] = deque(maxlen=KEPT)
        self._strange = 0
        self._last_sent_s = float("-inf")
        self.rejected = 0
        """Exchanges set aside: no running clock can have given them."""
        self.resets = 0
        """Number of restarts of the device's clock."""
        self._line: ClockLine | None = None

    def add(self, sent_s: float, received_s: float, tick_us: int) -> None:
        """Take an exchange: question left, answer read, device clock in between modulo 2^32.

        One that was taken before is ignored.

        Raises:
            ClockError: The answer is older than the question.
        """
        if not received_s >= sent_s:
            raise ClockError(f"An answer at {received_s} s has a question at {sent_s} s.")
        if sent_s <= self._last_sent_s:
            return
        self._last_sent_s = sent_s
        device_s = self._unwrapped_s(tick_us)
        if self._exchanges and not self._possible(sent_s, received_s, device_s):
            self._strange += 1
            self.rejected += 1
            if self._strange < 2:
                return  # one may be damage; a second is a restarted clock
            self.resets += 1
            self._exchanges.clear()
            self._newest_us = None
            device_s = self._unwrapped_s(tick_us)
        self._strange = 0
        self._keep(sent_s, received_s, device_s)

    @property
    def line(self) -> ClockLine:
        """The line through the exchanges (`ClockError`: no exchange so far)."""
        if self._line is None:
            if not self._exchanges:
                raise ClockError(
                    "The device's clock is not known.", "It has not answered any question for it."
                )
            self._line = _fit(np.array(self._exchanges))
        return self._line

    def _unwrapped_s(self, tick_us: int) -> float:
        """Return a device time without the counter's wraps, less than half a wrap from the last."""
        if self._newest_us is None:
            self._newest_us = tick_us % WRAP_US
            return self._newest_us * 1e-6
        step = (tick_us - self._newest_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
        unwrapped = self._newest_us + step
        self._newest_us = max(self._newest_us, unwrapped)
        return unwrapped * 1e-6

    def _keep(self, sent_s: float, received_s: float, device_s: float) -> None:
        if self._exchanges:
            last_sent_s, last_received_s, _ = self._exchanges[-1]
            if sent_s // SPACING_S == last_sent_s // SPACING_S:
                if received_s - sent_s >= last_received_s - last_sent_s:
                    return
                self._exchanges.pop()
        self._exchanges.append((sent_s, received_s, device_s))
        self._line = None

    def _possible(self, sent_s: float, received_s: float, device_s: float) -> bool:
        last_sent_s, last_received_s, last_device_s = self._exchanges[-1]
        step_s = device_s - last_device_s
        slack_s = MAX_DRIFT * abs(step_s) + RESET_S
        return sent_s - last_received_s - slack_s <= step_s <= received_s - last_sent_s + slack_s


def _fit(exchanges: NDArray[np.float64]) -> ClockLine:
    """Fit the line to exchanges, shape (n, 3): sent, received, device time, all s."""
    sent_s, received_s, device_s = exchanges.T
    trip_s = received_s - sent_s
    middle_s = (sent_s + received_s) / 2
    good = trip_s <= np.quantile(trip_s, 0.5) + 1e-9
    off_s = np.abs(_distance_from_middle_line(device_s, middle_s, good))
    good &= off_s <= max(OFF_LINE * float(np.median(off_s[good])), RESOLUTION_S)
    return _straight(device_s[good], middle_s[good])


def _distance_from_middle_line(
    device_s: NDArray[np.float64], host_s: NDArray[np.float64], good: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the distances from a line that outliers do not pull: the median of all slopes.

    Source: P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", Journal of
    the American Statistical Association 63, 1968.
    """
    skew = host_s - device_s
    first, second = np.triu_indices(int(good.sum()), 1)
    steps_s = device_s[good][second] - device_s[good][first]
    apart = steps_s > 0
    rises = (skew[good][second] - skew[good][first])[apart]
    drift = float(np.median(rises / steps_s[apart])) if apart.any() else 0.0
    rest = skew - drift * (device_s - device_s[0])
    return np.asarray(rest - np.median(rest[good]))


def _straight(device_s: NDArray[np.float64], host_s: NDArray[np.float64]) -> ClockLine:
    """Return the least-squares line, its rate no further from 1 than a crystal's can be."""
    device_mean_s, host_mean_s = float(device_s.mean()), float(host_s.mean())
    device = device_s - device_mean_s
    skew = host_s - host_mean_s - device
    spread = float(device @ device)
    drift = float(device @ skew) / spread if spread > 0 else 0.0
    drift = min(max(drift, -MAX_DRIFT), MAX_DRIFT)
    residual_s = float(np.sqrt(np.mean((skew - drift * device) ** 2)))
    return ClockLine(device_mean_s, host_mean_s, 1 + drift, residual_s, len(host_s))


def rising(times_s: NDArray[np.float64], after_s: float, step_s: float) -> NDArray[np.float64]:
    """Return times, shape (n,), each at least a step after the one before, the first `after_s`.

    A line that is fitted again moves; times by the new one may lie before those by the old. The
    step is below the true one, so that the times return to the line.
    """
    floor_s = step_s * np.arange(1, times_s.size + 1)
    ahead_s = np.maximum.accumulate(times_s - floor_s)
    return np.asarray(np.maximum(ahead_s, after_s) + floor_s)


def arrival_fit(
    sequence: NDArray[np.int64], arrived_s: NDArray[np.float64], rate_hz: float
) -> ClockLine:
    """Return the line from a stream's own time, `sequence / rate_hz`, to the host's.

    Samples that came in one burst all carry the burst's time: only the newest of each arrival time
    is used, and of those the earlier half relative to the line. The host time is late by the
    shortest delay of the link, which is not observable from arrivals alone. Numbers of samples rise
    and arrival times, s, do not fall; both have shape (n,).

    Raises:
        ClockError: Fewer than two arrivals.
    """
    newest = np.flatnonzero(np.diff(arrived_s, append=np.inf) > 0)
    if newest.size < 2:
        raise ClockError("One arrival makes no line.", "The stream has only begun.")
    device_s, host_s = sequence[newest] / rate_hz, arrived_s[newest]
    line = _straight(device_s, host_s)
    early = np.ones(newest.size, np.bool_)
    for _ in range(3):
        delay_s = host_s - line.to_host(device_s)
        early = delay_s <= np.median(delay_s[early])
        if early.sum() < 2:
            break
        line = _straight(device_s[early], host_s[early])
    return line
