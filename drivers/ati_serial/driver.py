"""The driver of a digital F/T: its calibration is read and put in force, then it streams."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.ati_net.protocol import AXES, N_M_PER_UNIT, N_PER_UNIT
from drivers.ati_serial import protocol
from drivers.counters import Arrivals, DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity, SampleFlag, stop_and_let_go
from drivers.errors import DriverError, FrameError, LinkTimeoutError
from drivers.registry import BaudOption, Driver, RateOption
from drivers.sliding import SlidingFrames
from drivers.transport.serial_port import open_line
from drivers.transport.transport import Transport

TRIES = 3
REPLY_TIMEOUT_S = 0.2
QUIET_S = 0.05
"""A stopped stream has ended when nothing arrives for this long, s."""
LONGEST_SILENCE_S = 0.1
GAUGE_LIMIT = 32767


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What may differ on a digital F/T of another make-up.

    As it stands here it is in the public driver named in the README.

    Attributes:
        matrix_by_rows: The calibration's matrix comes row by row, Fx first; else column by column.
        force_unit: Code of the force unit, in place of the one read from the sensor; 0 for that.
        torque_unit: Code of the torque unit, likewise.
        lock_answers: The sensor answers the function that locks its storage (0x6A).
    """

    matrix_by_rows: bool = True
    force_unit: int = 0
    torque_unit: int = 0
    lock_answers: bool = True


class AtiSerial:
    """One sensor on an RS-485 line.

    Args:
        transport: The way to it; the device closes it.
        calibration: Which of its 16 calibrations to use, from 1.
        rate_hz: Frames a second it sends.
        assumed: What is taken for granted about it.

    Raises:
        DriverError: No such calibration.
    """

    name = "ati-serial"

    def __init__(
        self,
        transport: Transport,
        calibration: int = 1,
        rate_hz: float = 7000.0,
        assumed: Assumptions = Assumptions(),
    ) -> None:
        if not 1 <= calibration <= 16:
            raise DriverError(f"A digital F/T has calibrations 1 to 16, none {calibration}.")
        self._transport = transport
        self._number = calibration
        self._rate_hz = rate_hz
        self._assumed = assumed
        self._calibration: protocol.Calibration | None = None
        self._matrix = np.zeros((6, 6))
        self._counters = DeviceCounters()
        self._arrivals = Arrivals(self._counters, max(LONGEST_SILENCE_S, 5 / rate_hz))
        self._frames = SlidingFrames(
            protocol.FRAME_SIZE, protocol.frame_checks, self._counters, agree=5
        )
        self._errors_at_start = 0
        self._early = b""
        self._closed = False

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Three forces and three torques; their range is known once the calibration is."""
        tops = np.full(6, np.inf)
        if self._calibration is not None:
            tops = np.abs(self._matrix).sum(axis=1) * (GAUGE_LIMIT + 1)
        return tuple(
            Channel(name, unit, self._rate_hz, -top, top, text)
            for name, (unit, text), top in zip(
                AXES, [("N", "force")] * 3 + [("N m", "torque")] * 3, tops.tolist(), strict=True
            )
        )

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the line."""
        return self._counters.as_dict()

    def identify(self) -> DeviceIdentity:
        """End the stream and read the calibration.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The calibration is empty, or in unknown units.
        """
        self._quieten()
        first = protocol.FIRST_CALIBRATION + (self._number - 1) * protocol.CALIBRATION_STEP
        registers = b"".join(
            self._read_registers(first + offset, count) for offset, count in protocol.PIECES
        )
        told = protocol.decode_calibration(registers)
        found = replace(
            told,
            matrix=told.matrix if self._assumed.matrix_by_rows else told.matrix.T,
            force_unit=self._assumed.force_unit or told.force_unit,
            torque_unit=self._assumed.torque_unit or told.torque_unit,
        )
        if found.force_unit not in N_PER_UNIT or found.torque_unit not in N_M_PER_UNIT:
            raise DriverError(
                f"Calibration {self._number} of {found.serial} has unknown units.",
                f"Their codes are {found.force_unit} and {found.torque_unit}.",
                "Choose another calibration, or set `force_unit` and `torque_unit`.",
            )
        slopes = np.repeat(
            [
                N_PER_UNIT[found.force_unit] / found.counts_per_force,
                N_M_PER_UNIT[found.torque_unit] / found.counts_per_torque,
            ],
            3,
        )
        self._matrix = found.matrix * slopes[:, np.newaxis]
        self._calibration = found
        return DeviceIdentity(f"ATI digital F/T {found.part_number}".strip(), found.serial, "")

    def start(self) -> None:
        """Put the calibration's gains and offsets in force and let the stream begin.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The sensor refuses.
        """
        if self._calibration is None:
            self.identify()
        assert self._calibration is not None  # noqa: S101
        self._quieten()
        active = self._calibration.gains + self._calibration.offsets
        self._set_lock(protocol.UNLOCK)
        self._ask(protocol.write_registers(protocol.ACTIVE_GAINS, active))
        self._set_lock(protocol.LOCK)
        self._frames.restart()
        self._errors_at_start = self._counters.crc_errors
        self._early = self._start_stream()
        self._arrivals.restart(self._transport.now_s)

    def read(self, timeout_s: float) -> Batch:
        """Return the frames that have come, stamped with the time of this read.

        Raises:
            DriverError: Neither `identify` nor `start` has been called.
        """
        if self._calibration is None:
            raise DriverError("The sensor's calibration is not known.", fix="Call start first.")
        give_up_s = self._transport.now_s + timeout_s
        while True:
            early, self._early = self._early, b""
            wait_s = 0.0 if early else max(0.0, give_up_s - self._transport.now_s)
            data = early + self._transport.read(wait_s)
            frames = self._frames.feed(data)
            if len(frames) or not data or self._transport.now_s >= give_up_s:
                break
        gauges, bad = protocol.decode_frames(frames)
        self._counters.device_errors += int(np.count_nonzero(bad))
        now_s = self._transport.now_s
        values = gauges @ self._matrix.T
        return Batch(
            {name: values[:, axis] for axis, name in enumerate(AXES)},
            np.full(len(frames), now_s),
            "host",
            self._arrivals.number(len(frames), now_s),
            _flags(gauges, bad),
            self._counters.crc_errors - self._errors_at_start,
        )

    def _set_lock(self, state: bytes) -> None:
        message = protocol.encode(protocol.STORAGE, state)
        if self._assumed.lock_answers:
            answer = self._ask(message)
            if answer != protocol.SUCCESS:
                raise self._refused(protocol.STORAGE, answer)
            return
        self._transport.write(message)
        self._transport.read(QUIET_S)  # an answer all the same is let go

    def status(self) -> int:
        """Return the status register; only while it does not stream."""
        return int.from_bytes(self._read_registers(protocol.STATUS, 1), "big")

    def stop(self) -> None:
        """End the stream."""
        self._transport.write(protocol.JAM)

    def close(self) -> None:
        """End the stream where that can still be done, and let go of the line."""
        if self._closed:
            return
        self._closed = True
        stop_and_let_go(self.stop, self._transport.close)

    def _quieten(self) -> None:
        """End the stream and wait until nothing more comes."""
        self.stop()
        give_up_s = self._transport.now_s + 1.0
        while self._transport.read(QUIET_S):
            if self._transport.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"The sensor at {self._transport.url} does not end its stream.",
                    "It was jammed and went on for 1 s.",
                    "Check the adapter's sending side, or switch the sensor off and on.",
                )

    def _read_registers(self, first: int, count: int) -> bytes:
        data = self._ask(protocol.read_registers(first, count))
        if len(data) != 2 * count + 1 or data[0] != 2 * count:
            raise FrameError(f"{count} registers were asked for, {len(data) - 1} bytes came.")
        return data[1:]

    def _start_stream(self) -> bytes:
        """Let the stream begin; return the bytes of it that came with the answer.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The sensor refuses.
        """
        request = protocol.encode(protocol.STREAM, protocol.START_STREAM)
        for attempt in range(TRIES):
            if attempt:
                self._counters.retries += 1
                self._quieten()  # it may stream although its answer did not come through
            self._transport.write(request)
            give_up_s = self._transport.now_s + REPLY_TIMEOUT_S
            came = b""
            while len(came) < len(request) and self._transport.now_s < give_up_s:
                came += self._transport.read(give_up_s - self._transport.now_s)
            answer, rest = came[: len(request)], came[len(request) :]
            try:
                function, data = protocol.decode(answer)
            except FrameError:
                self._counters.discarded_bytes += len(came)
                continue
            if (function, data) != (protocol.STREAM, protocol.SUCCESS):
                raise self._refused(protocol.STREAM, data)
            return rest
        raise self._no_answer()

    def _ask(self, request: bytes) -> bytes:
        """Return the data of the answer to a request."""
        for attempt in range(TRIES):
            if attempt:
                self._counters.retries += 1
            self._transport.write(request)
            give_up_s = self._transport.now_s + REPLY_TIMEOUT_S
            came = b""
            while self._transport.now_s < give_up_s:
                came += self._transport.read(give_up_s - self._transport.now_s)
                try:
                    function, data = protocol.decode(came)
                except FrameError:
                    continue  # more may be on its way
                if function == request[1]:
                    return data
                raise self._refused(request[1], data)
            self._counters.discarded_bytes += len(came)
        raise self._no_answer()

    def _refused(self, function: int, answer: bytes) -> DriverError:
        return DriverError(
            f"The sensor at {self._transport.url} refused function {function:#04x}.",
            f"Its answer is {answer.hex() or 'empty'}.",
            "Switch the sensor off and on, then start again.",
        )

    def _no_answer(self) -> LinkTimeoutError:
        self._counters.timeouts += 1
        return LinkTimeoutError(
            f"No digital F/T answers at {self._transport.url}.",
            f"It was asked {TRIES} times.",
            "Check its supply, the line, 1.25 Mbit/s and even parity.",
        )


def _flags(gauges: NDArray[np.int64], bad: NDArray[np.bool_]) -> NDArray[np.uint8]:
    flags = np.zeros(len(gauges), np.uint8)
    flags[bad] |= np.uint8(SampleFlag.SUSPECT)
    full = (gauges >= GAUGE_LIMIT) | (gauges <= -GAUGE_LIMIT)
    flags[full.any(axis=1)] |= np.uint8(SampleFlag.SATURATED)
    return flags


def open_ati_serial(
    url: str,
    calibration: Annotated[int, Field(ge=1, le=16)] = 1,
    rate_hz: RateOption = 7000.0,
    baud_rate: BaudOption = 1_250_000,
    matrix_by_rows: bool = True,
    force_unit: Annotated[int, Field(ge=0, le=6)] = 0,
    torque_unit: Annotated[int, Field(ge=0, le=6)] = 0,
    lock_answers: bool = True,
) -> AtiSerial:
    """Open the sensor on an RS-485 adapter, 8 bits, even parity.

    Args:
        url: The adapter.
        calibration: Which of its calibrations to use, from 1.
        rate_hz: Frames a second it sends.
        baud_rate: 1250000 as delivered; 115200 and 19200 can be set.
        matrix_by_rows: See `Assumptions`; the next three too. Check them with a known weight.
        force_unit: Code of the force unit where the sensor's own is not to be believed.
        torque_unit: Code of the torque unit, likewise.
        lock_answers: Whether it answers the function that locks its storage.

    Raises:
        LinkError: The adapter cannot be opened or has no such speed.
    """
    assumed = Assumptions(matrix_by_rows, force_unit, torque_unit, lock_answers)
    return AtiSerial(open_line(url, baud_rate, "E"), calibration, rate_hz, assumed)


DRIVER = Driver("ati-serial", "ATI digital F/T over RS-485, Modbus and stream", open_ati_serial)
