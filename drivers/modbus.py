"""Modbus RTU: messages, asking one device on a serial line, and force sensors that stream on one.

Source: Modbus application protocol 1.1b3 and serial line guide 1.02.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.counters import TRIES, DeviceCounters
from drivers.device import AXES, Channel, wrench_channels
from drivers.errors import DriverError, FrameError, LinkTimeoutError
from drivers.sliding import Check, SlidingFrames
from drivers.streaming import StreamedDevice
from drivers.transport.transport import Transport

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


class ModbusLine:
    """One device that answers Modbus requests, and sends a stream of its own between them.

    Args:
        transport: The way to it.
        slave: Its address.
        counters: Counters of retries, timeouts and discarded bytes.
        title: The device in messages.
        check: What a person should check where it does not answer.
    """

    def __init__(
        self, transport: Transport, slave: int, counters: DeviceCounters, title: str, check: str
    ) -> None:
        self._transport = transport
        self._slave = slave
        self._counters = counters
        self._title = title
        self._check = check

    def read(self, first: int, count: int) -> bytes:
        """Return registers, two bytes each, high byte first.

        Raises:
            FrameError: Another number of them came.
            LinkTimeoutError: Nobody answers.
            DriverError: The device refuses.
        """
        data = self.ask(read_registers(self._slave, first, count))
        if len(data) != 2 * count + 1 or data[0] != 2 * count:
            raise FrameError(f"{count} registers were asked for, {len(data) - 1} bytes came.")
        return data[1:]

    def write(self, first: int, values: tuple[int, ...]) -> None:
        """Write registers; errors as `read`."""
        self.ask(write_registers(self._slave, first, values))

    def ask(self, request: bytes) -> bytes:
        """Return the data of the answer to a request; errors as `read`."""

        def whole(came: bytes) -> tuple[int, bytes] | None:
            try:
                return decode(self._slave, came)
            except FrameError:
                return None  # more may be on its way

        return self._asked(request, whole, lambda: None)[1]

    def begin_stream(
        self, request: bytes, answer: tuple[int, bytes], quieten: Callable[[], None]
    ) -> bytes:
        """Let a stream begin; return the bytes of it that came with the answer.

        Args:
            request: What begins it.
            answer: Function and data of the answer to it.
            quieten: Ends the stream.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The device refuses.
        """
        size = len(answer[1]) + 4
        rest = b""

        def begun(came: bytes) -> tuple[int, bytes] | None:
            nonlocal rest
            rest = came[size:]
            try:
                return decode(self._slave, came[:size])
            except FrameError:
                return None

        # it may stream although its answer did not come through
        data = self._asked(request, begun, quieten)
        if data != answer:
            raise self.refused(*data)
        return rest

    def refused(self, function: int, answer: bytes) -> DriverError:
        """Return the error of a refused request."""
        return DriverError(
            f"The {self._title} at {self._transport.url} refused function {function:#04x}.",
            f"Its answer is {answer.hex() or 'empty'}.",
            "Switch the sensor off and on, then start again.",
        )

    def _asked(
        self,
        request: bytes,
        understood: Callable[[bytes], tuple[int, bytes] | None],
        before_again: Callable[[], None],
    ) -> tuple[int, bytes]:
        for attempt in self._counters.attempts():
            if attempt:
                before_again()
            self._transport.write(request)
            give_up_s = self._transport.now_s + REPLY_TIMEOUT_S
            came = b""
            while self._transport.now_s < give_up_s:
                came += self._transport.read(give_up_s - self._transport.now_s)
                answer = understood(came)
                if answer is None:
                    continue
                if answer[0] != request[1]:
                    raise self.refused(request[1], answer[1])
                return answer
            self._counters.discarded_bytes += len(came)
        raise LinkTimeoutError(
            f"No {self._title} answers at {self._transport.url}.",
            f"It was asked {TRIES} times.",
            self._check,
        )


@dataclass(frozen=True, slots=True)
class Stream:
    """A sensor's stream between its Modbus answers.

    Attributes:
        slave: The sensor's address.
        title: The sensor in messages.
        check: What a person should check where it does not answer.
        jam: Bytes that end the stream.
        begin: Request that begins it.
        begun: Function and data of the answer to that.
        frame_size: Bytes of a frame.
        frame_checks: See `drivers.sliding.SlidingFrames`.
        agree: Likewise.
    """

    slave: int
    title: str
    check: str
    jam: bytes
    begin: bytes
    begun: tuple[int, bytes]
    frame_size: int
    frame_checks: Check
    agree: int


class StreamedSensor(StreamedDevice):
    """Three forces and three torques of a sensor that is asked over Modbus, then streams.

    A driver gives `identify` and `decode`, and `prepare` where the stream needs more.

    Args:
        transport: The way to it; the device closes it.
        stream: How it streams.
        rate_hz: Frames a second.
    """

    def __init__(self, transport: Transport, stream: Stream, rate_hz: float) -> None:
        super().__init__(transport, rate_hz, stream.title)
        self._stream = stream
        self._frames = SlidingFrames(
            stream.frame_size, stream.frame_checks, self._counters, agree=stream.agree
        )
        self._line = ModbusLine(transport, stream.slave, self._counters, stream.title, stream.check)
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
        """Let the stream begin."""
        self.quieten()
        self.prepare()
        self._frames.restart()
        stream = self._stream
        self._early = self._line.begin_stream(stream.begin, stream.begun, self.quieten)

    def receive(
        self, timeout_s: float
    ) -> tuple[Mapping[str, NDArray[np.float64]], NDArray[np.uint8]]:
        """Return the values and flags of the frames that have come."""
        frames = self._frames.read(self._transport, timeout_s, self._early)
        self._early = b""
        values, flags = self.decode(frames)
        return dict(zip(AXES, values.T, strict=True)), flags

    def stop(self) -> None:
        """End the stream."""
        self._transport.write(self._stream.jam)
