"""Modbus RTU: messages, and force sensors that answer them on a serial line and stream on it.

Source: Modbus application protocol 1.1b3 and serial line guide 1.02.
"""

import struct
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.counters import silent
from drivers.device import AXES, Channel, wrench_channels
from drivers.errors import DriverError, FrameError
from drivers.streaming import Check, Samples, SlidingFrames, StreamedDevice
from drivers.transport.transport import Transport, arriving

READ, WRITE = 0x03, 0x10
REPLY_TIMEOUT_S = 0.2


def crc16(data: bytes) -> int:
    """Return the Modbus CRC-16: polynomial 0xA001 reflected, start 0xFFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def encode(slave: int, function: int, data: bytes) -> bytes:
    """Return a request or an answer."""
    body = bytes([slave, function]) + data
    return body + crc16(body).to_bytes(2, "little")


def decode(slave: int, message: bytes) -> tuple[int, bytes]:
    """Return function and data of a request or an answer.

    Raises:
        FrameError: Too short, of another slave, or the CRC does not fit.
    """
    if len(message) < 4 or message[0] != slave:
        raise FrameError(f"{message[:8].hex(' ')} is not a message of Modbus slave {slave}.")
    if crc16(message[:-2]) != int.from_bytes(message[-2:], "little"):
        raise FrameError("The CRC of a Modbus message does not fit.", "Bytes changed on the line.")
    return message[1], message[2:-2]


def read_registers(slave: int, first: int, count: int) -> bytes:
    """Return the request for `count` registers."""
    return encode(slave, READ, struct.pack(">HH", first, count))


def write_registers(slave: int, first: int, values: tuple[int, ...]) -> bytes:
    """Return the request that writes registers."""
    count = len(values)
    return encode(slave, WRITE, struct.pack(f">HHB{count}H", first, count, 2 * count, *values))


class StreamedSensor(StreamedDevice):
    """Three forces and three torques of a sensor that answers over Modbus, and streams in between.

    A driver gives `identify` and `decode`, `prepare` where the stream needs more, and the
    attributes below.
    """

    slave: int
    title: str
    """The sensor in messages."""
    check: str
    """What a person should check where it does not answer."""
    jam: bytes
    """Bytes that end the stream."""
    begin_request: bytes
    begin_answer: tuple[int, bytes]
    """Function and data of the answer to the request that begins the stream."""
    frame_size: int
    frame_checks: Check
    agree: int
    """See `drivers.streaming.SlidingFrames`, with the two above."""

    def __init__(self, transport: Transport, rate_hz: float) -> None:
        super().__init__(transport, rate_hz, self.title)
        self._frames = SlidingFrames(
            self.frame_size, self.frame_checks, self._counters, agree=self.agree
        )
        self._early = b""

    @property
    def tops(self) -> Sequence[float]:
        """Largest force and torque of each axis, N and N m."""
        raise NotImplementedError

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Three forces and three torques."""
        return wrench_channels(self._rate_hz, self.tops)

    def prepare(self) -> None:
        """Write what the stream needs."""

    def decode(self, frames: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Return values, shape (n, 6), and the `SampleFlag` bits of each frame, shape (n,)."""
        raise NotImplementedError

    def begin(self) -> None:
        """Let the stream begin; bytes of it may come with the answer."""
        self.quieten()
        self.prepare()
        self._frames.restart()
        size = len(self.begin_answer[1]) + 4
        # it may stream although its answer did not come through
        came = self._asked(self.begin_request, size, self.quieten)
        answer = decode(self.slave, came[:size])
        if answer != self.begin_answer:
            raise self.refused(*answer)
        self._early = came[size:]

    def receive(self, timeout_s: float) -> Samples:
        """Return the values and flags of the frames that have come."""
        frames = self._frames.read(self._transport, timeout_s, self._early)
        self._early = b""
        values, flags = self.decode(frames)
        return dict(zip(AXES, values.T, strict=True)), flags

    def stop(self) -> None:
        """End the stream."""
        self._transport.write(self.jam)

    def read_registers(self, first: int, count: int) -> bytes:
        """Return registers, two bytes each, high byte first.

        Raises:
            FrameError: Another number of them came.
            LinkTimeoutError: Nobody answers.
            DriverError: The device refuses.
        """
        data = self.ask(read_registers(self.slave, first, count))
        if len(data) != 2 * count + 1 or data[0] != 2 * count:
            raise FrameError(f"{count} registers were asked for, {len(data) - 1} bytes came.")
        return data[1:]

    def ask(self, request: bytes) -> bytes:
        """Return the data of the answer to a request; errors as `read_registers`."""
        return decode(self.slave, self._asked(request))[1]

    def refused(self, function: int, answer: bytes) -> DriverError:
        """Return the error of a refused request."""
        return DriverError(
            f"The {self.title} at {self._transport.url} refused function {function:#04x}.",
            f"Its answer is {answer.hex() or 'empty'}.",
            "Switch the sensor off and on, then start again.",
        )

    def _asked(
        self,
        request: bytes,
        size: int | None = None,
        before_again: Callable[[], None] = lambda: None,
    ) -> bytes:
        """Return the bytes that came; the first `size`, or all, are a good answer."""
        for attempt in self._counters.attempts():
            if attempt:
                before_again()
            self._transport.write(request)
            for came in arriving(self._transport, REPLY_TIMEOUT_S):
                try:
                    function, data = decode(self.slave, came[:size])
                except FrameError:
                    continue  # more may be on its way
                if function != request[1]:
                    raise self.refused(request[1], data)
                return came
            self._counters.discarded_bytes += len(came)
        raise silent(self.title, self._transport.url, REPLY_TIMEOUT_S, self.check)
