"""The steady rate of a device that must be asked for every sample."""

from drivers.counters import DeviceCounters


class PollSchedule:
    """When the next question is due, and the numbers of those that brought no sample.

    Args:
        rate_hz: Questions a second.
        counters: Counters of gaps and lost samples.
    """

    def __init__(self, rate_hz: float, counters: DeviceCounters) -> None:
        self._period_s = 1.0 / rate_hz
        self._counters = counters
        self._began_s = 0.0
        self.asked = 0
        """Number of the next question, and so of its sample."""
        self.lost = 0
        """Questions since `restart` that brought no sample."""

    def restart(self, now_s: float) -> None:
        """Number the questions from 0, the first being due now."""
        self._began_s = now_s
        self.asked = self.lost = 0

    def wait_s(self, now_s: float) -> float:
        """Return the time until the next question is due, 0 when it is."""
        wait_s = self._began_s + self.asked * self._period_s - now_s
        return wait_s if wait_s > 1e-9 else 0.0

    def skip_missed(self, now_s: float) -> None:
        """Count the questions for which the caller came too late as lost."""
        missed = int((now_s - self._began_s) / self._period_s + 1e-6) - self.asked
        if missed > 0:
            self.lose(missed)

    def lose(self, samples: int = 1) -> None:
        """Count questions that brought no sample."""
        self.asked += samples
        self.lost += samples
        self._counters.gaps += 1
        self._counters.lost += samples
