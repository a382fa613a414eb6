"""A USB520 that sends the lines a real one would, a slow sine on its sensor.

Not modelled: the time bytes take on the wire, and the binary mode.
"""

import math

from drivers.device import Device
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport
from drivers.usb520 import protocol
from drivers.usb520.driver import Usb520

LINE_TICKS = 100
"""Milliseconds between lines."""


class Usb520Fake(Outbox):
    """An amplifier, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(self, unit: str = "N-m") -> None:
        super().__init__()
        self.unit = unit
        self._ticks = 0

    def receive(self, data: bytes) -> None:
        """Take bytes from the host; in this mode it heeds none."""

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass."""
        first = self._ticks // LINE_TICKS + 1
        self._ticks += ticks
        for line in range(first, self._ticks // LINE_TICKS + 1):
            self._out += protocol.encode_line(0.8 * math.sin(0.2 * line), self.unit)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake amplifier behind a cable with faults."""
    return Usb520(FaultyTransport(SimulatedTransport(Usb520Fake(), "sim://usb520"), faults))
