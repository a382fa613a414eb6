"""A bad cable: faults on what a device sends, around any transport or bus, repeatable by a seed.

Time is the inner link's own, so that a fault that lasts takes no real time on a simulated one.
"""

import random
from collections import Counter, deque
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Generic, TypeVar

from drivers.errors import LinkLostError
from drivers.transport.can_bus import CanBus, CanFrame
from drivers.transport.transport import Transport

LONGEST_RUN = 16
"""Most bytes of a stream one fault takes, changes or repeats."""
Chunk = TypeVar("Chunk", bytes, CanFrame)
Tap = Callable[[bytes], bytes]
"""Changes bytes on their way; the returned bytes replace them."""


class Fault(StrEnum):
    """What can happen on the way from a device to the host."""

    DROP = "drop"
    """A run of bytes is missing; of packets, one is."""
    CORRUPT = "corrupt"
    """A run of bytes is changed; a packet is thrown away by its network's own checksum."""
    DUPLICATE = "duplicate"
    """A run of bytes comes twice; of packets, one does."""
    DELAY = "delay"
    """Bytes come late, and those behind them too; a late packet is overtaken."""
    STALL = "stall"
    """Nothing comes for a while, then all of it at once."""
    DISCONNECT = "disconnect"
    """The link is gone for good."""


class Faults:
    """Faults that wait to strike, and what each does to bytes.

    Places and values of damage are random. `rates` are, for long tests, the probabilities that a
    fault strikes a chunk by itself.
    """

    def __init__(self, seed: int = 0, rates: Mapping[Fault, float] | None = None) -> None:
        self._random = random.Random(seed)
        self._rates = dict(rates or {})
        self._waiting: deque[tuple[Fault, float]] = deque()
        self._stall_s: float | None = None
        self._stalled_until_s = float("-inf")
        self._held_until_s = float("-inf")
        self.disconnected = False
        """Whether the link has been cut."""
        self.struck: Counter[Fault] = Counter()
        """How often each fault has struck."""

    def inject(self, fault: Fault, count: int = 1, duration_s: float = 0.3) -> None:
        """Let a fault strike the next `count` chunks, in the order of the calls.

        A stall begins, and a disconnection happens, at the next look at the link. The duration is
        that of a delay or a stall.
        """
        if fault is Fault.DISCONNECT:
            self.disconnected = True
            self.struck[fault] += 1
        elif fault is Fault.STALL:
            self._stall_s = duration_s
        else:
            self._waiting.extend([(fault, duration_s)] * count)

    def pass_on(self, chunk: Chunk, now_s: float, whole: bool) -> list[tuple[float, Chunk]]:
        """Return a chunk with faults: pieces, each with the time from which it may be read.

        A packet is damaged as a `whole`, of a stream a run of bytes.
        """
        due_s = max(now_s, self.stalled_until_s(now_s))
        pieces = [chunk]
        overtaken = False
        for fault, duration_s in self._striking():
            self.struck[fault] += 1
            if fault is Fault.DELAY:
                due_s = max(due_s, now_s + duration_s)
                overtaken = whole
            elif fault is Fault.STALL:
                self._stall_s = duration_s
                due_s = max(due_s, self.stalled_until_s(now_s))
            elif fault is Fault.DISCONNECT:
                self.disconnected = True
            else:
                pieces = [part for piece in pieces for part in self._damage(fault, piece, whole)]
        if not overtaken:
            due_s = self._held_until_s = max(due_s, self._held_until_s)
        return [(due_s, piece) for piece in pieces if piece]

    def stalled_until_s(self, now_s: float) -> float:
        """Return the time until which nothing comes; a stall that waits begins now."""
        if self._stall_s is not None:
            self._stalled_until_s = now_s + self._stall_s
            self._stall_s = None
            self.struck[Fault.STALL] += 1
        return self._stalled_until_s

    def _striking(self) -> list[tuple[Fault, float]]:
        striking = [self._waiting.popleft()] if self._waiting else []
        for fault, rate in self._rates.items():
            if self._random.random() < rate:
                striking.append((fault, 0.3))
        return striking

    def _damage(self, fault: Fault, data: Chunk, whole: bool) -> list[Chunk]:
        if whole or isinstance(data, CanFrame):
            return [data, data] if fault is Fault.DUPLICATE else []
        size = self._random.randint(1, min(LONGEST_RUN, len(data)))
        first = self._random.randint(0, len(data) - size)
        run, before, behind = data[first : first + size], data[:first], data[first + size :]
        if fault is Fault.CORRUPT:
            changed = bytes(byte ^ self._random.randint(1, 255) for byte in run)
            return [before + changed + behind]
        return [before + behind if fault is Fault.DROP else before + run + run + behind]


class _Cable(Generic[Chunk]):
    """What comes through a bad cable, chunk by chunk, in the time of the link behind it."""

    _instant_s = 0.0
    """A wait up to this is the rounding of a sum, and none."""

    def __init__(self, inner: Transport | CanBus, faults: Faults | None, packets: bool) -> None:
        self.url = inner.url
        self.close = inner.close
        self.faults = faults or Faults()
        self._link = inner
        self._packets = packets
        self._held: list[tuple[float, Chunk]] = []
        self.incoming: Callable[[Chunk], Chunk] = unchanged
        self.outgoing: Callable[[Chunk], Chunk] = unchanged

    @property
    def now_s(self) -> float:
        """The clock of the inner link, seconds."""
        return self._link.now_s

    def _read(self, receive: Callable[[float], Chunk | None], timeout_s: float) -> list[Chunk]:
        """Return the chunks that are due, waiting at most `timeout_s` for the first."""
        give_up_s = self.now_s + timeout_s
        while True:
            self._require_link()
            due = self._due()
            if due:
                return due
            remaining_s = self._wait(give_up_s - self.now_s)
            next_due_s = min((due_s for due_s, _ in self._held), default=float("inf"))
            chunk = receive(min(remaining_s, self._wait(next_due_s - self.now_s)))
            if chunk:
                arrived = self.incoming(chunk)
                if arrived:
                    self._held += self.faults.pass_on(arrived, self.now_s, self._packets)
            elif remaining_s <= 0.0:
                self._require_link()
                return self._due()

    def _due(self) -> list[Chunk]:
        now_s = self.now_s
        if now_s < self.faults.stalled_until_s(now_s):
            return []
        due = [entry for entry in self._held if not self._wait(entry[0] - now_s)]
        if self._packets:
            due = due[:1]
        for entry in due:
            self._held.remove(entry)
        return [chunk for _, chunk in due]

    def _wait(self, wait_s: float) -> float:
        return wait_s if wait_s > self._instant_s else 0.0

    def _require_link(self) -> None:
        if self.faults.disconnected:
            self.close()
            raise LinkLostError(
                f"The link to {self.url} is gone.",
                "The device or its adapter was unplugged.",
                "Check the cable and start again.",
            )


class FaultyTransport(_Cable[bytes]):
    """Any transport behind a bad cable; with `packets` each read of it is one packet."""

    def __init__(
        self, inner: Transport, faults: Faults | None = None, packets: bool = False
    ) -> None:
        super().__init__(inner, faults, packets)
        self._inner = inner

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that get through, waiting at most `timeout_s` for the first."""
        return b"".join(self._read(self._inner.read, timeout_s))

    def write(self, data: bytes) -> None:
        """Send `data`, as far as the taps let it."""
        self._require_link()
        changed = self.outgoing(data)
        if changed:
            self._inner.write(changed)


class FaultyCanBus(_Cable[CanFrame]):
    """Any bus behind a bad cable. A frame is hit as a whole: CAN's checksum drops a damaged one."""

    _instant_s = 1e-9

    def __init__(self, inner: CanBus, faults: Faults | None = None) -> None:
        super().__init__(inner, faults, packets=True)
        self._inner = inner
        self.counters = inner.counters

    def send(self, frame: CanFrame) -> None:
        """Send a frame."""
        self._require_link()
        self._inner.send(self.outgoing(frame))

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame that gets through, waiting at most `timeout_s` for it."""
        return next(iter(self._read(self._inner.read, timeout_s)), None)


def unchanged(chunk: Chunk) -> Chunk:
    """Let a chunk pass as it is."""
    return chunk
