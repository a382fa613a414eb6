"""The driver of a Dynamixel X: current commanded, and angle, speed and current read, at a rate.

Nothing runs in the background. While the host reads, its questions feed the device's bus watchdog;
when they stop, the device takes its motor out of force by itself.
"""

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from drivers.counters import DeviceCounters, silent
from drivers.device import Axis, Channel, DeviceIdentity, SampleFlag
from drivers.dynamixel import protocol
from drivers.dynamixel.protocol import Register
from drivers.errors import CodedError, DriverError, FrameError
from drivers.polling import PolledDrive
from drivers.registry import Driver, RateOption, opener
from drivers.transport.transport import Transport, time_left

REPLY_TIMEOUT_S = 0.02
"""Time for an answer: 500 us at most in the device, and what a USB adapter takes."""
LONGEST_WATCHDOG_MS = 127 * protocol.WATCHDOG_UNIT_MS


class InstructionRefusedError(CodedError):
    """The device has refused an instruction; `code` is its reason, a key of `protocol.ERRORS`."""


class Line:
    """One device on a half-duplex line; each question is asked again when its answer is bad."""

    def __init__(self, transport: Transport, device_id: int, counters: DeviceCounters) -> None:
        self._transport = transport
        self._id = device_id
        self._counters = counters
        self.alert = False
        """Whether the newest answer says that the device has a hardware error."""

    def read(self, register: Register) -> bytes:
        """Return the value of a register (`InstructionRefusedError`: the device refuses)."""
        return self.ask(protocol.READ, protocol.read_question(register))

    def read_number(self, register: Register) -> int:
        """Return the number, 0 or above, that a register holds; raises as `read`."""
        return int.from_bytes(self.read(register), "little")

    def write(self, register: Register, value: int) -> None:
        """Write a number to a register; raises as `read`."""
        self.ask(protocol.WRITE, protocol.write_question(register, value))

    def ask(self, instruction: int, parameters: bytes = b"") -> bytes:
        """Return the parameters of the answer to an instruction; raises as `read`."""
        request = protocol.encode(self._id, instruction, parameters)
        for _ in self._counters.attempts():
            self.discard()
            self._transport.write(request)
            answer = self._receive()
            if answer is not None:
                return self._checked(answer, instruction)
        where = f"{self._transport.url}, identifier {self._id}"
        check = "Check its supply, the identifier and the bit rate (57600 from the factory)."
        raise silent("Dynamixel", where, REPLY_TIMEOUT_S, check)

    def discard(self, wait_s: float = 0.0) -> None:
        """Drop what comes unasked in a time: it is late."""
        self._counters.discarded_bytes += len(self._transport.read(wait_s))

    def _receive(self) -> bytes | None:
        """Return error and parameters of the next status packet, None when none comes in time."""
        came = b""
        for remaining_s in time_left(self._transport, REPLY_TIMEOUT_S):
            came += self._transport.read(remaining_s)
            while (found := protocol.find(came)) is not None:
                packet, came = found
                try:
                    device_id, instruction, body = protocol.decode(packet)
                except FrameError:
                    self._counters.crc_errors += 1
                    self._counters.discarded_bytes += len(packet)
                    return None
                if device_id == self._id and instruction == protocol.STATUS and body:
                    self._counters.discarded_bytes += len(came)
                    return body
                # else it is an adapter's echo, or another device's
        if came:
            self._counters.crc_errors += 1  # bytes of it are missing
            self._counters.discarded_bytes += len(came)
        return None

    def _checked(self, body: bytes, instruction: int) -> bytes:
        self.alert = bool(body[0] & protocol.ALERT)
        number = body[0] & ~protocol.ALERT
        if number:
            raise InstructionRefusedError(
                f"The Dynamixel {self._id} has refused instruction {instruction:#04x}.",
                f"Its reason: {protocol.ERRORS.get(number, f'number {number}')}.",
                "Check its operating mode and limits, and whether its bus watchdog has tripped.",
                number,
            )
        return body[1:]


class Dynamixel(PolledDrive):
    """One drive on a serial line. Nothing else on the line may be asked at the same time.

    Args:
        device_id: The drive's identifier.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        watchdog_ms: Silence after which an armed drive stops by itself, in steps of 20 ms.
        current_unit_a: Amperes a unit of current; 0 for what the model's e-Manual says.
    """

    name = "dynamixel"
    axis = Axis("angle_rad", 1e-4, "current_a")

    def __init__(
        self,
        transport: Transport,
        device_id: Annotated[int, Field(ge=0, le=protocol.HIGHEST_ID)] = 1,
        rate_hz: RateOption = 100.0,
        watchdog_ms: Annotated[int, Field(ge=20, le=LONGEST_WATCHDOG_MS)] = 200,
        current_unit_a: Annotated[float, Field(ge=0, le=0.1)] = 0.0,
    ) -> None:
        if not 0 <= device_id <= protocol.HIGHEST_ID:
            raise ValueError(f"an identifier lies in 0..{protocol.HIGHEST_ID}, not {device_id}")
        if not protocol.WATCHDOG_UNIT_MS <= watchdog_ms <= LONGEST_WATCHDOG_MS:
            raise ValueError(f"a watchdog has 20 to {LONGEST_WATCHDOG_MS} ms, not {watchdog_ms}")
        watchdog = watchdog_ms // protocol.WATCHDOG_UNIT_MS
        super().__init__(
            transport,
            rate_hz,
            f"Dynamixel {device_id} at {transport.url}",
            f"A working drive stops by itself {watchdog * protocol.WATCHDOG_UNIT_MS} ms after the"
            " last question.",
        )
        self._transport = transport
        self._id = device_id
        self._watchdog = watchdog
        self._unit_a = current_unit_a
        self._line = Line(transport, device_id, self._counters)
        self._limit_a = math.inf

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
    def current_limit_a(self) -> float:
        """The drive's current limit, infinite before `identify`."""
        return self._limit_a

    def identify(self) -> DeviceIdentity:
        """Ask for model and firmware, and read the current limit.

        Raises:
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

    def energise(self) -> None:
        """Energise the motor in current control, its goal 0, watched by the drive.

        Raises:
            DriverError: The drive has a hardware error, or does not hold what was written.
        """
        self._require_no_error()
        self._write_and_check(protocol.BUS_WATCHDOG, 0)  # what it tripped over is over
        self._write_and_check(protocol.OPERATING_MODE, protocol.CURRENT_MODE)
        self._write_and_check(protocol.GOAL_CURRENT, 0)
        self._write_and_check(protocol.TORQUE_ENABLE, 1)
        self._write_and_check(protocol.BUS_WATCHDOG, self._watchdog)

    def release(self) -> None:
        """Take the motor out of force, and read it back."""
        self._write_and_check(protocol.TORQUE_ENABLE, 0)

    def command(self, ratio: float) -> None:
        """Command a share of the drive's current limit, as `set_current`."""
        self.set_current(ratio * self._limit_a)

    def set_current(self, current_a: float) -> float:
        """Command a motor current, sent before the next reading and every one from then on.

        Returns the current that is sent: the nearest multiple of the model's unit.

        Raises:
            DriverError: Not armed, not finite, or beyond the drive's current limit.
        """
        self.require(current_a, self._limit_a, "A")
        self._goal = round(current_a / self._unit_a)
        return self._goal * self._unit_a

    def idle(self, wait_s: float) -> None:
        """Let time pass; what comes unasked is late, and dropped."""
        self._line.discard(wait_s)

    def sample(self) -> tuple[Sequence[float], int]:
        """Command an armed drive, and ask for what it measures.

        Raises:
            DriverError: An armed drive has a hardware error, or its watchdog has tripped; said
                once.
        """
        if self._armed:
            self._send_goal()
        present = protocol.decode_present(self._line.read(protocol.PRESENT))
        if self._line.alert:
            self._counters.device_errors += 1
            if self._armed:
                self._armed = False
                self._require_no_error()
        values = (
            present.position * protocol.RAD_PER_COUNT,
            present.velocity * _SPEED,
            present.current * self._unit_a,
            self._goal * self._unit_a,
            0.1 * present.voltage,
            present.temperature + _ZERO_K,
        )
        return values, SampleFlag.SUSPECT if self._line.alert else 0

    def clear_fault(self) -> None:
        """Restart the drive, which is the way out of a hardware error; it is out of force then."""
        self.disarm()
        self._line.ask(protocol.REBOOT)

    def _send_goal(self) -> None:
        try:
            self._line.write(protocol.GOAL_CURRENT, round(self._goal))
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

    def _write_and_check(self, register: Register, value: int) -> None:
        self._line.write(register, value)
        found = self._line.read_number(register)
        if found != value:
            raise DriverError(
                f"The Dynamixel {self._id} holds {found} in register {register.address}, not the"
                f" {value} that was written.",
                fix="Check its firmware and its hardware error.",
            )


_SPEED = protocol.RAD_S_PER_COUNT
_ZERO_K = 273.15


DRIVER = Driver(
    "dynamixel",
    "ROBOTIS Dynamixel X servo, Protocol 2.0",
    opener(Dynamixel, "Dynamixel", baud_rate=57_600),
)
"""The bit rate is that from the factory."""
