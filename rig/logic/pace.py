"""The pace of simulated time."""

from time import monotonic, sleep


class Pace:
    """Keeps a simulated device from running ahead of a person who watches.

    Args:
        pace: Simulated seconds a real second; None for as fast as possible.
    """

    def __init__(self, pace: float | None) -> None:
        self._pace = pace
        self._from: tuple[float, float] | None = None

    def keep(self, now_s: float) -> None:
        """Wait until the simulated time is due."""
        if self._pace is None:
            return
        if self._from is None:
            self._from = (monotonic(), now_s)
        began_s, first_s = self._from
        sleep(max(0.0, began_s + (now_s - first_s) / self._pace - monotonic()))
