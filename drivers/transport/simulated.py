"""A board inside this process, in virtual time.

Time passes only during a read: `read` advances the board. Nothing sleeps unless a pace is
requested, so a session is repeatable and as fast as the board computes.

Not modelled: the time bytes take on the wire, and a host that is late (see the faults of a board's
own tests for lost and damaged bytes).
"""

from time import monotonic, sleep
from typing import Protocol

from drivers.transport.transport import HostLink

TICK_S = 1e-3
"""Default tick of a board."""


class Board(Protocol):
    """A simulated board with bytes and ticks: a fake or the firmware itself."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""

    def advance(self, ticks: int) -> None:
        """Let that many of its ticks pass."""

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""


class Outbox:
    """A fake that sends: bytes that wait for the host, and a world that stands still."""

    def __init__(self) -> None:
        self._out = bytearray()

    def advance(self, ticks: int) -> None:
        """Let that many ticks pass: nothing happens by itself."""

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""
        data = bytes(self._out)
        self._out.clear()
        return data


class Pace:
    """Keeps a simulated device from running ahead of a person who watches.

    It is simulated seconds a real second; None for as fast as possible.
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
        early_s = began_s + (now_s - first_s) / self._pace - monotonic()
        if early_s > 0:
            sleep(early_s)


class SimulatedTransport(HostLink):
    """A transport to a board in this process, of a tick in s; see also `Pace`.

    `step_s` is the longest virtual time between looks at the board's output.
    """

    def __init__(
        self,
        board: Board,
        url: str = "sim://",
        step_s: float = 0.05,
        pace: float | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__(url)
        self.board = board
        self._tick_s = tick_s
        self._step_ticks = max(1, round(step_s / tick_s))
        self._pace = Pace(pace)
        self._ticks = 0

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
            self._pace.keep(self.now_s)
            data = self.board.transmit()
        return data

    def write(self, data: bytes) -> None:
        """Hand `data` to the board."""
        self._require_link()
        self.board.receive(data)
