"""The driver of a digital F/T: its calibration is read and activated, then it streams."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drivers.ati_net.protocol import N_M_PER_UNIT, N_PER_UNIT
from drivers.ati_serial import protocol
from drivers.device import DeviceIdentity, flags_of
from drivers.errors import DriverError
from drivers.modbus import StreamedSensor
from drivers.registry import Driver, RateOption, opener
from drivers.streaming import QUIET_S
from drivers.transport import open_line
from drivers.transport.transport import Transport

GAUGE_LIMIT = 32767


class AtiSerial(StreamedSensor):
    """One sensor on an RS-485 line.

    The last four may differ on one of another make-up; as they stand here they are in the public
    driver named in the README. A known weight checks them.

    Args:
        calibration: Which of its 16 calibrations to use, from 1.
        rate_hz: Frames a second it sends.
        matrix_by_rows: The calibration's matrix comes row by row, Fx first; else column by column.
        force_unit: Code of the force unit, in place of the one read from the sensor; 0 for that.
        torque_unit: Code of the torque unit, likewise.
        lock_answers: The sensor answers the function that locks its storage (0x6A).

    Raises:
        DriverError: No such calibration.
    """

    name = "ati-serial"
    slave, title = protocol.SLAVE, "digital F/T"
    check = "Check its supply, the line, 1.25 Mbit/s and even parity."
    jam = protocol.JAM
    begin_request = protocol.encode(protocol.STREAM, protocol.START_STREAM)
    begin_answer = (protocol.STREAM, protocol.SUCCESS)
    frame_size, agree = protocol.FRAME_SIZE, 5
    frame_checks = staticmethod(protocol.frame_checks)

    def __init__(
        self,
        transport: Transport,
        calibration: Annotated[int, Field(ge=1, le=16)] = 1,
        rate_hz: RateOption = 7000.0,
        matrix_by_rows: bool = True,
        force_unit: Annotated[int, Field(ge=0, le=6)] = 0,
        torque_unit: Annotated[int, Field(ge=0, le=6)] = 0,
        lock_answers: bool = True,
    ) -> None:
        if not 1 <= calibration <= 16:
            raise DriverError(f"A digital F/T has calibrations 1 to 16, none {calibration}.")
        super().__init__(transport, rate_hz)
        self._number = calibration
        self._matrix_by_rows = matrix_by_rows
        self._units = force_unit, torque_unit
        self._lock_answers = lock_answers
        self._calibration: protocol.Calibration | None = None
        self._matrix = np.full((6, 6), np.inf)

    @property
    def tops(self) -> Sequence[float]:
        """Largest values; not known before the calibration is."""
        tops: list[float] = (np.abs(self._matrix).sum(axis=1) * (GAUGE_LIMIT + 1)).tolist()
        return tops

    def identify(self) -> DeviceIdentity:
        """End the stream and read the calibration.

        Raises:
            DriverError: The calibration is empty, or in unknown units.
        """
        self.quieten()
        first = protocol.FIRST_CALIBRATION + (self._number - 1) * protocol.CALIBRATION_STEP
        registers = b"".join(
            self.read_registers(first + offset, count) for offset, count in protocol.PIECES
        )
        told = protocol.decode_calibration(registers)
        force_unit, torque_unit = self._units
        found = replace(
            told,
            matrix=told.matrix if self._matrix_by_rows else told.matrix.T,
            force_unit=force_unit or told.force_unit,
            torque_unit=torque_unit or told.torque_unit,
        )
        if found.force_unit not in N_PER_UNIT or found.torque_unit not in N_M_PER_UNIT:
            raise DriverError(
                f"Calibration {self._number} of {found.serial} has unknown units.",
                f"Their codes are {found.force_unit} and {found.torque_unit}.",
                "Choose another calibration, or set `force_unit` and `torque_unit`.",
            )
        self._matrix = found.matrix * found.slopes()[:, np.newaxis]
        self._calibration = found
        self._identified = True
        return DeviceIdentity(f"ATI digital F/T {found.part_number}".strip(), found.serial, "")

    def prepare(self) -> None:
        """Activate the calibration's gains and offsets."""
        assert self._calibration is not None  # noqa: S101
        active = self._calibration.gains + self._calibration.offsets
        self._set_lock(protocol.UNLOCK)
        self.ask(protocol.write_registers(protocol.ACTIVE_GAINS, active))
        self._set_lock(protocol.LOCK)

    def decode(self, frames: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Return values, and which frames are suspect or saturated."""
        gauges, bad = protocol.decode_frames(frames)
        self._counters.device_errors += int(np.count_nonzero(bad))
        full = np.asarray((np.abs(gauges) >= GAUGE_LIMIT).any(axis=1))
        return gauges @ self._matrix.T, flags_of(full, bad)

    def _set_lock(self, state: bytes) -> None:
        message = protocol.encode(protocol.STORAGE, state)
        if self._lock_answers:
            answer = self.ask(message)
            if answer != protocol.SUCCESS:
                raise self.refused(protocol.STORAGE, answer)
            return
        self._transport.write(message)
        self._transport.read(QUIET_S)  # an answer all the same is let go

    def status(self) -> int:
        """Return the status register; only while it does not stream."""
        return int.from_bytes(self.read_registers(protocol.STATUS, 1), "big")


DRIVER = Driver(
    "ati-serial",
    "ATI digital F/T over RS-485, Modbus and stream",
    opener(AtiSerial, "digital F/T", partial(open_line, parity="E"), 1_250_000),
)
"""8 bits, even parity; the bit rate is as delivered, 115200 and 19200 can be set."""
