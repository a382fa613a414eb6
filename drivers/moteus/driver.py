"""The driver of a moteus: a torque commanded, and angle, speed and torque read, at a rate.

Nothing runs in the background. Each command is valid for a time; when no further one comes, the
controller enters its timeout mode by itself.
"""

import math
from collections.abc import Callable, Sequence
from typing import Annotated, TypeVar

from pydantic import Field

from drivers.counters import DeviceCounters, silent
from drivers.device import Axis, Channel, DeviceIdentity, SampleFlag
from drivers.errors import DriverError, FrameError, LinkTimeoutError
from drivers.moteus import protocol
from drivers.moteus.protocol import State
from drivers.polling import PolledDrive
from drivers.registry import Driver, RateOption, opener
from drivers.transport import open_transport
from drivers.transport.transport import Transport, time_left

REPLY_TIMEOUT_S = 0.02
"""Time for an answer: below a millisecond on the bus, and what USB takes."""
T = TypeVar("T")
STARTS_S = 1.0
"""Time to get into position mode: it measures its current sensors first."""
_ZERO_K = 273.15


class FdcanusbLink:
    """Questions to one controller and its answers, as lines of an fdcanusb."""

    def __init__(self, transport: Transport, device_id: int, counters: DeviceCounters) -> None:
        self._transport = transport
        self._id = device_id
        self._counters = counters
        self._held = b""

    def ask(self, data: bytes, decode: Callable[[bytes], T]) -> T:
        """Send subframes and return the answer as decoded; one that cannot be is asked for again.

        Raises:
            LinkTimeoutError: Nobody answers.
        """
        line = protocol.send_line(self._id, data)
        for _ in self._counters.attempts():
            self.discard()
            self._transport.write(line)
            answer = self._receive()
            if answer is None:
                continue
            try:
                return decode(answer)
            except FrameError:
                self._counters.crc_errors += 1
        where = f"{self._transport.url}, identifier {self._id}"
        check = "Check its supply, the identifier, and both terminators of the bus."
        raise silent("moteus", where, REPLY_TIMEOUT_S, check)

    def discard(self, wait_s: float = 0.0) -> None:
        """Drop what comes unasked in a time: it is late."""
        late = self._held + self._transport.read(wait_s)
        self._counters.discarded_bytes += len(late)
        self._held = b""

    def _receive(self) -> bytes | None:
        """Return the data of the controller's next frame, None when none comes in time."""
        wanted = self._id << 8 | protocol.HOST
        for remaining_s in time_left(self._transport, REPLY_TIMEOUT_S):
            self._held += self._transport.read(remaining_s)
            while b"\n" in self._held:
                line, _, self._held = self._held.partition(b"\n")
                try:
                    frame = protocol.decode_line(line)
                except FrameError:
                    self._counters.crc_errors += 1
                    self._counters.discarded_bytes += len(line)
                    continue
                if frame is not None and frame[0] == wanted:
                    return frame[1]
            if len(self._held) > protocol.LONGEST_LINE:
                self._counters.discarded_bytes += len(self._held)
                self._held = b""
        return None


class Moteus(PolledDrive):
    """One controller behind an fdcanusb. Nothing else on the bus may be asked at the same time.

    Args:
        device_id: The controller's identifier.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        torque_limit_n_m: The most it may be commanded, at the output.
        watchdog_s: How long a command is valid.
    """

    name = "moteus"
    axis = Axis("angle_rad", 1e-4, "current_a")

    def __init__(
        self,
        transport: Transport,
        device_id: Annotated[int, Field(ge=1, le=protocol.HIGHEST_ID)] = 1,
        rate_hz: RateOption = 200.0,
        torque_limit_n_m: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.1,
        watchdog_s: Annotated[float, Field(gt=0, le=1)] = 0.1,
    ) -> None:
        if not 1 <= device_id <= protocol.HIGHEST_ID:
            raise ValueError(f"an identifier lies in 1..{protocol.HIGHEST_ID}, not {device_id}")
        if not (0 < torque_limit_n_m < math.inf and 0 < watchdog_s < math.inf):
            raise ValueError("torque limit and watchdog are above 0")
        super().__init__(
            transport,
            rate_hz,
            f"moteus {device_id} at {transport.url}",
            "A working controller enters its timeout mode"
            f" {watchdog_s:g} s after the last command.",
        )
        self._transport = transport
        self._id = device_id
        self._limit_n_m = torque_limit_n_m
        self._watchdog_s = watchdog_s
        self._link = FdcanusbLink(transport, device_id, self._counters)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Angle, speed and torque of the output, torque commanded, supply and temperature."""
        rate, limit = self._rate_hz, self._limit_n_m
        every = (-math.inf, math.inf)
        return (
            Channel("angle_rad", "rad", rate, *every, "output, over all turns"),
            Channel("speed_rad_s", "rad/s", rate, *every, "output"),
            Channel("torque_n_m", "N m", rate, *every, "output, by the motor's current"),
            Channel("current_a", "A", rate, *every, "motor, in quadrature"),
            Channel("command_torque_n_m", "N m", rate, -limit, limit, "torque commanded"),
            Channel("supply_v", "V", rate, -64.0, 63.5, "supply"),
            Channel("temperature_k", "K", rate, _ZERO_K - 128, _ZERO_K + 127, "board"),
        )

    def identify(self) -> DeviceIdentity:
        """Ask for model, firmware and serial number; FrameError of another device."""
        question = protocol.read(protocol.INT32, protocol.MODEL, 2)
        question += protocol.read(protocol.INT32, protocol.SERIAL, 3)
        found = self._link.ask(question, protocol.registers)
        wanted = [protocol.MODEL, protocol.MODEL + 1, *(protocol.SERIAL + k for k in range(3))]
        if not all(register in found for register in wanted):
            raise FrameError(f"What answers as identifier {self._id} is not a moteus.")
        model, firmware, *serial = (int(found[register]) & 0xFFFFFFFF for register in wanted)
        self._identified = True
        text = "".join(f"{part:08x}" for part in reversed(serial))
        return DeviceIdentity(f"moteus {model:#06x}", text, f"{firmware:#08x}")

    def energise(self) -> None:
        """Energise the motor without torque; it measures its current sensors first.

        Raises:
            DriverError: It does not get into operation.
        """
        give_up_s = self._transport.now_s + STARTS_S
        while True:
            state = self._exchange(self._position_command())
            if state.mode == protocol.POSITION_MODE:
                return
            if state.mode not in protocol.PREPARING:
                raise self._out_of_operation(state)
            if self._transport.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"The moteus {self._id} does not get into operation.",
                    f"It is still in mode {state.mode} after {STARTS_S:g} s.",
                )
            self._transport.read(1e-3)

    def release(self) -> None:
        """Stop the controller, which clears a fault (`DriverError`: it is not stopped)."""
        state = self._exchange(protocol.stop_command())
        if state.mode != protocol.STOPPED:
            raise DriverError(f"It is in mode {state.mode}.")

    def command(self, ratio: float) -> None:
        """Command a share of the torque limit, as `set_torque`."""
        self.set_torque(ratio * self._limit_n_m)

    def set_torque(self, torque_n_m: float) -> float:
        """Command a torque at the output, sent with every question from the next one on.

        Raises:
            DriverError: Not armed, not finite, or beyond the limit.
        """
        self.require(torque_n_m, self._limit_n_m, "N m")
        self._goal = torque_n_m
        return torque_n_m

    def idle(self, wait_s: float) -> None:
        """Let time pass; what comes unasked is late, and dropped."""
        self._link.discard(wait_s)

    def sample(self) -> tuple[Sequence[float], int]:
        """Command an armed controller, and ask for what it measures.

        Raises:
            DriverError: An armed controller has a fault, has timed out or was stopped; said once.
        """
        state = self._exchange(self._position_command() if self._armed else b"")
        if state.mode == protocol.FAULT:
            self._counters.device_errors += 1
        if self._armed and state.mode != protocol.POSITION_MODE:
            self._armed = False
            raise self._out_of_operation(state)
        values = (
            2 * math.pi * state.position_rev,
            2 * math.pi * state.velocity_rev_s,
            state.torque_n_m,
            state.current_a,
            self._goal,
            protocol.VOLTS_A_UNIT * state.voltage,
            state.temperature + _ZERO_K,
        )
        return values, SampleFlag.SUSPECT if state.mode == protocol.FAULT else 0

    def _position_command(self) -> bytes:
        return protocol.torque_command(self._goal, self._limit_n_m, self._watchdog_s)

    def _exchange(self, command: bytes) -> State:
        return self._link.ask(command + protocol.STATE_QUESTION, protocol.decode_state)

    def _out_of_operation(self, state: State) -> DriverError:
        """Return the error of a mode in which the torque commanded is not applied."""
        if state.mode == protocol.FAULT:
            what = protocol.FAULTS.get(state.fault, "a fault this program does not know")
            return DriverError(
                f"The moteus {self._id} has a fault: {what} (code {state.fault}).",
                "Its motor is out of force.",
                "Remove the cause, then arm again: that clears it.",
            )
        if state.mode == protocol.TIMEOUT:
            return DriverError(
                f"The moteus {self._id} has timed out and damps its motor.",
                f"It heard no command for {self._watchdog_s:g} s.",
                "Check that the program reads without pauses, and the cable; then arm again.",
            )
        return DriverError(
            f"The moteus {self._id} has left operation and is in mode {state.mode}.",
            "Another program commands it, or it was restarted. It is commanded no more from here.",
            "Find out why, then arm again.",
        )


DRIVER = Driver(
    "moteus",
    "mjbots moteus brushless controller, by fdcanusb",
    opener(Moteus, "moteus", open_transport),
)
"""Its URL is the fdcanusb's port."""
