"""A digital F/T that takes and gives the bytes a real one would, a slow sine on its gauges.

It answers Modbus itself: a Modbus server's library runs in real time and knows neither the sensor's
own functions nor a line that turns into a stream. Each write of the host is taken for one message,
as the silence between messages marks them on a line. Not modelled: the time bytes take.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from drivers.ati_serial import protocol
from drivers.ati_serial.driver import AtiSerial
from drivers.ati_serial.protocol import Calibration
from drivers.device import Device
from drivers.errors import FrameError
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport

FRAMES_A_TICK = 7
LAST_REGISTER = 0x0FFF
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = b"\x01", b"\x02"


def example_calibration() -> Calibration:
    """Return a calibration of this fake's own: each gauge drives mostly one axis."""
    matrix = 1500.0 * np.eye(6) + 20.0 * np.arange(36).reshape(6, 6) % 7
    gains, offsets = (543, 540, 545, 541, 544, 542), (34927, 34900, 34950, 34910, 34940, 34920)
    return Calibration("FT99999", "SI-145-5", matrix, 2, 3, 1_000_000, 1_000_000, gains, offsets)


class AtiSerialFake:
    """A sensor, with the interface of `drivers.transport.simulated.Board`.

    Args:
        calibration: Its first calibration; the others are empty.
    """

    def __init__(self, calibration: Calibration | None = None) -> None:
        block = protocol.encode_calibration(calibration or example_calibration())
        self.registers = bytearray(2 * LAST_REGISTER + 2)
        first = 2 * protocol.FIRST_CALIBRATION
        self.registers[first : first + len(block)] = block
        self.streaming = False
        self.status_bad = False
        self._locked = True
        self._sent = 0
        self._out = bytearray()

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

    def transmit(self) -> bytes:
        """Give the bytes that wait for the host."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def gauges(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the gauges in the frames with the given numbers, shape (n, 6)."""
        turn = np.sin(2 * np.pi * numbers / 7000)[:, np.newaxis]
        gauges: NDArray[np.int64] = np.round(turn * np.arange(1000, 7000, 1000)).astype(np.int64)
        return gauges

    def _answer(self, function: int, body: bytes) -> bytes:
        if function == protocol.STREAM:
            self.streaming = body == protocol.START_STREAM
            return protocol.encode(function, bytes([self.streaming]))
        if function == protocol.STORAGE:
            self._locked = body != protocol.UNLOCK
            return protocol.encode(function, b"\x01")
        if function not in (protocol.READ, protocol.WRITE):
            return protocol.encode(function | protocol.FAILED, ILLEGAL_FUNCTION)
        first, count = struct.unpack(">HH", body[:4])
        place = slice(2 * first, 2 * (first + count))
        refused = count > 125 or first + count > LAST_REGISTER + 1
        if refused or (function == protocol.WRITE and self._locked):
            return protocol.encode(function | protocol.FAILED, ILLEGAL_ADDRESS)
        if function == protocol.WRITE:
            self.registers[place] = body[5:]
            return protocol.encode(function, body[:4])
        return protocol.encode(function, bytes([2 * count]) + self.registers[place])


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a cable with faults."""
    line = SimulatedTransport(AtiSerialFake(), "sim://ati-serial")
    return AtiSerial(FaultyTransport(line, faults))
