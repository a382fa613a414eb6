"""The driver of an FT 300: it is asked who it is, then it streams."""

import numpy as np

from drivers.ati_net.protocol import AXES
from drivers.counters import Arrivals, DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity, SampleFlag, stop_and_let_go
from drivers.errors import DriverError
from drivers.ft300 import protocol
from drivers.modbus import WRITE, ModbusLine, write_registers
from drivers.registry import BaudOption, Driver
from drivers.sliding import SlidingFrames
from drivers.transport.serial_port import open_line
from drivers.transport.transport import Transport

RATE_HZ = 100.0
LONGEST_SILENCE_S = 0.1
RANGE = np.array([300.0] * 3 + [30.0] * 3)
"""Measuring range, N and N m; shape (6,)."""


class Ft300:
    """One sensor on an RS-485 line.

    Args:
        transport: The way to it; the device closes it.
    """

    name = "ft300"

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._counters = DeviceCounters()
        self._arrivals = Arrivals(self._counters, LONGEST_SILENCE_S)
        self._frames = SlidingFrames(
            protocol.MESSAGE_SIZE, protocol.message_checks, self._counters, agree=2
        )
        self._line = ModbusLine(
            transport,
            protocol.SLAVE,
            self._counters,
            title="FT 300",
            jam=protocol.JAM,
            check="Check its 24 V, the line, 19200 bit/s, no parity, and the adapter's A and B.",
        )
        self._identity: DeviceIdentity | None = None
        self._errors_at_start = 0
        self._early = b""
        self._closed = False

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Three forces and three torques."""
        kinds = [("N", "force")] * 3 + [("N m", "torque")] * 3
        tops = (protocol.STEPS * 32768).tolist()
        return tuple(
            Channel(name, unit, RATE_HZ, -top, top, text)
            for name, (unit, text), top in zip(AXES, kinds, tops, strict=True)
        )

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the line."""
        return self._counters.as_dict()

    def identify(self) -> DeviceIdentity:
        """End the stream; ask for firmware and serial number.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: It is another device.
        """
        self._line.quieten()
        firmware, serial = (
            self._line.read(*place) for place in (protocol.FIRMWARE, protocol.SERIAL)
        )
        if firmware[:1] != b"F":
            raise DriverError(
                f"The device at {self._transport.url} is not an FT 300.",
                f"Its firmware version begins with {firmware[:3]!r}.",
                "A gripper of the same maker answers at the same address: choose the other port.",
            )
        version, number = protocol.identity(firmware, serial)
        self._identity = DeviceIdentity("FT 300", number, version)
        return self._identity

    def start(self) -> None:
        """Let the stream begin.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The sensor refuses.
        """
        if self._identity is None:
            self.identify()
        self._line.quieten()
        self._frames.restart()
        self._errors_at_start = self._counters.crc_errors
        request = write_registers(protocol.SLAVE, protocol.SELECT_OUTPUT, (protocol.STREAM,))
        self._early = self._line.begin_stream(request, (WRITE, request[2:6]))
        self._arrivals.restart(self._transport.now_s)

    def read(self, timeout_s: float) -> Batch:
        """Return the messages that have come, stamped with the time of this read.

        Raises:
            DriverError: Neither `identify` nor `start` has been called.
        """
        if self._identity is None:
            raise DriverError("The FT 300 is not known.", fix="Call start first.")
        messages = self._frames.read(self._transport, timeout_s, self._early)
        self._early = b""
        now_s = self._transport.now_s
        values = protocol.decode_messages(messages) * protocol.STEPS
        flags = np.zeros(len(values), np.uint8)
        flags[(np.abs(values) > RANGE).any(axis=1)] = np.uint8(SampleFlag.SATURATED)
        return Batch(
            {name: values[:, axis] for axis, name in enumerate(AXES)},
            np.full(len(values), now_s),
            "host",
            self._arrivals.number(len(values), now_s),
            flags,
            self._counters.crc_errors - self._errors_at_start,
        )

    def stop(self) -> None:
        """End the stream."""
        self._transport.write(protocol.JAM)

    def close(self) -> None:
        """End the stream where that can still be done, and let go of the line."""
        if not self._closed:
            self._closed = True
            stop_and_let_go(self.stop, self._transport.close)


def open_ft300(url: str, baud_rate: BaudOption = 19_200) -> Ft300:
    """Open the sensor on an RS-485 adapter, 8 bits, no parity.

    Args:
        url: The adapter.
        baud_rate: 19200, the only one Robotiq's driver uses.

    Raises:
        LinkError: The adapter cannot be opened.
    """
    return Ft300(open_line(url, baud_rate))


DRIVER = Driver("ft300", "Robotiq FT 300 force and torque sensor, RS-485", open_ft300)
