"""A digital F/T that takes and gives the bytes a real one would, a slow sine on its gauges.

Each write of the host is taken for one message, as the silence between messages marks them on a
line. Not modelled: the time bytes take.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from drivers.ati_serial import protocol
from drivers.ati_serial.driver import AtiSerial
from drivers.ati_serial.protocol import Calibration
from drivers.device import Device
from drivers.errors import FrameError
from drivers.modbus import READ, WRITE
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

REGISTERS, MOST_AT_ONCE = 0x1000, 125
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = b"\x01", b"\x02", b"\x03"
FRAMES_A_TICK = 7


def example_calibration() -> Calibration:
    """Return a calibration of this fake's own: each gauge drives mostly one axis."""
    matrix = 1500.0 * np.eye(6) + 20.0 * np.arange(36).reshape(6, 6) % 7
    gains, offsets = (543, 540, 545, 541, 544, 542), (34927, 34900, 34950, 34910, 34940, 34920)
    return Calibration(
        *(2, 3, 1_000_000, 1_000_000),
        serial="FT99999",
        part_number="SI-145-5",
        matrix=matrix,
        gains=gains,
        offsets=offsets,
    )


class AtiSerialFake(Outbox):
    """A sensor with one calibration, and the interface of `drivers.transport.simulated.Board`."""

    def __init__(self) -> None:
        super().__init__()
        block = protocol.encode_calibration(example_calibration())
        before = bytes(2 * protocol.FIRST_CALIBRATION)
        self._registers = bytearray((before + block).ljust(2 * REGISTERS, b"\0"))
        self.locked = True
        self.streaming = False
        self.status_bad = False
        self._sent = 0

    def registers(self, first: int, count: int) -> tuple[int, ...]:
        """Return the values of registers."""
        return struct.unpack_from(f">{count}H", self._registers, 2 * first)

    def receive(self, data: bytes) -> None:
        """Take one message; one that does not pass its check is not answered."""
        if self.streaming:
            self.streaming = len(data) < 14
            return
        try:
            function, body = protocol.decode(data)
        except FrameError:
            return
        self._out += self._answer(function, body)

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass; while it streams, frames are made."""
        count = ticks * FRAMES_A_TICK
        if self.streaming:
            gauges = self.gauges(np.arange(self._sent, self._sent + count))
            self._out += protocol.encode_frames(gauges, self.status_bad)
        self._sent += count

    def _answer(self, function: int, body: bytes) -> bytes:
        if function == protocol.STORAGE:
            self.locked = body != protocol.UNLOCK
            return protocol.encode(function, protocol.SUCCESS)
        if function == protocol.STREAM:
            self.streaming = body == protocol.START_STREAM
            return protocol.encode(function, bytes([self.streaming]))
        if function not in (READ, WRITE) or len(body) < 4:
            return protocol.encode(function | protocol.FAILED, ILLEGAL_FUNCTION)
        first, count = struct.unpack_from(">HH", body)
        place = slice(2 * first, 2 * (first + count))
        if count > MOST_AT_ONCE or (function == WRITE and len(body) != 5 + 2 * count):
            return protocol.encode(function | protocol.FAILED, ILLEGAL_VALUE)
        if first + count > REGISTERS or (function == WRITE and self.locked):
            return protocol.encode(function | protocol.FAILED, ILLEGAL_ADDRESS)
        if function == READ:
            return protocol.encode(READ, bytes([2 * count]) + self._registers[place])
        self._registers[place] = body[5:]
        return protocol.encode(WRITE, body[:4])

    def gauges(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the gauges in the frames with the given numbers, shape (n, 6)."""
        turn = np.sin(2 * np.pi * numbers / 7000)[:, np.newaxis]
        return np.round(turn * np.arange(1000, 7000, 1000)).astype(np.int64)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a cable with faults."""
    line = SimulatedTransport(AtiSerialFake(), "sim://ati-serial")
    return AtiSerial(FaultyTransport(line, faults))
