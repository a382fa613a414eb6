"""The driver of an EPOS4: torque commanded and position and torque read once a SYNC.

Nothing runs in the background. While the host reads, it sends its heartbeat; when it stops, the
drive notices and takes its power stage out of force by itself.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from drivers.counters import DeviceCounters
from drivers.device import Batch, Channel, DeviceIdentity, SampleFlag
from drivers.epos4 import protocol
from drivers.epos4.faults import DriveFaultError, fault
from drivers.epos4.protocol import Feedback, Ratings, State
from drivers.errors import (
    DisarmUnconfirmedError,
    DriverError,
    FrameError,
    LinkError,
    LinkTimeoutError,
    MissingExtraError,
    ProtocolMismatchError,
)
from drivers.polling import PollSchedule
from drivers.registry import CanUse, Driver
from drivers.transport.can_bus import CanBus
from drivers.transport.python_can import open_can

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

FEEDBACK_TIMEOUT_S = 0.01
"""Time for the answer to a SYNC; it takes a fraction of a millisecond on the wire."""
SPACING = 0.4
"""Least time between two SYNCs of which one was late, in periods."""
STATE_TIMEOUT_S = 0.8
_INSTANT_S = 1e-9
DRIVE_HEARTBEAT_MS = 100
SILENT_S = 3.5 * DRIVE_HEARTBEAT_MS / 1000
"""Longest silence of the drive that is no fault."""
HOST_NODE = 127
"""Node number under which the host sends its heartbeat."""


class Epos4:
    """One drive on a CAN bus of its own, or one that this host masters.

    Args:
        bus: The bus; the device closes it.
        node_id: The drive's node number.
        rate_hz: How often SYNC is sent.
        host_timeout_ms: Silence of the host after which the drive stops by itself; 0 for never.
        late_s: How late a SYNC may be and still be sent; later ones are counted as lost. Late ones
            follow each other at a higher rate until the schedule is met again.
    """

    name = "epos4"

    def __init__(
        self,
        bus: CanBus,
        node_id: int = 1,
        rate_hz: float = 1000.0,
        host_timeout_ms: int = 250,
        late_s: float = 0.0,
    ) -> None:
        if not 1 <= node_id < HOST_NODE:
            raise ValueError(f"a drive's node number lies in 1..{HOST_NODE - 1}, not {node_id}")
        if not rate_hz > 0:
            raise ValueError(f"a rate is above 0 Hz, not {rate_hz}")
        if not 0 <= host_timeout_ms <= 65535:
            raise ValueError(f"a host time-out lies in 0..65535 ms, not {host_timeout_ms}")
        self._bus = bus
        self._node_id = node_id
        self._rate_hz = rate_hz
        self._host_timeout_ms = host_timeout_ms
        self._late_s = late_s
        self._synced_s = -np.inf
        self._link = _link(bus, node_id)
        self._counters = DeviceCounters()
        self._schedule = PollSchedule(rate_hz, self._counters)
        self._ratings: Ratings | None = None
        self._feedback: Feedback | None = None
        self._network_state: int | None = None
        self._heard_s = bus.now_s
        self._silent = False
        self._beat_s = -np.inf
        self._started = False
        self._armed = False
        self._may_be_armed = False
        self._target = 0
        self._closed = False
        self.last_error = 0
        """Error code of the newest emergency frame, 0 after the error is gone."""
        self._link.subscribe(0x80 + node_id, self._take_emergency)
        self._link.subscribe(0x180 + node_id, self._take_feedback)
        self._link.subscribe(0x700 + node_id, self._take_heartbeat)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Position, torque and current of the motor, and the torque commanded."""
        torque = current = np.inf
        if self._ratings is not None:
            torque, current = self._ratings.torque_n_m(2**15), self._ratings.current_a(2**15)
        rate = self._rate_hz
        return (
            Channel("position_count", "count", rate, -(2.0**31), 2.0**31 - 1, "motor encoder"),
            Channel("motor_torque_n_m", "N m", rate, -torque, torque, "averaged motor torque"),
            Channel("motor_current_a", "A", rate, -current, current, "by the torque constant"),
            Channel("command_torque_n_m", "N m", rate, -torque, torque, "torque commanded"),
        )

    @property
    def counters(self) -> dict[str, int]:
        """What happened to this drive's frames, and to the bus itself."""
        counters = self._counters.as_dict()
        counters["retries"] += self._link.retries
        counters["timeouts"] += self._link.timeouts
        bus = self._bus.counters
        return counters | {"error_frames": bus.error_frames, "overruns": bus.overruns}

    @property
    def ratings(self) -> Ratings:
        """The drive's motor data.

        Raises:
            DriverError: They have not been read yet.
        """
        if self._ratings is None:
            raise DriverError("The drive's motor data are not known.", fix="Call start first.")
        return self._ratings

    def identify(self) -> DeviceIdentity:
        """Ask who is there, and read the motor data.

        Raises:
            LinkTimeoutError: Nobody answers.
            ProtocolMismatchError: It is not maxon's, or has no cyclic torque mode.
        """
        read = self._link.read
        vendor = read(0x1018, 1)
        if vendor != protocol.VENDOR_ID:
            raise ProtocolMismatchError(
                f"Node {self._node_id} on {self._bus.url} is no maxon drive.",
                f"Its vendor number is {vendor:#x}, maxon's is {protocol.VENDOR_ID:#x}.",
                "Check the node number.",
            )
        if not read(0x6502) & protocol.CYCLIC_TORQUE_SUPPORTED:
            raise ProtocolMismatchError(
                f"Node {self._node_id} has no cyclic synchronous torque mode.",
                "Its supported modes (0x6502) do not name it.",
                "Update its firmware.",
            )
        self._ratings = Ratings(
            rated_torque_n_m=read(0x6076) * 1e-6,
            torque_constant_n_m_per_a=read(0x3001, 5) * 1e-6,
            nominal_current_a=read(0x3001, 1) * 1e-3,
            current_limit_a=read(0x3001, 2) * 1e-3,
        )
        product, revision, serial = (read(0x1018, part) for part in (2, 3, 4))
        return DeviceIdentity(f"maxon EPOS4 {product:#010x}", f"{serial:08x}", f"{revision:08x}")

    def start(self) -> None:
        """Set up heartbeats and process data, check them, and let the drive answer SYNC.

        The power stage stays as it is.

        Raises:
            ProtocolMismatchError: The drive does not hold the mapping that was written.
        """
        if self._ratings is None:
            self.identify()
        if not self._started:
            self._command_network(protocol.NMT_PRE_OPERATIONAL)
            self._link.write(0x1017, 0, DRIVE_HEARTBEAT_MS)
            self._reach_network_state(protocol.PRE_OPERATIONAL)
            self._map(0x1800, 0x1A00, 0x180, protocol.SYNCHRONOUS, protocol.TPDO_MAP)
            # at once, not at SYNC: a controlword must not wait for one
            self._map(0x1400, 0x1600, 0x200, protocol.EVENT_DRIVEN, protocol.RPDO_MAP)
            for other in (1, 2, 3):
                self._switch_off(0x1800 + other, 0x180 + 0x100 * other)
                self._switch_off(0x1400 + other, 0x200 + 0x100 * other)
            if self._host_timeout_ms:
                self._link.write(0x1016, 1, HOST_NODE << 16 | self._host_timeout_ms)
            self._command_network(protocol.NMT_START)
            self._reach_network_state(protocol.OPERATIONAL)
            self._started = True
        self._idle(0.0)
        self._schedule.restart(self._bus.now_s)

    def arm(self) -> None:
        """Put the power stage in force with a target torque of 0.

        Raises:
            DriveFaultError: The drive has a fault; `clear_fault` first.
            LinkTimeoutError: It does not reach operation in time.
        """
        if not self._started:
            raise DriverError("The drive is not started.", fix="Call start first.")
        self._require_no_fault()
        self._target = 0
        self._link.write(0x6071, 0, 0)
        self._link.write(0x6060, 0, protocol.CYCLIC_TORQUE)
        self._wait("the mode", lambda: self._link.read(0x6061) == protocol.CYCLIC_TORQUE)
        self._may_be_armed = True
        self._link.write(0x6040, 0, protocol.SHUTDOWN)
        self._reach(State.READY)
        self._link.write(0x6040, 0, protocol.ENABLE_OPERATION)
        self._reach(State.OPERATION_ENABLED)
        self._feedback = None
        self._armed = True

    def set_torque(self, torque_n_m: float) -> float:
        """Command a motor torque, sent at the next reading and at every one from then on.

        Returns:
            The torque that is sent: the nearest multiple of `ratings.resolution_n_m`.

        Raises:
            DriverError: Not armed, not finite, or beyond the drive's current limit.
        """
        per_mille = self.ratings.per_mille(torque_n_m)
        if not self._armed:
            raise DriverError("The drive is not armed.", fix="Call arm first.")
        self._target = per_mille
        return self.ratings.torque_n_m(per_mille)

    def read(self, timeout_s: float) -> Batch:
        """Send command and SYNC when due and return what the drive answers, if it does.

        Raises:
            DriveFaultError: An armed drive has a fault or has left operation. It is said once.
            LinkTimeoutError: The drive's heartbeat is missing; every reading says so while it is.
        """
        ratings = self.ratings
        self._idle(min(self.wait_s, timeout_s))
        now_s = self._bus.now_s
        if self.wait_s > 0 or not self._started:
            return self._batch(ratings, None)
        self._schedule.skip_missed(now_s - self._late_s)
        feedback = self._exchange()
        if feedback is None:
            self._schedule.lose()
            self._counters.timeouts += 1
            self._require_heartbeat()
            return self._batch(ratings, None)
        self._schedule.asked += 1
        self._counters.frames += 1
        self._require_operation(feedback)
        return self._batch(ratings, feedback)

    @property
    def wait_s(self) -> float:
        """Time until the next SYNC is due, 0 when it is."""
        return self._schedule.wait_s(self._bus.now_s)

    def idle(self, wait_s: float) -> None:
        """Serve the bus for a while, the host's heartbeat among it.

        Raises:
            LinkLostError: The bus is gone.
        """
        self._idle(wait_s)

    def clear_fault(self) -> None:
        """Reset a fault whose cause is gone; the power stage stays off.

        Raises:
            LinkTimeoutError: The fault stays.
        """
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self._link.write(0x6040, 0, protocol.FAULT_RESET)
        self._reach(State.SWITCH_ON_DISABLED)
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self.last_error = 0

    def disarm(self) -> None:
        """Take the motor out of force: target torque 0, voltage off, read back.

        Returns only when the drive has said that its power stage is off.

        Raises:
            DisarmUnconfirmedError: It has not said so; its state is unknown.
        """
        self._armed = False
        self._target = 0
        try:
            if self._started:
                self._link.send(0x200 + self._node_id, protocol.encode_command(0, 0))
            self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
            self._link.write(0x6071, 0, 0)
            self._wait("the power stage to be off", lambda: self._state() in protocol.POWERLESS)
        except DriverError as error:
            raise DisarmUnconfirmedError(
                f"The drive, node {self._node_id} on {self._bus.url}, has not confirmed that its"
                " power stage is off.",
                str(error),
                "Take the motor for live and cut its supply."
                + (
                    f" A working drive stops by itself {self._host_timeout_ms} ms after the host's"
                    " last heartbeat."
                    if self._host_timeout_ms
                    else ""
                ),
            ) from error
        self._may_be_armed = False

    def stop(self) -> None:
        """Disarm where the drive may be armed, and let it answer no more SYNC.

        Raises:
            DisarmUnconfirmedError: The drive's state is unknown.
        """
        if self._may_be_armed:
            self.disarm()
        if not self._started:
            return
        self._started = False
        if self._host_timeout_ms:
            self._link.write(0x1016, 1, 0)  # the host may fall silent now
        self._command_network(protocol.NMT_PRE_OPERATIONAL)

    def close(self) -> None:
        """Disarm where the drive may be armed, and let go of the bus.

        Raises:
            DisarmUnconfirmedError: The bus is closed, but the drive's state is unknown.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self.stop()
        except DisarmUnconfirmedError:
            raise
        except DriverError:
            pass  # it is gone already, and was not armed
        finally:
            self._bus.close()

    # set-up

    def _map(
        self, communication: int, mapping: int, cob_base: int, kind: int, entries: tuple[int, ...]
    ) -> None:
        """Write a process data mapping and hold what the drive then says against it."""
        cob_id = cob_base + self._node_id
        write = self._link.write
        write(communication, 1, cob_id | protocol.PDO_INVALID)
        write(communication, 2, kind)
        write(mapping, 0, 0)
        for place, entry in enumerate(entries, 1):
            write(mapping, place, entry)
        write(mapping, 0, len(entries))
        write(communication, 1, cob_id)
        read = self._link.read
        found = [read(communication, 1), read(communication, 2), read(mapping, 0)]
        found += [read(mapping, place) for place in range(1, len(entries) + 1)]
        if found != [cob_id, kind, len(entries), *entries]:
            raise ProtocolMismatchError(
                f"Node {self._node_id} does not hold the process data written to {mapping:#06x}.",
                f"It says {', '.join(f'{value:#x}' for value in found)}.",
                "Restore its default parameters, or update its firmware.",
            )

    def _switch_off(self, communication: int, cob_base: int) -> None:
        """Make sure that a PDO which is not used says nothing."""
        self._link.write(communication, 1, (cob_base + self._node_id) | protocol.PDO_INVALID)

    def _command_network(self, command: int) -> None:
        self._network_state = None
        self._link.send(0, bytes([command, self._node_id]))

    def _reach_network_state(self, wanted: int) -> None:
        self._wait(f"network state {wanted}", lambda: self._network_state == wanted)

    def _reach(self, wanted: State) -> None:
        def reached() -> bool:
            state = self._state()
            if state in (State.FAULT, State.FAULT_REACTION) and wanted is not state:
                if wanted is State.SWITCH_ON_DISABLED:
                    return False  # a fault is being cleared
                raise fault(self._link.read(0x603F))
            return state is wanted

        self._wait(f"the state {wanted.value!r}", reached)

    def _state(self) -> State:
        """Return the state, asked for: before the first SYNC no process data tell it."""
        return protocol.state_of(self._link.read(0x6041))

    def _wait(self, what: str, reached: Callable[[], bool]) -> None:
        give_up_s = self._bus.now_s + STATE_TIMEOUT_S
        while not reached():
            if self._bus.now_s > give_up_s:
                raise LinkTimeoutError(
                    f"Node {self._node_id} did not reach {what}.",
                    f"It had {STATE_TIMEOUT_S:g} s.",
                    "Look at its error and its enable and STO inputs.",
                )
            self._idle(0.001)

    # every cycle

    def _exchange(self) -> Feedback | None:
        """Send command and SYNC; return the answer, None when there is none in time."""
        if self._armed:
            command = protocol.encode_command(protocol.ENABLE_OPERATION, self._target)
            self._link.send(0x200 + self._node_id, command)
        while self._late_s and self._bus.now_s < self._synced_s + SPACING / self._rate_hz:
            self._link.pump(0.0)  # not asleep: who is late already would wake up later still
        self._synced_s = self._bus.now_s
        self._link.send(0x80)
        give_up_s = self._bus.now_s + FEEDBACK_TIMEOUT_S
        while True:
            feedback = self._take()
            remaining_s = give_up_s - self._bus.now_s
            if feedback is not None or remaining_s <= _INSTANT_S:
                return feedback
            self._link.pump(remaining_s)

    def _take(self) -> Feedback | None:
        feedback, self._feedback = self._feedback, None
        return feedback

    def _idle(self, wait_s: float) -> None:
        """Let time pass, serving what comes and sending the host's heartbeat when it is due."""
        end_s = self._bus.now_s + wait_s
        while True:
            now_s = self._bus.now_s
            if self._host_timeout_ms and now_s - self._beat_s >= self._host_timeout_ms / 4000:
                self._link.send(0x700 + HOST_NODE, bytes([protocol.OPERATIONAL]))
                self._beat_s = now_s
            beat_in_s = self._host_timeout_ms / 4000 if self._host_timeout_ms else wait_s
            left_s = min(end_s - now_s, beat_in_s)
            came = self._link.pump(left_s if left_s > _INSTANT_S else 0.0)
            if not came and self._bus.now_s >= end_s - _INSTANT_S:
                break
        if self._take() is not None:  # to a SYNC that was given up
            self._counters.late += 1

    def _require_heartbeat(self) -> None:
        if self._bus.now_s - self._heard_s <= SILENT_S:
            self._silent = False
            return
        if not self._silent:
            self._counters.stalls += 1
        self._silent = True
        raise LinkTimeoutError(
            f"Node {self._node_id} on {self._bus.url} has fallen silent.",
            f"No heartbeat came for {SILENT_S:g} s.",
            "Take the motor for live. Check the drive's supply and the cable.",
        )

    def _require_operation(self, feedback: Feedback) -> None:
        """Raise, once, when an armed drive is not in operation any more."""
        if not self._armed:
            return
        state = protocol.state_of(feedback.statusword)
        if state is State.OPERATION_ENABLED:
            return
        self._armed = False
        if state in (State.FAULT, State.FAULT_REACTION):
            raise fault(self.last_error or self._link.read(0x603F))
        raise DriveFaultError(
            f"The drive has left operation by itself and is in {state.value!r}.",
            "Its enable or STO input changed, or somebody else commands it.",
            "Find out why, then arm again.",
        )

    def _require_no_fault(self) -> None:
        if self._state() in (State.FAULT, State.FAULT_REACTION):
            raise fault(self._link.read(0x603F))

    def _batch(self, ratings: Ratings, feedback: Feedback | None) -> Batch:
        count = 0 if feedback is None else 1
        told = feedback or Feedback(0, 0, 0)
        values = {
            "position_count": float(told.position_count),
            "motor_torque_n_m": ratings.torque_n_m(told.torque_per_mille),
            "motor_current_a": ratings.current_a(told.torque_per_mille),
            "command_torque_n_m": ratings.torque_n_m(self._target),
        }
        faulty = count and protocol.state_of(told.statusword) in (State.FAULT, State.FAULT_REACTION)
        return Batch(
            {name: np.full(count, value) for name, value in values.items()},
            np.full(count, self._bus.now_s),
            "host",
            np.full(count, self._schedule.asked - 1, np.int64),
            np.full(count, SampleFlag.SUSPECT if faulty else 0, np.uint8),
            self._schedule.lost,
        )

    # what comes

    def _take_feedback(self, data: bytes) -> None:
        try:
            feedback = protocol.decode_feedback(data)
            protocol.state_of(feedback.statusword)
        except FrameError:
            self._counters.unknown_frames += 1
            return
        if self._feedback is not None:
            self._counters.late += 1
        self._feedback = feedback

    def _take_heartbeat(self, data: bytes) -> None:
        self._heard_s = self._bus.now_s
        if len(data) != 1:
            self._counters.unknown_frames += 1
            return
        if data[0] == 0 and self._started:
            self._counters.restarts += 1
        self._network_state = data[0] & 0x7F

    def _take_emergency(self, data: bytes) -> None:
        try:
            code, _ = protocol.decode_emergency(data)
        except FrameError:
            self._counters.unknown_frames += 1
            return
        self.last_error = code
        if code:
            self._counters.device_errors += 1


def _link(bus: CanBus, node_id: int) -> "CanopenLink":
    """Return the link; the `canopen` library is an extra, loaded only here.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        from drivers.epos4.canopen_link import CanopenLink
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            "An EPOS4 needs the canopen library.", f"{error}.", "can"
        ) from error
    return CanopenLink(bus, node_id)


def open_epos4(
    url: str,
    node_id: Annotated[int, Field(ge=1, le=126)] = 1,
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 1000.0,
    host_timeout_ms: Annotated[int, Field(ge=0, le=65535)] = 250,
) -> Epos4:
    """Open the drive on a CAN bus.

    Args:
        url: The bus, e.g. `can:socketcan:can0`.
        node_id: The drive's node number, 1 to 126.
        rate_hz: How often SYNC is sent; at 1 Mbit/s one node at 1 kHz takes a quarter of the bus.
        host_timeout_ms: Silence of the host after which the drive stops by itself; 0 for never.

    Raises:
        LinkError: The bus cannot be opened, an option is no drive's, or `canopen` is missing.
    """
    bus = open_can(url)
    try:
        return Epos4(bus, node_id, rate_hz, host_timeout_ms)
    except ValueError as error:
        bus.close()
        raise LinkError(f"No EPOS4 can be driven so: {error}.") from error
    except LinkError:
        bus.close()
        raise


def _identifiers(options: Mapping[str, Any]) -> frozenset[int]:
    """Return network management, SYNC, and what a node sends and takes, as it is set up here."""
    of_a_node = (0x080, 0x180, 0x200, 0x580, 0x600, 0x700)
    return frozenset(
        {0x000, 0x080, 0x700 + HOST_NODE, *(b + options["node_id"] for b in of_a_node)}
    )


DRIVER = Driver(
    "epos4",
    "maxon EPOS4 motor controller, CANopen, cyclic torque",
    open_epos4,
    CanUse(_identifiers, 1_000_000),
)
