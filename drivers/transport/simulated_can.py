"""CAN buses with the fakes that sit on them: one inside this process in virtual time, one live.

Virtual time passes only while someone reads. Every node hears every other node's frames, and its
own not.

Not modelled: arbitration, the time of a frame on the wire, and a bus that is full.
"""

import time
from collections import deque
from collections.abc import Sequence
from typing import Protocol

from drivers.transport.can_bus import CanBus, CanCounters, CanFrame
from drivers.transport.transport import HostLink

TICK_S = 1e-3


class CanNode(Protocol):
    """A simulated node with frames and ticks of 1 ms: a fake, or the firmware itself."""

    def receive(self, frame: CanFrame) -> None:
        """Take a frame from the bus."""

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass."""

    def transmit(self) -> list[CanFrame]:
        """Give the frames to be sent."""


class SimulatedCanBus(HostLink):
    """The host's place on a bus of nodes in this process."""

    def __init__(self, nodes: Sequence[CanNode], url: str = "sim://can") -> None:
        super().__init__(url)
        self._nodes = list(nodes)
        self._ticks = 0
        self._waiting: deque[CanFrame] = deque()
        self.counters = CanCounters()

    @property
    def now_s(self) -> float:
        """Virtual seconds since the bus was made."""
        return self._ticks * TICK_S

    def send(self, frame: CanFrame) -> None:
        """Hand a frame to every node."""
        self._require_link()
        for node in self._nodes:
            node.receive(frame)
        self._exchange()

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, letting time pass until there is one or `timeout_s` is over."""
        self._require_link()
        self._exchange()
        # a wait, however short, lets time pass: a caller that waits for a moment must get there
        remaining = max(1, round(timeout_s / TICK_S)) if timeout_s > 0 else 0
        while not self._waiting and remaining > 0:
            for node in self._nodes:
                node.advance(1)
            self._ticks += 1
            remaining -= 1
            self._exchange()
        return self._waiting.popleft() if self._waiting else None

    def _exchange(self) -> None:
        sent = [(node, frame) for node in self._nodes for frame in node.transmit()]
        while sent:
            for sender, frame in sent:
                self._waiting.append(frame)
                for node in self._nodes:
                    if node is not sender:
                        node.receive(frame)
            sent = [(node, frame) for node in self._nodes for frame in node.transmit()]


class LiveCanBus:
    """The host's place on a bus of python-can whose other nodes are fakes, in real time.

    They are served by whoever waits on the bus, in ticks by the wall clock. After a delay of this
    computer the ticks that are due follow one another at once, as a firmware process on a
    pseudo-terminal does it: the fakes' world is late then, and nothing in it is lost or torn.
    """

    def __init__(self, bus: CanBus, theirs: CanBus, nodes: Sequence[CanNode]) -> None:
        self.url = bus.url
        self.counters = bus.counters
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
