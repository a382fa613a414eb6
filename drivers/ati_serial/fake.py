"""A digital F/T that takes and gives the bytes a real one would, a slow sine on its gauges.

Its Modbus answers come from a Modbus library (`modbus_server`), not from this project; the stream
and its end are here. Each write of the host is taken for one message, as the silence between
messages marks them on a line. Not modelled: the time bytes take.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drivers.ati_serial import protocol
from drivers.ati_serial.driver import AtiSerial
from drivers.ati_serial.protocol import Calibration
from drivers.device import Device
from drivers.errors import MissingExtraError
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport

if TYPE_CHECKING:
    from drivers.ati_serial.fake_modbus import ModbusServer

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
        self.server = _server(protocol.encode_calibration(example_calibration()))
        self.status_bad = False
        self._sent = 0

    def receive(self, data: bytes) -> None:
        """Take one message; one that does not pass its check is not answered."""
        if self.server.streaming:
            self.server.streaming = len(data) < 14
            return
        self._out += self.server.answer(data)

    def advance(self, ticks: int) -> None:
        """Let `ticks` milliseconds pass; while it streams, frames are made."""
        count = ticks * FRAMES_A_TICK
        if self.server.streaming:
            gauges = self.gauges(np.arange(self._sent, self._sent + count))
            self._out += protocol.encode_frames(gauges, self.status_bad)
        self._sent += count

    def gauges(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the gauges in the frames with the given numbers, shape (n, 6)."""
        turn = np.sin(2 * np.pi * numbers / 7000)[:, np.newaxis]
        return np.round(turn * np.arange(1000, 7000, 1000)).astype(np.int64)


def _server(block: bytes) -> "ModbusServer":
    """Return the Modbus server; its library is an extra, loaded only here."""
    try:
        from drivers.ati_serial.fake_modbus import ModbusServer
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            "The simulated digital F/T needs the pymodbus library.", f"{error}.", "modbus"
        ) from error
    return ModbusServer(protocol.FIRST_CALIBRATION, block)


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake sensor behind a cable with faults."""
    line = SimulatedTransport(AtiSerialFake(), "sim://ati-serial")
    return AtiSerial(FaultyTransport(line, faults))
