"""The driver of a moteus: a torque commanded, and angle, speed and torque read, at a rate.

Nothing runs in the background. Each command is valid for a time; when no further one comes, the
controller enters its timeout mode by itself.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.counters import DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity, SampleFlag
from drivers.errors import (
    DisarmUnconfirmedError,
    DriverError,
    FrameError,
    LinkError,
    LinkTimeoutError,
)
from drivers.moteus import protocol
from drivers.moteus.link import FdcanusbLink
from drivers.moteus.protocol import State
from drivers.polling import PollSchedule
from drivers.registry import Driver, RateOption
from drivers.transport import open_transport
from drivers.transport.transport import Transport

STARTS_S = 1.0
"""Time to get into position mode: it measures its current sensors first."""
_ZERO_K = 273.15


class Moteus:
    """One controller behind an fdcanusb. Nothing else on the bus may be asked at the same time.

    Args:
        transport: The way to the fdcanusb; the device closes it.
        device_id: The controller's identifier.
        rate_hz: Polling rate. A request without an answer is a gap in `sequence`.
        torque_limit_n_m: The most it may be commanded, at the output.
        watchdog_s: How long a command is valid.
    """

    name = "moteus"

    def __init__(
        self,
        transport: Transport,
        device_id: int = 1,
        rate_hz: float = 200.0,
        torque_limit_n_m: float = 0.1,
        watchdog_s: float = 0.1,
    ) -> None:
        if not 1 <= device_id <= protocol.HIGHEST_ID:
            raise ValueError(f"an identifier lies in 1..{protocol.HIGHEST_ID}, not {device_id}")
        if not (0 < torque_limit_n_m < math.inf and 0 < watchdog_s < math.inf):
            raise ValueError("torque limit and watchdog are above 0")
        self._transport = transport
        self._id = device_id
        self._rate_hz = rate_hz
        self._limit_n_m = torque_limit_n_m
        self._watchdog_s = watchdog_s
        self._counters = DeviceCounters()
        self._link = FdcanusbLink(transport, device_id, self._counters)
        self._schedule = PollSchedule(rate_hz, self._counters)
        self._schedule.restart(transport.now_s)
        self._torque_n_m = 0.0
        self._identified = self._armed = self._may_be_armed = self._closed = False

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Angle, speed and torque of the output, torque commanded, supply and temperature."""
        rate, limit = self._rate_hz, self._limit_n_m
        every = (-math.inf, math.inf)
        return (
            Channel("angle_rad", "rad", rate, *every, "output, over all turns"),
            Channel("speed_rad_s", "rad/s", rate, *every, "output"),
            Channel("torque_n_m", "N m", rate, *every, "output, by the motor's current"),
            Channel("command_torque_n_m", "N m", rate, -limit, limit, "torque commanded"),
            Channel("supply_v", "V", rate, -64.0, 63.5, "supply"),
            Channel("temperature_k", "K", rate, _ZERO_K - 128, _ZERO_K + 127, "board"),
        )

    @property
    def counters(self) -> dict[str, int]:
        """What happened on the way."""
        return self._counters.as_dict()

    def identify(self) -> DeviceIdentity:
        """Ask for model, firmware and serial number.

        Raises:
            LinkTimeoutError: Nobody answers.
            FrameError: The answer is not of a moteus.
        """
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

    def start(self) -> None:
        """Number the samples from 0, the first being due now."""
        if not self._identified:
            self.identify()
        self._link.discard()
        self._schedule.restart(self._transport.now_s)

    def arm(self) -> None:
        """Stop the controller, which clears a fault, and put the motor in force with no torque.

        Raises:
            DriverError: It does not get into operation.
        """
        if not self._identified:
            raise DriverError("The controller is not started.", fix="Call start first.")
        self.disarm()
        self._may_be_armed = True
        give_up_s = self._transport.now_s + STARTS_S
        while True:
            state = self._exchange(self._command())
            if state.mode == protocol.POSITION_MODE:
                break
            if state.mode not in protocol.PREPARING:
                raise self._out_of_operation(state)
            if self._transport.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"The moteus {self._id} does not get into operation.",
                    f"It is still in mode {state.mode} after {STARTS_S:g} s.",
                )
            self._transport.read(1e-3)
        self._armed = True

    def set_torque(self, torque_n_m: float) -> float:
        """Command a torque at the output, sent with every question from the next one on.

        Returns:
            The torque that is sent.

        Raises:
            DriverError: Not armed, not finite, or beyond the limit.
        """
        if not self._armed:
            raise DriverError("The controller is not armed.", fix="Call arm first.")
        if not math.isfinite(torque_n_m) or abs(torque_n_m) > self._limit_n_m:
            raise DriverError(
                f"A torque of {torque_n_m:g} N m cannot be commanded.",
                f"The limit is {self._limit_n_m:g} N m.",
                "Command less, or raise torque_limit_n_m if motor and rig allow.",
            )
        self._torque_n_m = torque_n_m
        return torque_n_m

    def read(self, timeout_s: float) -> Batch:
        """Command and ask when the next sample is due, and return it if the controller answers.

        Raises:
            DriverError: An armed controller has a fault, has timed out or was stopped; said once.
                Or neither `identify` nor `start` has been called.
        """
        if not self._identified:
            raise DriverError("The controller is not known.", fix="Call start first.")
        wait_s = self._schedule.wait_s(self._transport.now_s)
        late = self._transport.read(max(0.0, min(wait_s, timeout_s)))
        self._counters.discarded_bytes += len(late)
        now_s = self._transport.now_s
        if self._schedule.wait_s(now_s) > 0:
            return self._batch(None)
        self._schedule.skip_missed(now_s)
        try:
            state = self._exchange(self._command() if self._armed else b"")
        except LinkTimeoutError:
            self._schedule.lose()
            return self._batch(None)
        self._schedule.asked += 1
        self._counters.frames += 1
        if state.mode == protocol.FAULT:
            self._counters.device_errors += 1
        if self._armed and state.mode != protocol.POSITION_MODE:
            self._armed = False
            raise self._out_of_operation(state)
        return self._batch(state)

    def disarm(self) -> None:
        """Take the motor out of force, and return when the controller has said that it is.

        Raises:
            DisarmUnconfirmedError: It has not said so; its state is unknown.
        """
        self._armed = False
        self._torque_n_m = 0.0
        try:
            state = self._exchange(protocol.stop_command())
            if state.mode != protocol.STOPPED:
                raise DriverError(f"It is in mode {state.mode}.")
        except DriverError as error:
            raise DisarmUnconfirmedError(
                f"The moteus {self._id} at {self._transport.url} has not confirmed that it is"
                " stopped.",
                str(error),
                "Take the motor for live and cut its supply. A working controller enters its"
                f" timeout mode {self._watchdog_s:g} s after the last command.",
            ) from error
        self._may_be_armed = False

    def stop(self) -> None:
        """Disarm where the controller may be armed; one that is not asked is silent.

        Raises:
            DisarmUnconfirmedError: The controller's state is unknown.
        """
        if self._may_be_armed:
            self.disarm()

    def close(self) -> None:
        """Disarm where the controller may be armed, and let go of the fdcanusb.

        Raises:
            DisarmUnconfirmedError: The link is closed, but the controller's state is unknown.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self.stop()
        finally:
            self._transport.close()

    def _command(self) -> bytes:
        return protocol.torque_command(self._torque_n_m, self._limit_n_m, self._watchdog_s)

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

    def _batch(self, state: State | None) -> Batch:
        count = 0 if state is None else 1
        s = state or State(0, 0.0, 0.0, 0.0, 0, 0, 0)
        values = (
            2 * math.pi * s.position_rev,
            2 * math.pi * s.velocity_rev_s,
            s.torque_n_m,
            self._torque_n_m,
            protocol.VOLTS_A_UNIT * s.voltage,
            s.temperature + _ZERO_K,
        )
        names = (channel.name for channel in self.channels)
        flag = SampleFlag.SUSPECT if s.mode == protocol.FAULT else 0
        return Batch(
            {name: np.full(count, value) for name, value in zip(names, values, strict=True)},
            np.full(count, self._transport.now_s),
            "host",
            np.full(count, self._schedule.asked - 1, np.int64),
            np.full(count, flag, np.uint8),
            self._schedule.lost,
        )


def open_moteus(
    url: str,
    device_id: Annotated[int, Field(ge=1, le=protocol.HIGHEST_ID)] = 1,
    rate_hz: RateOption = 200.0,
    torque_limit_n_m: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.1,
    watchdog_s: Annotated[float, Field(gt=0, le=1)] = 0.1,
) -> Moteus:
    """Open the controller behind an fdcanusb.

    Args:
        url: The fdcanusb's port.
        device_id: The controller's identifier, 1 to 126.
        rate_hz: How often it is asked.
        torque_limit_n_m: The most it may be commanded, at the output.
        watchdog_s: How long a command is valid.

    Raises:
        LinkError: The port cannot be opened, or the options are no controller's.
    """
    link = open_transport(url)
    try:
        return Moteus(link, device_id, rate_hz, torque_limit_n_m, watchdog_s)
    except ValueError as error:
        link.close()
        raise LinkError(f"No moteus can be driven so: {error}.") from error


DRIVER = Driver("moteus", "mjbots moteus brushless controller, by fdcanusb", open_moteus)
