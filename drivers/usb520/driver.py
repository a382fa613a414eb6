"""The driver of a USB520 in its text mode: it streams and accepts no commands."""

from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.device import Channel, DeviceIdentity
from drivers.errors import FrameError, LinkTimeoutError
from drivers.registry import Driver, opener
from drivers.streaming import Samples, StreamedDevice
from drivers.transport.transport import Transport
from drivers.usb520 import protocol

PATIENCE_S = 1.0
"""Time for a first whole line; ten should have come."""


class Usb520(StreamedDevice):
    """One amplifier on USB, sending so many lines a second by itself."""

    name = "usb520"

    def __init__(
        self, transport: Transport, rate_hz: Annotated[float, Field(gt=0, le=10)] = 10.0
    ) -> None:
        super().__init__(transport, rate_hz, "USB520")
        self._unit: str | None = None
        self._held = b""
        self._in_step = False

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The one quantity on its lines; known once a line has been read."""
        if self._unit is None:
            return ()
        quantity = protocol.QUANTITIES[self._unit]
        text = f"reading in {self._unit}"
        return (Channel(quantity.name, quantity.unit, self._rate_hz, -np.inf, np.inf, text),)

    def identify(self) -> DeviceIdentity:
        """Wait for a whole line. The device reports no name and no number."""
        give_up_s = self._transport.now_s + PATIENCE_S
        while self._unit is None:
            remaining_s = give_up_s - self._transport.now_s
            if remaining_s <= 0:
                self._counters.timeouts += 1
                raise LinkTimeoutError(
                    f"No line of a USB520 comes from {self._transport.url}.",
                    "After FUTEK's software has used it, it is silent until it is plugged in.",
                    "Unplug it, plug it in again, and set baud_rate if your unit needs another.",
                )
            for line in self._lines(self._transport.read(remaining_s)):
                decoded = self._decode(line)
                if decoded is not None and self._unit is None:
                    self._unit = decoded[1]
        self._identified = True
        return DeviceIdentity("USB520", "", "")

    def begin(self) -> None:
        """Forget what was sent before now."""
        self._transport.read(0.0)
        self._held = b""
        self._in_step = False

    def receive(self, timeout_s: float) -> Samples:
        """Return the readings of the whole lines that have come."""
        assert self._unit is not None  # noqa: S101 - read by `identify`
        give_up_s = self._transport.now_s + timeout_s
        values: list[float] = []
        while not values:
            data = self._transport.read(max(0.0, give_up_s - self._transport.now_s))
            for line in self._lines(data):
                decoded = self._decode(line)
                if decoded is not None:
                    values.append(decoded[0])
            if not data or self._transport.now_s >= give_up_s:
                break
        quantity = protocol.QUANTITIES[self._unit]
        readings = np.array(values, np.float64) * quantity.factor
        return {quantity.name: readings}, np.zeros(len(values), np.uint8)

    def stop(self) -> None:
        """Do nothing: the device cannot be stopped."""

    def _lines(self, data: bytes) -> list[bytes]:
        """Return the whole lines that `data` completes; the first may have begun before."""
        *lines, self._held = (self._held + data).split(b"\n")
        if len(self._held) > protocol.LONGEST_LINE:
            self._counters.discarded_bytes += len(self._held)
            self._held = b""
        if lines and not self._in_step:
            self._in_step = True
            del lines[0]
        return [line + b"\n" for line in lines]

    def _decode(self, line: bytes) -> tuple[float, str] | None:
        """Return value and unit of a line, None when it is bad or of another unit than before."""
        try:
            value, unit = protocol.decode_line(line)
        except FrameError:
            self._counters.crc_errors += 1
            self._counters.discarded_bytes += len(line)
            return None
        if self._unit not in (None, unit):
            self._counters.unknown_frames += 1
            return None
        self._counters.frames += 1
        return value, unit


DRIVER = Driver(
    "usb520",
    "FUTEK USB520 amplifier, text mode",
    opener(Usb520, "USB520", baud_rate=115_200),
)
"""One user reads its virtual serial port at 9600 bit/s."""
