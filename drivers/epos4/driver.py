"""The driver of an EPOS4: torque commanded and position and torque read once a SYNC.

Nothing runs in the background. While the host reads, it sends its heartbeat; when it stops, the
drive notices and takes its power stage out of force by itself.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any

from pydantic import Field

from drivers.device import Axis, Channel, DeviceIdentity, SampleFlag
from drivers.epos4 import protocol
from drivers.epos4.faults import DriveFaultError, fault
from drivers.epos4.node import HOST_NODE, Cycle, Node
from drivers.epos4.objects import PowerStage, identify, set_up
from drivers.epos4.protocol import FAULTY, Feedback, Ratings, State
from drivers.errors import DisarmUnconfirmedError, DriverError, LinkTimeoutError, MissingExtraError
from drivers.polling import PolledDrive
from drivers.registry import CanUse, Driver, made
from drivers.transport.can_bus import CanBus
from drivers.transport.python_can import open_can


class Epos4(PolledDrive):
    """One drive on a CAN bus of its own, or one that this host masters.

    Args:
        node_id: The drive's node number.
        rate_hz: How often SYNC is sent.
        host_timeout_ms: Silence of the host after which the drive stops by itself; 0 for never.
        late_s: How late a SYNC may be and still be sent; later ones are counted as lost. Late ones
            follow each other at a higher rate until the schedule is met again.

    Raises:
        MissingExtraError: `canopen` is not installed.
    """

    name = "epos4"
    axis = Axis("position_count", 1.0, "motor_current_a")

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
        if not 0 <= host_timeout_ms <= 65535:
            raise ValueError(f"a host time-out lies in 0..65535 ms, not {host_timeout_ms}")
        super().__init__(
            bus,
            rate_hz,
            f"drive, node {node_id} on {bus.url},",
            f"A working drive stops by itself {host_timeout_ms} ms after the host's last heartbeat."
            if host_timeout_ms
            else "",
            late_s,
        )
        self._bus = bus
        self._host_timeout_ms = host_timeout_ms
        try:  # the library is an extra, loaded only here
            from drivers.epos4.canopen_link import CanopenLink
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                "An EPOS4 needs the canopen library.", f"{error}.", "can"
            ) from error
        self._link = CanopenLink(bus, node_id, self._counters)
        self._node = Node(self._link, host_timeout_ms, self._counters)
        self._power = PowerStage(self._link, self._node)
        self._cycle = Cycle(self._link, rate_hz, late_s, self._counters)
        self._ratings: Ratings | None = None
        self._feedback: Feedback | None = None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Position, torque and current of the motor, and the torque commanded."""
        rate, torque, current = self._rate_hz, math.inf, math.inf
        if self._ratings is not None:
            torque, current = self._ratings.torque_n_m(2**15), self._ratings.current_a(2**15)
        return (
            Channel("position_count", "count", rate, -(2.0**31), 2.0**31 - 1, "motor encoder"),
            Channel("motor_torque_n_m", "N m", rate, -torque, torque, "averaged motor torque"),
            Channel("motor_current_a", "A", rate, -current, current, "by the torque constant"),
            Channel("command_torque_n_m", "N m", rate, -torque, torque, "torque commanded"),
        )

    @property
    def counters(self) -> dict[str, int]:
        """What happened to this drive's frames, and to the bus itself."""
        return super().counters | asdict(self._bus.counters)

    @property
    def last_error(self) -> int:
        """Error code of the newest emergency frame, 0 after the error is gone."""
        return self._node.last_error

    @property
    def ratings(self) -> Ratings:
        """The drive's motor data (`DriverError`: they have not been read yet)."""
        if self._ratings is None:
            raise DriverError("The drive's motor data are not known.", fix="Call start first.")
        return self._ratings

    def identify(self) -> DeviceIdentity:
        """Ask who is there, and read the motor data; errors as `objects.identify`."""
        identity, self._ratings = identify(self._link)
        self._identified = True
        return identity

    def start(self) -> None:
        """Set the drive up and check it, and let it answer SYNC; errors as `objects.set_up`."""
        if not self._identified:
            self.identify()
        if not self._node.started:
            self._set_up()
        super().start()

    def arm(self) -> None:
        """Energise the power stage with a target torque of 0.

        Raises:
            DriveFaultError: The drive has a fault; `clear_fault` first.
            LinkTimeoutError: It does not reach operation in time.
        """
        if not self._node.started:
            raise DriverError("The drive is not started.", fix="Call start first.")
        self._node.require_well()
        self.put_in_force()

    def energise(self) -> None:
        """Energise the power stage."""
        self._power.enable()
        self._cycle.drop_late()

    def release(self) -> None:
        """Voltage off, read back (`DriverError`: the drive has not said so)."""
        if self._node.started:
            self._cycle.command(protocol.DISABLE_VOLTAGE, 0)
        self._power.disable()

    def set_torque(self, torque_n_m: float) -> float:
        """Command a motor torque, sent at the next reading and at every one from then on.

        Returns the torque that is sent: the nearest multiple of `ratings.resolution_n_m`.

        Raises:
            DriverError: Not armed, not finite, or beyond the drive's current limit.
        """
        per_mille = self.ratings.per_mille(torque_n_m)
        if not self._armed:
            raise DriverError("The drive is not armed.", fix="Call arm first.")
        self._goal = per_mille
        return self.ratings.torque_n_m(per_mille)

    def command(self, ratio: float) -> None:
        """Command a share of the rated torque, as `set_torque`."""
        self.set_torque(ratio * self.ratings.rated_torque_n_m)

    @property
    def wait_s(self) -> float:
        """Time until the next SYNC is due, 0 when it is; none is while the drive is not started."""
        return super().wait_s if self._node.started else math.inf

    def sample(self) -> tuple[Sequence[float], int]:
        """Send command and SYNC, and return the drive's answer."""
        if self._node.in_trouble:
            self._armed = False  # it is not commanded any more
        self._feedback = self._cycle.exchange(round(self._goal) if self._armed else None)
        if self._feedback is None:
            self._counters.timeouts += 1
            raise LinkTimeoutError("The drive does not answer a SYNC.")
        position, torque = self._feedback.position_count, self._feedback.torque_per_mille
        values = (
            float(position),
            self.ratings.torque_n_m(torque),
            self.ratings.current_a(torque),
            self.ratings.torque_n_m(round(self._goal)),
        )
        is_faulty = protocol.state_of(self._feedback.statusword) in FAULTY
        return values, SampleFlag.SUSPECT if is_faulty else 0

    def judge(self) -> None:
        """Raise what `Node` has of the drive, and once that an armed one has left operation."""
        if self._node.in_trouble:
            self._armed = False
            self._node.require_well()
        if self._feedback is None:
            self._node.require_answers()
        else:
            self._require_operation(self._feedback)

    def idle(self, wait_s: float) -> None:
        """Serve the bus for a while; an answer that comes is to a SYNC that was given up."""
        self._node.idle(wait_s)
        self._cycle.drop_late()

    def clear_fault(self) -> int:
        """Reset a fault whose cause is gone; the power stage stays off.

        After a lost heartbeat a drive ignores the reset of its fault until its communication was
        reset. That forgets heartbeats and process data, which are therefore set up again, before
        the edge of the reset: a controlword counts for certain in the operational state only.

        Returns the fault's error code, 0 when the drive had none.

        Raises:
            DisarmUnconfirmedError: The drive has not confirmed that its power stage is off.
            LinkTimeoutError: The fault stays.
        """
        self._node.command(protocol.NMT_PRE_OPERATIONAL)  # a stopped node has no objects
        if self._ratings is None:
            self.identify()
        self.disarm()
        code = self._power.fault_code()
        self._node.reset_communication()
        self._set_up()
        if code:
            self._power.reset_fault()
        self._node.forget_error()
        return code

    def stop(self) -> None:
        """Disarm as every drive, and let it answer no more SYNC."""
        super().stop()
        if not self._node.started:
            return
        self._node.started = False
        if self._host_timeout_ms:
            self._link.write(0x1016, 1, 0)  # the host may fall silent now
        self._node.command(protocol.NMT_PRE_OPERATIONAL)

    def close(self) -> None:
        """Disarm where the drive may be armed, and let go of the bus.

        Raises:
            DisarmUnconfirmedError: The bus is closed, but the drive's state is unknown.
        """
        try:
            super().close()
        except DisarmUnconfirmedError:
            raise
        except DriverError:
            pass  # it is gone already, and was not armed

    def _set_up(self) -> None:
        set_up(self._link, self._node, self._host_timeout_ms)
        self._node.started = True

    def _require_operation(self, feedback: Feedback) -> None:
        if not self._armed:
            return
        state = protocol.state_of(feedback.statusword)
        if state is State.OPERATION_ENABLED:
            return
        self._armed = False
        if state in FAULTY:
            self._node.reported()
            raise fault(self.last_error or self._power.error_code())
        raise DriveFaultError(
            f"The drive has left operation by itself and is in {state.value!r}.",
            "Its enable or STO input changed, or somebody else commands it.",
            "Find out why, then arm again.",
        )


def open_epos4(
    url: str,
    node_id: Annotated[int, Field(ge=1, le=126)] = 1,
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 1000.0,
    host_timeout_ms: Annotated[int, Field(ge=0, le=65535)] = 250,
) -> Epos4:
    """Open the drive on a CAN bus.

    Options are those of `Epos4`; at 1 Mbit/s one node at 1 kHz takes a quarter of the bus. A URL is
    e.g. `can:socketcan:can0`.
    """
    return made(open_can(url), lambda bus: Epos4(bus, node_id, rate_hz, host_timeout_ms), "EPOS4")


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
