"""The driver of a Dynamixel X: current commanded, and angle, speed and current read, at a rate.

Nothing runs in the background. While the host reads, its questions feed the device's bus watchdog;
when they stop, the device takes its motor out of force by itself.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.counters import DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity, SampleFlag
from drivers.dynamixel import protocol
from drivers.dynamixel.line import InstructionRefusedError, Line
from drivers.dynamixel.protocol import Present
from drivers.errors import (
    DisarmUnconfirmedError,
    DriverError,
    FrameError,
    LinkError,
    LinkTimeoutError,
)
from drivers.polling import PollSchedule
from drivers.registry import BaudOption, Driver, RateOption
from drivers.transport.serial_port import open_line
from drivers.transport.transport import Transport

LONGEST_WATCHDOG_MS = 127 * protocol.WATCHDOG_UNIT_MS


class Dynamixel:
    """One drive on a serial line. Nothing else on the line may be asked at the same time.

    Args:
        transport: The way to the line; the device closes it.
        device_id: The drive's identifier.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        watchdog_ms: Silence after which an armed drive stops by itself, in steps of 20 ms.
        current_unit_a: Amperes a unit of current; 0 for what the model's e-Manual says.
    """

    name = "dynamixel"

    def __init__(
        self,
        transport: Transport,
        device_id: int = 1,
        rate_hz: float = 100.0,
        watchdog_ms: int = 200,
        current_unit_a: float = 0.0,
    ) -> None:
        if not 0 <= device_id <= protocol.HIGHEST_ID:
            raise ValueError(f"an identifier lies in 0..{protocol.HIGHEST_ID}, not {device_id}")
        if not protocol.WATCHDOG_UNIT_MS <= watchdog_ms <= LONGEST_WATCHDOG_MS:
            raise ValueError(f"a watchdog has 20 to {LONGEST_WATCHDOG_MS} ms, not {watchdog_ms}")
        self._transport = transport
        self._id = device_id
        self._rate_hz = rate_hz
        self._watchdog = watchdog_ms // protocol.WATCHDOG_UNIT_MS
        self._unit_a = current_unit_a
        self._counters = DeviceCounters()
        self._line = Line(transport, device_id, self._counters)
        self._schedule = PollSchedule(rate_hz, self._counters)
        self._schedule.restart(transport.now_s)
        self._limit_a = math.inf
        self._identified = self._armed = self._may_be_armed = self._closed = False
        self._goal = 0

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Angle, speed and current, the current commanded, supply and temperature."""
        rate = self._rate_hz
        top_a = 2.0**15 * self._unit_a if self._unit_a else math.inf
        top_rad, top_rad_s = (2.0**31 * k for k in (protocol.RAD_PER_COUNT, _SPEED))
        return (
            Channel("angle_rad", "rad", rate, -top_rad, top_rad, "horn, over all turns"),
            Channel("speed_rad_s", "rad/s", rate, -top_rad_s, top_rad_s, "horn"),
            Channel("current_a", "A", rate, -top_a, top_a, "motor"),
            Channel("command_current_a", "A", rate, -top_a, top_a, "current commanded"),
            Channel("supply_v", "V", rate, 0.0, 6553.5, "supply"),
            Channel("temperature_k", "K", rate, _ZERO_K, _ZERO_K + 255.0, "inside the drive"),
        )

    @property
    def counters(self) -> dict[str, int]:
        """What happened on the line."""
        return self._counters.as_dict()

    @property
    def current_limit_a(self) -> float:
        """The drive's current limit, infinite before `identify`."""
        return self._limit_a

    def identify(self) -> DeviceIdentity:
        """Ask for model and firmware, and read the current limit.

        Raises:
            LinkTimeoutError: Nobody answers.
            DriverError: The model is not known, or controls no current.
        """
        number, firmware = protocol.decode_ping(self._line.ask(protocol.PING))
        if self._unit_a:
            name = protocol.MODELS.get(number, (f"model {number}", 0.0))[0]
        else:
            name, self._unit_a = protocol.model_of(number)
        self._limit_a = self._line.read_number(protocol.CURRENT_LIMIT) * self._unit_a
        self._identified = True
        return DeviceIdentity(f"Dynamixel {name}", "", str(firmware))

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        if not self._identified:
            self.identify()
        self._line.discard()
        self._schedule.restart(self._transport.now_s)

    def arm(self) -> None:
        """Put the motor in force in current control, its goal 0, watched by the drive.

        Raises:
            DriverError: The drive has a hardware error, or does not hold what was written.
        """
        if not self._identified:
            raise DriverError("The drive is not started.", fix="Call start first.")
        self.disarm()
        self._require_no_error()
        self._write_and_check(protocol.BUS_WATCHDOG, 0)  # what it tripped over is over
        self._write_and_check(protocol.OPERATING_MODE, protocol.CURRENT_MODE)
        self._goal = 0
        self._write_and_check(protocol.GOAL_CURRENT, 0)
        self._may_be_armed = True
        self._write_and_check(protocol.TORQUE_ENABLE, 1)
        self._write_and_check(protocol.BUS_WATCHDOG, self._watchdog)
        self._armed = True

    def set_current(self, current_a: float) -> float:
        """Command a motor current, sent before the next reading and every one from then on.

        Returns:
            The current that is sent: the nearest multiple of the model's unit.

        Raises:
            DriverError: Not armed, not finite, or beyond the drive's current limit.
        """
        if not self._armed:
            raise DriverError("The drive is not armed.", fix="Call arm first.")
        if not math.isfinite(current_a) or abs(current_a) > self._limit_a:
            raise DriverError(
                f"A current of {current_a:g} A cannot be commanded.",
                f"The drive's limit is {self._limit_a:g} A.",
                "Command less, or raise the limit (register 38) if motor and rig allow.",
            )
        self._goal = round(current_a / self._unit_a)
        return self._goal * self._unit_a

    def read(self, timeout_s: float) -> Batch:
        """Command and ask when the next sample is due, and return it if the drive answers.

        Raises:
            DriverError: An armed drive has a hardware error, or its watchdog has tripped; said
                once. Or neither `identify` nor `start` has been called.
        """
        if not self._identified:
            raise DriverError("The drive is not known.", fix="Call start first.")
        wait_s = self._schedule.wait_s(self._transport.now_s)
        late = self._transport.read(max(0.0, min(wait_s, timeout_s)))
        self._counters.discarded_bytes += len(late)
        now_s = self._transport.now_s
        if self._schedule.wait_s(now_s) > 0:
            return self._batch(None)
        self._schedule.skip_missed(now_s)
        try:
            if self._armed:
                self._command()
            present = protocol.decode_present(self._line.read(protocol.PRESENT))
        except (LinkTimeoutError, FrameError):
            self._schedule.lose()
            return self._batch(None)
        self._schedule.asked += 1
        self._counters.frames += 1
        if self._line.alert:
            self._counters.device_errors += 1
            if self._armed:
                self._armed = False
                self._require_no_error()
        return self._batch(present)

    def clear_fault(self) -> None:
        """Restart the drive, which is the way out of a hardware error; it is out of force then."""
        self.disarm()
        self._line.ask(protocol.REBOOT)

    def disarm(self) -> None:
        """Take the motor out of force, and return when the drive has said that it is.

        Raises:
            DisarmUnconfirmedError: It has not said so; its state is unknown.
        """
        self._armed = False
        self._goal = 0
        try:
            self._write_and_check(protocol.TORQUE_ENABLE, 0)
        except DriverError as error:
            raise DisarmUnconfirmedError(
                f"The Dynamixel {self._id} at {self._transport.url} has not confirmed that its"
                " motor is out of force.",
                str(error),
                "Take the motor for live and cut its supply. A working drive stops by itself"
                f" {self._watchdog * protocol.WATCHDOG_UNIT_MS} ms after the last question.",
            ) from error
        self._may_be_armed = False

    def stop(self) -> None:
        """Disarm where the drive may be armed; one that is not asked is silent.

        Raises:
            DisarmUnconfirmedError: The drive's state is unknown.
        """
        if self._may_be_armed:
            self.disarm()

    def close(self) -> None:
        """Disarm where the drive may be armed, and let go of the line.

        Raises:
            DisarmUnconfirmedError: The line is closed, but the drive's state is unknown.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self.stop()
        finally:
            self._transport.close()

    def _command(self) -> None:
        try:
            self._line.write(protocol.GOAL_CURRENT, self._goal)
        except InstructionRefusedError as error:
            self._armed = False
            if self._line.read_number(protocol.BUS_WATCHDOG) == protocol.WATCHDOG_TRIPPED:
                raise DriverError(
                    f"The Dynamixel {self._id} has stopped by itself.",
                    "Its bus watchdog heard no question for too long.",
                    "Check that the program reads without pauses, and the cable; then arm again.",
                ) from error
            raise

    def _require_no_error(self) -> None:
        bits = self._line.read_number(protocol.HARDWARE_ERROR)
        words = [text for bit, text in protocol.HARDWARE_ERRORS.items() if bits >> bit & 1]
        if bits:
            raise DriverError(
                f"The Dynamixel {self._id} has a hardware error: {'; '.join(words) or hex(bits)}.",
                "It has taken its motor out of force where its register 63 says so.",
                "Remove the cause, restart the drive (clear_fault), then arm again.",
            )

    def _write_and_check(self, register: protocol.Register, value: int) -> None:
        self._line.write(register, value)
        found = self._line.read_number(register)
        if found != value:
            raise DriverError(
                f"The Dynamixel {self._id} holds {found} in register {register.address}, not the"
                f" {value} that was written.",
                fix="Check its firmware and its hardware error.",
            )

    def _batch(self, present: Present | None) -> Batch:
        count = 0 if present is None else 1
        p = present or Present(0, 0, 0, 0, 0)
        values = (
            p.position * protocol.RAD_PER_COUNT,
            p.velocity * _SPEED,
            p.current * self._unit_a,
            self._goal * self._unit_a,
            0.1 * p.voltage,
            p.temperature + _ZERO_K,
        )
        names = (channel.name for channel in self.channels)
        flag = SampleFlag.SUSPECT if self._line.alert else 0
        return Batch(
            {name: np.full(count, value) for name, value in zip(names, values, strict=True)},
            np.full(count, self._transport.now_s),
            "host",
            np.full(count, self._schedule.asked - 1, np.int64),
            np.full(count, flag, np.uint8),
            self._schedule.lost,
        )


_SPEED = protocol.RAD_S_PER_COUNT
_ZERO_K = 273.15


def open_dynamixel(
    url: str,
    device_id: Annotated[int, Field(ge=0, le=protocol.HIGHEST_ID)] = 1,
    rate_hz: RateOption = 100.0,
    baud_rate: BaudOption = 57_600,
    watchdog_ms: Annotated[int, Field(ge=20, le=LONGEST_WATCHDOG_MS)] = 200,
    current_unit_a: Annotated[float, Field(ge=0, le=0.1)] = 0.0,
) -> Dynamixel:
    """Open the drive on a serial adapter.

    Args:
        url: The adapter.
        device_id: The drive's identifier, 0 to 252.
        rate_hz: How often it is asked.
        baud_rate: 57600 from the factory.
        watchdog_ms: Silence after which an armed drive stops by itself.
        current_unit_a: Amperes a unit of current; 0 for what the model's e-Manual says.

    Raises:
        LinkError: The adapter cannot be opened, or the options are no drive's.
    """
    line = open_line(url, baud_rate)
    try:
        return Dynamixel(line, device_id, rate_hz, watchdog_ms, current_unit_a)
    except ValueError as error:
        line.close()
        raise LinkError(f"No Dynamixel can be driven so: {error}.") from error


DRIVER = Driver("dynamixel", "ROBOTIS Dynamixel X servo, Protocol 2.0", open_dynamixel)
