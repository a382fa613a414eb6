"""A Net F/T that takes and gives the bytes a real one would, a slow sine on every axis.

Not modelled: the network's delays, buffered mode, and the web page.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.ati_net import protocol
from drivers.ati_net.driver import AtiNet
from drivers.ati_net.protocol import Calibration
from drivers.device import Device
from drivers.errors import FrameError
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport
from drivers.transport.transport import Transport

NEWTON_AND_NEWTON_METRE = Calibration(2, 3, 1_000_000, 1_000_000)


class RdtFake:
    """The UDP side, 1000 records a second, with `drivers.transport.simulated.Board`'s interface.

    `transmit` gives one datagram at a time.
    """

    def __init__(self, first_sequence: int = 1) -> None:
        self._first = first_sequence
        self._sequence = first_sequence
        self._ticks = 0
        self._left = 0
        self._out: list[bytes] = []
        self.status = 0
        self.bias = np.zeros(6, np.int64)
        self.frozen_at: int | None = None
        """Internal sample that is repeated for ever; None while the sensor works."""
        self.deaf = 0
        """Requests that get lost on their way."""

    def receive(self, data: bytes) -> None:
        """Carry out a request; anything else is not answered."""
        if self.deaf:
            self.deaf -= 1
            return
        try:
            command, samples = protocol.decode_command(data)
        except FrameError:
            return
        if command == protocol.STOP:
            self._left = 0
        elif command == protocol.STREAM:
            self._sequence = self._first
            self._left = samples or -1
        elif command == protocol.SET_BIAS:
            self._left = 0  # a command replaces the one that runs
            self.bias = self.load(self._ticks)
        elif command == protocol.RESET_LATCH:
            self._left = 0
            self.status &= ~(protocol.LATCHED | protocol.SUMMARY)

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass; while it streams, records are made."""
        for _ in range(ticks):
            self._ticks += 1
            if self._left:
                self._left -= 1
                self._out.append(self._record())

    def transmit(self) -> bytes:
        """Give the next datagram."""
        return self._out.pop(0) if self._out else b""

    def load(self, tick: int) -> NDArray[np.int64]:
        """Return the counts of the six axes at a tick, int64, shape (6,)."""
        size = np.array([20.0, 10.0, 40.0, 0.5, 0.4, 0.3]) * 1e6
        counts: NDArray[np.int64] = np.round(size * np.sin(2 * np.pi * tick / 1000)).astype(
            np.int64
        )
        return counts

    def _record(self) -> bytes:
        taken = self._ticks if self.frozen_at is None else self.frozen_at
        counts = self.load(taken) - self.bias
        record = np.array(
            (self._sequence, taken * 7 % 2**32, self.status, counts), protocol.RECORD_DTYPE
        )
        self._sequence = (self._sequence + 1) % 2**32
        return record.tobytes()


class CalibrationFake(Outbox):
    """The TCP side, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(self, calibration: Calibration = NEWTON_AND_NEWTON_METRE) -> None:
        super().__init__()
        self._calibration = calibration
        self._in = b""

    def receive(self, data: bytes) -> None:
        """Answer a whole request."""
        self._in += data
        if self._in == protocol.READ_CALIBRATION:
            self._in = b""
            self._out += protocol.encode_calibration(self._calibration)


def fake_calibration() -> Transport:
    """Return the way to the TCP side of a fake."""
    return SimulatedTransport(CalibrationFake(), "sim://ati-net/calibration")


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a network with faults."""
    rdt = SimulatedTransport(RdtFake(), "sim://ati-net")
    return AtiNet(FaultyTransport(rdt, faults, packets=True), fake_calibration)
