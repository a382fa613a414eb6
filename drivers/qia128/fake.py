"""A QIA128 that takes and gives the bytes a real one would, a slow sine on its sensor.

Not modelled: its boot time, the time bytes take on the wire, and settings other than the rate.
"""

import numpy as np

from drivers.device import Device
from drivers.errors import FrameError
from drivers.qia128 import protocol
from drivers.qia128.driver import Qia128
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

RATE_HZ = 1300


class Qia128Fake(Outbox):
    """An amplifier, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(
        self,
        serial: int = 712345,
        zero: int = protocol.MIDDLE + 1200,
        full_scale: int = protocol.MIDDLE + 3_355_443,
    ) -> None:
        super().__init__()
        self._numbers = {
            (*protocol.GET_SERIAL, b""): serial,
            (*protocol.GET_CALIBRATION, bytes([0, protocol.ZERO_POINT])): zero,
            (*protocol.GET_CALIBRATION, bytes([0, protocol.FULL_SCALE_POINT])): full_scale,
        }
        self._zero = zero
        self._span = full_scale - zero
        self._ticks = 0
        self._sent = 0
        self._in = b""
        self.streaming = False

    def receive(self, data: bytes) -> None:
        """Take bytes from the host and answer the packets they complete."""
        self._in += data
        while len(self._in) >= 2 and len(self._in) >= max(5, self._in[1]):
            size = max(5, self._in[1])
            packet, self._in = self._in[:size], self._in[size:]
            try:
                command, payload = protocol.decode_packet(packet)
            except FrameError:
                self._in = b""  # a host that is not understood asks again
                return
            self._answer(command, payload)

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass; while it streams, readings are made."""
        self._ticks += ticks
        made = self._ticks * RATE_HZ // 1000
        if self.streaming:
            self._out += protocol.encode_frames(self.raw(np.arange(self._sent, made)))
        self._sent = made

    def raw(self, numbers: np.ndarray) -> np.ndarray:
        """Return the readings with the given numbers since power-up, shape (n,)."""
        load = 0.4 * np.sin(2 * np.pi * numbers / RATE_HZ)
        return (self._zero + np.round(self._span * load)).astype(np.int64)

    def _answer(self, command: tuple[int, int], payload: bytes) -> None:
        number = self._numbers.get((*command, payload))
        if number is not None:
            self._out += protocol.encode_packet(command, number.to_bytes(4, "big"))
            return
        if command == protocol.STREAM:
            self.streaming = payload == b"\x01"
        self._out += protocol.encode_packet(command)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake amplifier behind a cable with faults."""
    return Qia128(FaultyTransport(SimulatedTransport(Qia128Fake(), "sim://qia128"), faults))
