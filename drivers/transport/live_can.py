"""Fakes on a CAN bus at the pace of real time, served by whoever waits on the bus; no thread.

Their clock goes in ticks of 1 ms, by the wall clock. After a delay of this computer the ticks that
are due follow one another at once, as a firmware process on a pseudo-terminal does it: the fakes'
world is late then, and nothing in it is lost or torn.
"""

import time
from collections.abc import Sequence

from drivers.transport.can_bus import CanBus, CanFrame
from drivers.transport.simulated_can import TICK_S, CanNode


class LiveCanBus:
    """The host's place on a bus of python-can whose other nodes are fakes."""

    def __init__(self, bus: CanBus, theirs: CanBus, nodes: Sequence[CanNode]) -> None:
        self.url = bus.url
        self.counters = bus.counters
        """Counters of the bus."""
        self._bus = bus
        self._theirs = theirs
        self._nodes = list(nodes)
        self._began_s = bus.now_s
        self._ticks = 0
        self._answer()  # that they have booted

    @property
    def now_s(self) -> float:
        """The host's monotonic clock at the newest tick, seconds."""
        return self._began_s + self._ticks * TICK_S

    def send(self, frame: CanFrame) -> None:
        """Send a frame; the nodes take it at once."""
        self._bus.send(frame)
        while (heard := self._theirs.read(0.0)) is not None:
            for node in self._nodes:
                node.receive(heard)
        self._answer()

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, letting time pass until there is one or `timeout_s` is over."""
        remaining = max(1, round(timeout_s / TICK_S)) if timeout_s > 0 else 0
        while True:
            frame = self._bus.read(0.0)
            if frame is not None or remaining == 0:
                return frame
            self._tick()
            remaining -= 1

    def close(self) -> None:
        """Let go of both places."""
        self._bus.close()
        self._theirs.close()

    def _tick(self) -> None:
        self._ticks += 1
        early_s = self.now_s - self._bus.now_s
        if early_s > 0:
            time.sleep(early_s)
        for node in self._nodes:
            node.advance(1)
        self._answer()

    def _answer(self) -> None:
        for node in self._nodes:
            for answer in node.transmit():
                self._theirs.send(answer)
