"""The driver of an FT 300: it is asked who it is, then it streams."""

import numpy as np
from numpy.typing import NDArray

from drivers.device import DeviceIdentity, flags_of
from drivers.errors import DriverError
from drivers.ft300 import protocol
from drivers.modbus import WRITE, StreamedSensor, write_registers
from drivers.registry import Driver, opener
from drivers.transport.transport import Transport

RATE_HZ = 100.0
RANGE = np.array([300.0] * 3 + [30.0] * 3)
"""Measuring range, N and N m; shape (6,)."""


class Ft300(StreamedSensor):
    """One sensor on an RS-485 line."""

    name = "ft300"
    slave, title = protocol.SLAVE, "FT 300"
    check = "Check its 24 V, the line, 19200 bit/s, no parity, and the adapter's A and B."
    jam = protocol.JAM
    begin_request = write_registers(protocol.SLAVE, protocol.SELECT_OUTPUT, (protocol.STREAM,))
    begin_answer = (WRITE, begin_request[2:6])
    frame_size, agree = protocol.MESSAGE_SIZE, 2
    frame_checks = staticmethod(protocol.message_checks)
    tops = tuple((protocol.STEPS * 32768).tolist())

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport, RATE_HZ)

    def identify(self) -> DeviceIdentity:
        """End the stream; ask for firmware and serial number. DriverError of another device."""
        self.quieten()
        firmware, serial = (
            self.read_registers(*place) for place in (protocol.FIRMWARE, protocol.SERIAL)
        )
        if firmware[:1] != b"F":
            raise DriverError(
                f"The device at {self._transport.url} is not an FT 300.",
                f"Its firmware version begins with {firmware[:3]!r}.",
                "A gripper of the same maker answers at the same address: choose the other port.",
            )
        version, number = protocol.identity(firmware, serial)
        self._identified = True
        return DeviceIdentity("FT 300", number, version)

    def decode(self, frames: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Return values, and where one is beyond the measuring range."""
        values = protocol.decode_messages(frames) * protocol.STEPS
        return values, flags_of((np.abs(values) > RANGE).any(axis=1))


DRIVER = Driver(
    "ft300",
    "Robotiq FT 300 force and torque sensor, RS-485",
    opener(Ft300, "FT 300", baud_rate=19_200),
)
"""8 bits, no parity; the bit rate is that of Robotiq's driver."""
