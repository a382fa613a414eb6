"""The driver of a NETCANOEM: it is polled for every sample, at a steady rate."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.ati_can import protocol
from drivers.ati_net.protocol import N_M_PER_UNIT, N_PER_UNIT, Calibration
from drivers.counters import TRIES
from drivers.device import Channel, DeviceIdentity, SampleFlag, wrench_channels
from drivers.errors import DriverError, FrameError, LinkTimeoutError
from drivers.polling import PolledDevice
from drivers.registry import CanUse, Driver, RateOption, opener
from drivers.transport.can_bus import CanBus
from drivers.transport.python_can import open_can
from drivers.transport.transport import time_left

REPLY_TIMEOUT_S = 0.02
"""Time for a whole answer: ten times the wire time of the longest at 250 kbit/s."""
CHECK_S = 1.0  # Time between two checks that the sensor still uses its calibration
AFTER_RESTART = 0  # The calibration a sensor uses after a restart


class AtiCan(PolledDevice):
    """One force/torque sensor on a CAN bus.

    Args:
        base: The sensor's base identifier, 0 to 127.
        calibration: Which of its 16 calibrations to use.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`; at 250 kbit/s it
            takes above 1 ms of the bus.
    """

    name = "ati-can"

    def __init__(
        self,
        bus: CanBus,
        base: Annotated[int, Field(ge=0, le=127)] = protocol.DEFAULT_BASE,
        calibration: Annotated[int, Field(ge=0, le=15)] = 0,
        rate_hz: RateOption = 200.0,
    ) -> None:
        if not 0 <= base <= protocol.HIGHEST_BASE:
            raise ValueError(f"a base identifier lies in 0..127, not {base}")
        if not 0 <= calibration <= 15:
            raise ValueError(f"a calibration has a number 0..15, not {calibration}")
        super().__init__(bus, rate_hz)
        self._bus = bus
        self._base = base
        self._calibration = calibration
        self._matrix: NDArray[np.float64] | None = None
        self._unit_per_count = np.ones(6)
        self._check_at_s = -np.inf
        self._axis = 0
        self._fallen_back = False
        self.bias = np.zeros(protocol.GAUGES)
        """Readings taken for no load, counts, shape (6,)."""
        self.status = 0
        """Status word of the newest reading; `protocol.status_words` puts it in words."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Three forces and three torques; their range is known once the calibration is."""
        tops = np.full(6, np.inf)
        if self._matrix is not None:
            reach = np.abs(self._matrix) @ (2.0**15 + np.abs(self.bias))
            tops = reach * self._unit_per_count
        return wrench_channels(self._rate_hz, tops.tolist())

    @property
    def counters(self) -> dict[str, int]:
        """Counters of this sensor's frames, and of the bus."""
        return super().counters | asdict(self._bus.counters)

    def identify(self) -> DeviceIdentity:
        """Ask for serial number and firmware, and read the calibration.

        Raises:
            FrameError: The answer is not of a NETCANOEM, or its calibration is empty.
        """
        version = protocol.decode_firmware(self._ask(protocol.FIRMWARE)[0])
        serial = protocol.decode_serial(self._ask(protocol.SERIAL)[0])
        self._choose_calibration()
        self._unit_per_count = self._read_units(version[:2])
        rows = [
            protocol.decode_matrix_row(self._ask(protocol.MATRIX_ROW, bytes([axis]), 3))
            for axis in range(6)
        ]
        self._matrix = np.array(rows)
        self._identified = True
        major, minor, build = version
        return DeviceIdentity("ATI NETCANOEM", serial, f"{major}.{minor}.{build}")

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        if self._matrix is not None and self._calibration != AFTER_RESTART:
            self._choose_calibration()
        super().start()
        self._check_at_s = self._bus.now_s + CHECK_S

    def sample(self) -> tuple[Sequence[float], int]:
        """Ask for the wrench.

        A saturated gauge makes the whole wrench wrong: it is flagged `SATURATED` and `SUSPECT`.

        Raises:
            DriverError: The sensor has restarted and does not use the calibration that was chosen;
                every reading says so until `start`.
        """
        assert self._matrix is not None  # noqa: S101 - read by `identify`
        try:
            if self._calibration != AFTER_RESTART and self._bus.now_s >= self._check_at_s:
                self._require_calibration(self._matrix)
            gauges = self._read_gauges()
        except LinkTimeoutError:
            self._check_at_s = -np.inf  # it may be silent because it restarts
            raise
        wrench = (self._matrix @ (gauges - self.bias)) * self._unit_per_count
        return wrench.tolist(), self._flag(gauges)

    def set_bias(self, readings: int = 16) -> None:
        """Take the present load for zero: the mean of some readings, kept in this program.

        Raises:
            DriverError: A gauge is saturated, or the sensor reports that its readings are unusable.
            LinkTimeoutError: The sensor does not answer.
        """
        taken = []
        for _ in range(readings):
            gauges = self._read_gauges()
            if self._flag(gauges):
                said = ", ".join(protocol.status_words(self.status)) or "a gauge is saturated"
                raise DriverError(
                    "The sensor cannot be zeroed.",
                    f"Reported status: {said}.",
                    "Take the load off it.",
                )
            taken.append(gauges)
        self.bias = np.mean(taken, axis=0, dtype=np.float64)

    def _choose_calibration(self) -> None:
        """Let the sensor use the calibration; it forgets it at a restart."""
        chosen = bytes([self._calibration])
        if self._ask(protocol.CALIBRATION, chosen)[0] != chosen:
            raise FrameError(f"The sensor does not use its calibration {self._calibration}.")
        self._fallen_back = False

    def _require_calibration(self, matrix: NDArray[np.float64]) -> None:
        """Hold a row of the matrix in use against the one read at the start, each time the next.

        The calibration in use cannot be read: the request that selects it also sets it.
        """
        row = protocol.decode_matrix_row(self._ask(protocol.MATRIX_ROW, bytes([self._axis]), 3))
        if np.array_equal(row, matrix[self._axis]):
            self._axis = (self._axis + 1) % 6
            self._check_at_s = self._bus.now_s + CHECK_S
            return
        if not self._fallen_back:
            self._counters.restarts += 1
        self._fallen_back = True
        raise DriverError(
            f"The sensor at {self._bus.url}, base {self._base:#x}, does not use its calibration"
            f" {self._calibration} any more.",
            f"It has restarted, after which it uses calibration {AFTER_RESTART}."
            f" Up to {CHECK_S:g} s of readings before this one are wrong.",
            "Check its supply, then start again: the calibration is then selected again.",
        )

    def _read_gauges(self) -> NDArray[np.int16]:
        self.status, gauges = protocol.decode_reading(*self._ask(protocol.READ, b"", 2))
        return gauges

    def _read_units(self, version: tuple[int, int]) -> NDArray[np.float64]:
        if version < protocol.TELLS_UNITS:
            return np.full(6, 1.0 / protocol.ASSUMED_COUNTS_PER_UNIT)
        force, torque = protocol.decode_counts_per_unit(self._ask(protocol.COUNTS_PER_UNIT)[0])
        codes = self._ask(protocol.UNIT_CODES)[0]
        if len(codes) != 2 or codes[0] not in N_PER_UNIT or codes[1] not in N_M_PER_UNIT:
            raise FrameError(f"The sensor's units have the unknown codes {codes.hex(' ')}.")
        return Calibration(codes[0], codes[1], force, torque).slopes()

    def _flag(self, gauges: NDArray[np.int16]) -> int:
        if protocol.is_saturated(gauges):
            self._counters.device_errors += 1
            return int(SampleFlag.SATURATED | SampleFlag.SUSPECT)
        if self.status & protocol.UNUSABLE:
            self._counters.device_errors += 1
            return int(SampleFlag.SUSPECT)
        return 0

    def idle(self, wait_s: float) -> None:
        """Let time pass; a frame of this sensor that comes unasked is late, and dropped."""
        end_s = self._bus.now_s + wait_s
        while True:
            frame = self._bus.read(max(0.0, end_s - self._bus.now_s))
            if frame is None:
                return
            if not frame.extended and frame.can_id >> 4 == self._base:
                self._counters.late += 1

    def _ask(self, operation: int, data: bytes = b"", frames: int = 1) -> list[bytes]:
        question = protocol.request(self._base, operation, data)
        for _ in self._counters.attempts():
            self.idle(0.0)
            self._bus.send(question)
            answer = self._receive(operation, frames)
            if answer is not None:
                return answer
        raise LinkTimeoutError(
            f"No NETCANOEM answers at {self._bus.url}, base {self._base:#x}.",
            f"{TRIES} requests of operation {operation:#x} had {REPLY_TIMEOUT_S:g} s each.",
            "Check its supply, the bit rate (250 kbit/s unless changed), terminators and base.",
        )

    def _receive(self, operation: int, frames: int) -> list[bytes] | None:
        """Return an answer's frames, None when they do not all come in time and in order."""
        first = protocol.identifier(self._base, operation)
        answer: list[bytes] = []
        for remaining_s in time_left(self._bus, REPLY_TIMEOUT_S):
            frame = self._bus.read(remaining_s)
            if frame is None:
                return None
            if frame.extended or frame.can_id >> 4 != self._base:
                continue  # of another device
            if frame.can_id == first:
                if answer:
                    self._counters.late += 1  # that was another request's: start again
                answer = [frame.data]
            elif answer and frame.can_id == first + len(answer):
                answer.append(frame.data)
            else:
                self._counters.late += 1
            if len(answer) == frames:
                return answer
        return None


def _identifiers(options: Mapping[str, Any]) -> frozenset[int]:
    return frozenset(range(options["base"] << 4, (options["base"] << 4) + 16))


DRIVER = Driver(
    "ati-can",
    "ATI force/torque sensor on CAN (NETCANOEM)",
    opener(AtiCan, "NETCANOEM", open_can),
    CanUse(_identifiers, 250_000),
)
