"""A board inside this process, in virtual time.

Time passes only during a read: `read` advances the board. Nothing sleeps unless a pace is
requested, so a session is repeatable and as fast as the board computes.

Not modelled: the time bytes take on the wire, and a host that is late (see the faults of a board's
own tests for lost and damaged bytes).
"""

from time import monotonic, sleep
from typing import Protocol

from drivers.errors import LinkLostError

TICK_S = 1e-3
"""Default tick of a board."""


class Board(Protocol):
    """A simulated board with bytes and ticks: a fake or the firmware itself."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        ...

    def advance(self, ticks: int) -> None:
        """Let that many of its ticks pass."""
        ...

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""
        ...


class SimulatedTransport:
    """A transport to a board in this process.

    Args:
        board: The board.
        url: Name for messages.
        step_s: Longest virtual time between looks at the board's output.
        pace: Virtual seconds a real second, None for as fast as possible.
        tick_s: A tick of the board, s.
    """

    def __init__(
        self,
        board: Board,
        url: str = "sim://",
        step_s: float = 0.05,
        pace: float | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        self.board = board
        self._tick_s = tick_s
        self._url = url
        self._step_ticks = max(1, round(step_s / tick_s))
        self._pace = pace
        self._ticks = 0
        self._closed = False
        self._paced_from: tuple[float, int] | None = None

    @property
    def url(self) -> str:
        """The URL the transport was opened by."""
        return self._url

    @property
    def now_s(self) -> float:
        """Virtual seconds since the board was made."""
        return self._ticks * self._tick_s

    def read(self, timeout_s: float) -> bytes:
        """Return the board's bytes, advancing it until there are some or `timeout_s` has passed."""
        self._require_link()
        # a wait, however short, lets time pass: a caller that waits for a moment must get there
        remaining = max(1, round(timeout_s / self._tick_s)) if timeout_s > 0 else 0
        data = self.board.transmit()
        while not data and remaining > 0:
            ticks = min(self._step_ticks, remaining)
            self.board.advance(ticks)
            self._ticks += ticks
            remaining -= ticks
            self._keep_pace()
            data = self.board.transmit()
        return data

    def write(self, data: bytes) -> None:
        """Hand `data` to the board."""
        self._require_link()
        self.board.receive(data)

    def close(self) -> None:
        """Let go of the board; its time stands still."""
        self._closed = True

    def _require_link(self) -> None:
        if self._closed:
            raise LinkLostError(f"{self._url} is closed.")

    def _keep_pace(self) -> None:
        if self._pace is None:
            return
        if self._paced_from is None:
            self._paced_from = (monotonic(), self._ticks)
        began_s, ticks = self._paced_from
        late_s = monotonic() - began_s - (self._ticks - ticks) * self._tick_s / self._pace
        if late_s < 0:
            sleep(-late_s)
