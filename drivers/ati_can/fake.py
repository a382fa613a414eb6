"""A NETCANOEM that answers with the frames a real one would.

Not modelled: its latency, other traffic, and the two replies of a reading being taken apart by it.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.ati_can import protocol
from drivers.ati_can.driver import AtiCan
from drivers.device import Device
from drivers.transport.can_bus import CanFrame
from drivers.transport.faulty import Faults, FaultyCanBus
from drivers.transport.simulated_can import SimulatedCanBus

Load = Callable[[int], NDArray[np.int64]]
"""Gauge counts, shape (6,), at a tick."""

MATRIX = np.array(
    [
        [12.0, -903.0, 55.0, 812.0, -71.0, 44.0],
        [-36.0, 471.0, -20.0, -1005.0, 7.0, 519.0],
        [1510.0, 21.0, 1468.0, -18.0, 1533.0, 62.0],
        [3.5, 1.25, 41.0, -0.5, -43.0, 2.0],
        [-49.0, 0.75, 25.0, 1.5, 24.0, -2.25],
        [0.25, 27.0, -1.0, 26.5, 0.5, 28.0],
    ]
)
"""A matrix of a plausible size; no real sensor's. Single precision holds every value exactly."""
CALIBRATIONS = 2
"""How many it holds; another's matrix is scaled by its number."""


def swaying(tick: int) -> NDArray[np.int64]:
    """Return the gauges of a load that sways."""
    return np.asarray(np.round(900 * np.sin(0.01 * tick + np.arange(6))).astype(np.int64))


class AtiCanFake:
    """A sensor, with the interface of `drivers.transport.simulated_can.CanNode`."""

    def __init__(
        self,
        base: int = protocol.DEFAULT_BASE,
        load: Load = swaying,
        firmware: tuple[int, int, int] = (3, 9, 1042),
    ) -> None:
        self._base = base
        self._load = load
        self._firmware = firmware
        self._active = 0
        self._out: list[CanFrame] = []
        self._tick = 0
        self.status = 0
        """Status word in the readings."""

    def receive(self, frame: CanFrame) -> None:
        """Answer a request."""
        if frame.extended or frame.can_id >> 4 != self._base:
            return
        self._out += self._answer(frame.can_id & 0xF, frame.data)

    def advance(self, ticks: int) -> None:
        """Let the load sway for `ticks` milliseconds."""
        self._tick += ticks

    def transmit(self) -> list[CanFrame]:
        """Give the frames to be sent."""
        out, self._out = self._out, []
        return out

    def restart(self) -> None:
        """Switch it off and on: it uses its first calibration again."""
        self._active = 0

    def _answer(self, operation: int, data: bytes) -> list[CanFrame]:
        if operation == protocol.READ and not data:
            gauges = np.clip(self._load(self._tick), protocol.GAUGE_MIN, protocol.GAUGE_MAX)
            return protocol.encode_reading(self._base, self.status, gauges.tolist())
        if operation == protocol.MATRIX_ROW and len(data) == 1 and data[0] < 6:
            return protocol.encode_matrix_row(self._base, MATRIX[data[0]] * (1 + self._active))
        if operation == protocol.CALIBRATION and len(data) == 1:
            self._active = data[0] if data[0] < CALIBRATIONS else self._active
            return [self._reply(operation, bytes([self._active]))]
        if operation == protocol.SERIAL and not data:
            return [self._reply(operation, b"FT012345")]
        if operation == protocol.FIRMWARE and not data:
            return [self._reply(operation, protocol.VERSION_REPLY.pack(*self._firmware))]
        if self._firmware[:2] < protocol.TELLS_UNITS or data:
            return []
        if operation == protocol.COUNTS_PER_UNIT:
            counts = protocol.COUNTS_REPLY.pack(1_000_000, 1_000_000)
            return [self._reply(operation, counts)]
        if operation == protocol.UNIT_CODES:
            return [self._reply(operation, bytes([2, 3]))]
        return []

    def _reply(self, operation: int, data: bytes) -> CanFrame:
        return protocol.request(self._base, operation, data)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a cable with faults."""
    return AtiCan(FaultyCanBus(SimulatedCanBus([AtiCanFake()]), faults))
