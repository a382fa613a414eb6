"""An FT 300 that takes and gives the bytes a real one would, a slow sine on each axis.

Each write of the host is taken for one message. Not modelled: the time bytes take, registers
without a use here, and noise.
"""

import struct

import numpy as np

from drivers.device import Device
from drivers.errors import FrameError
from drivers.ft300 import protocol
from drivers.ft300.driver import Ft300
from drivers.modbus import READ, WRITE, decode, encode
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

MESSAGE_TICKS = 10
"""Milliseconds between messages."""
ILLEGAL_FUNCTION, FAILED = b"\x01", 0x80


class Ft300Fake(Outbox):
    """A sensor, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(self, firmware: bytes = b"FTS\x02\x00\x09") -> None:
        super().__init__()
        self._registers = {
            protocol.FIRMWARE: firmware,
            protocol.SERIAL: b"FTS\x00" + struct.pack(">HH", 1234, 0),
        }
        self.counts = np.array([2000, -1500, 9000, 300, -200, 100])
        self.streaming = False
        self._ticks = 0

    def receive(self, data: bytes) -> None:
        """Take one message; one that does not pass its check is not answered."""
        if self.streaming:
            self.streaming = len(data) < len(protocol.JAM)
            return
        try:
            function, body = decode(protocol.SLAVE, data)
        except FrameError:
            return
        values = self._registers.get(struct.unpack(">HH", body[:4])) if function == READ else None
        if values is not None:
            self._out += encode(protocol.SLAVE, READ, bytes([len(values)]) + values)
        elif function == WRITE:
            self._out += encode(protocol.SLAVE, WRITE, body[:4])
            place, value = struct.unpack_from(">H3xH", body)
            self.streaming = (place, value) == (protocol.SELECT_OUTPUT, protocol.STREAM)
        else:
            self._out += encode(protocol.SLAVE, function | FAILED, ILLEGAL_FUNCTION)

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass; while it streams, messages are made."""
        first = self._ticks // MESSAGE_TICKS + 1
        self._ticks += ticks
        numbers = np.arange(first, self._ticks // MESSAGE_TICKS + 1)
        if self.streaming:
            turn = np.sin(2 * np.pi * numbers / 100)[:, np.newaxis]
            self._out += protocol.encode_messages(np.round(turn * self.counts).astype(np.int64))


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a cable with faults."""
    return Ft300(FaultyTransport(SimulatedTransport(Ft300Fake(), "sim://ft300"), faults))
