"""A bad CAN cable: the faults of `drivers.transport.faulty` on the frames a device sends.

A frame is hit as a whole: CAN's own checksum throws a damaged one away.
"""

from drivers.errors import LinkLostError
from drivers.transport.can_bus import CanBus, CanCounters, CanFrame
from drivers.transport.faulty import Faults


def _at_least_an_instant(wait_s: float) -> float:
    """Return a time to wait, 0 where it is but the rounding of a sum."""
    return wait_s if wait_s > 1e-9 else 0.0


class FaultyCanBus:
    """Any bus behind a bad cable.

    Args:
        inner: The bus.
        faults: The faults that strike; more can be injected at any time.
    """

    def __init__(self, inner: CanBus, faults: Faults | None = None) -> None:
        self._inner = inner
        self.faults = faults or Faults()
        self._held: list[tuple[float, bytes]] = []

    @property
    def url(self) -> str:
        """The URL of the inner bus."""
        return self._inner.url

    @property
    def now_s(self) -> float:
        """The clock of the inner bus, seconds."""
        return self._inner.now_s

    @property
    def counters(self) -> CanCounters:
        """The inner bus's counters."""
        return self._inner.counters

    def send(self, frame: CanFrame) -> None:
        """Send a frame."""
        self._require_link()
        self._inner.send(frame)

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame that gets through, waiting at most `timeout_s` for it."""
        give_up_s = self.now_s + timeout_s
        while True:
            self._require_link()
            due = self._due()
            if due is not None:
                return due
            remaining_s = _at_least_an_instant(give_up_s - self.now_s)
            next_due_s = min((due_s for due_s, _ in self._held), default=float("inf"))
            wait_s = min(remaining_s, _at_least_an_instant(next_due_s - self.now_s))
            frame = self._inner.read(wait_s)
            if frame is not None:
                self._held += self.faults.pass_on(frame.to_bytes(), self.now_s, whole=True)
            elif remaining_s <= 0.0:
                self._require_link()
                return self._due()

    def close(self) -> None:
        """Close the inner bus."""
        self._inner.close()

    def _due(self) -> CanFrame | None:
        now_s = self.now_s
        if now_s < self.faults.stalled_until_s(now_s):
            return None
        for entry in self._held:
            if _at_least_an_instant(entry[0] - now_s) == 0.0:
                self._held.remove(entry)
                return CanFrame.from_bytes(entry[1])
        return None

    def _require_link(self) -> None:
        if self.faults.disconnected:
            self._inner.close()
            raise LinkLostError(
                f"The link to {self.url} is gone.",
                "The adapter was unplugged.",
                "Check the cable and start again.",
            )
