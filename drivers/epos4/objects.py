"""What is done by an EPOS4's objects: identity, set-up before it runs, and its power stage.

Each value of the set-up is read back. The reactions decide how the motor stops when the host is
gone or the drive finds a fault. Both are set to "voltage off". The other choice of 0x6007 and the
other two of 0x605E brake along a ramp, by the drive's position and velocity controllers; these are
not used in cyclic torque and may never have been tuned, and a motor that brakes is energised for as
long as the ramp takes. The power stage is the state machine of CiA 402, commanded and read back.

Source: objects 0x6007, 0x605E and 0x1029 with their values as transcribed from maxon's firmware
specification in the public library `Imcab/EposLib`; re-mapping order of CiA 301.
"""

from typing import TYPE_CHECKING

from drivers.device import DeviceIdentity
from drivers.epos4 import protocol
from drivers.epos4.faults import fault
from drivers.epos4.node import DRIVE_HEARTBEAT_MS, HOST_NODE, Node
from drivers.epos4.protocol import FAULTY, Ratings, State
from drivers.errors import ProtocolMismatchError

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

REACTIONS = (
    (0x6007, 0, protocol.DISABLE_ON_LOST_HOST),
    (0x605E, 0, protocol.DISABLE_ON_FAULT),
    (0x1029, 1, protocol.PRE_OPERATIONAL_ON_LOST_HOST),
)
"""Index, sub-index and value of what the drive does by itself."""
GENERIC_ERROR = 0x1000
"""Code of a fault for which the drive gives none."""


def identify(link: "CanopenLink") -> tuple[DeviceIdentity, Ratings]:
    """Ask who is there, and read the motor data.

    Raises:
        LinkTimeoutError: Nobody answers.
        ProtocolMismatchError: It is not maxon's, or has no cyclic torque mode.
    """
    read = link.read
    vendor = read(0x1018, 1)
    if vendor != protocol.VENDOR_ID:
        raise ProtocolMismatchError(
            f"Node {link.node_id} on {link.bus.url} is not a maxon drive.",
            f"Its vendor number is {vendor:#x}, maxon's is {protocol.VENDOR_ID:#x}.",
            "Check the node number.",
        )
    if not read(0x6502) & protocol.CYCLIC_TORQUE_SUPPORTED:
        raise ProtocolMismatchError(
            f"Node {link.node_id} has no cyclic synchronous torque mode.",
            "Its supported modes (0x6502) do not name it.",
            "Update its firmware.",
        )
    ratings = Ratings(
        rated_torque_n_m=read(0x6076) * 1e-6,
        torque_constant_n_m_per_a=read(0x3001, 5) * 1e-6,
        current_limit_a=read(0x3001, 2) * 1e-3,
    )
    product, revision, serial = (read(0x1018, part) for part in (2, 3, 4))
    identity = DeviceIdentity(f"maxon EPOS4 {product:#010x}", f"{serial:08x}", f"{revision:08x}")
    return identity, ratings


def set_up(link: "CanopenLink", node: Node, host_timeout_ms: int) -> None:
    """Set up reactions, heartbeats and process data, and make the drive operational.

    The power stage stays as it is.

    Raises:
        ProtocolMismatchError: The drive does not hold what was written.
        LinkTimeoutError: It does not answer, or does not reach a network state.
    """
    node.command(protocol.NMT_PRE_OPERATIONAL)
    link.write(0x1017, 0, DRIVE_HEARTBEAT_MS)
    node.reach(protocol.PRE_OPERATIONAL)
    for index, subindex, value in REACTIONS:
        _write_and_check(link, index, subindex, value)
    _map(link, 0x1800, 0x1A00, 0x180, protocol.SYNCHRONOUS, protocol.TPDO_MAP)
    # at once, not at SYNC: a controlword must not wait for one
    _map(link, 0x1400, 0x1600, 0x200, protocol.EVENT_DRIVEN, protocol.RPDO_MAP)
    for other in (1, 2, 3):
        _switch_off(link, 0x1800 + other, 0x180 + 0x100 * other)
        _switch_off(link, 0x1400 + other, 0x200 + 0x100 * other)
    if host_timeout_ms:
        _write_and_check(link, 0x1016, 1, HOST_NODE << 16 | host_timeout_ms)
    node.command(protocol.NMT_START)
    node.reach(protocol.OPERATIONAL)


def _write_and_check(link: "CanopenLink", index: int, subindex: int, value: int) -> None:
    link.write(index, subindex, value)
    found = link.read(index, subindex)
    if found != value:
        raise ProtocolMismatchError(
            f"Node {link.node_id} does not hold what was written to {index:#06x}:{subindex}.",
            f"It holds {found}, {value} was written.",
            "Update its firmware; do not run a motor whose drive stops in another way.",
        )


def _map(
    link: "CanopenLink",
    communication: int,
    mapping: int,
    cob_base: int,
    kind: int,
    entries: tuple[int, ...],
) -> None:
    """Write a process data mapping and hold what the drive then says against it."""
    cob_id = cob_base + link.node_id
    link.write(communication, 1, cob_id | protocol.PDO_INVALID)
    link.write(communication, 2, kind)
    link.write(mapping, 0, 0)
    for place, entry in enumerate(entries, 1):
        link.write(mapping, place, entry)
    link.write(mapping, 0, len(entries))
    link.write(communication, 1, cob_id)
    found = [link.read(communication, 1), link.read(communication, 2), link.read(mapping, 0)]
    found += [link.read(mapping, place) for place in range(1, len(entries) + 1)]
    if found != [cob_id, kind, len(entries), *entries]:
        raise ProtocolMismatchError(
            f"Node {link.node_id} does not hold the process data written to {mapping:#06x}.",
            f"It says {', '.join(f'{value:#x}' for value in found)}.",
            "Restore its default parameters, or update its firmware.",
        )


def _switch_off(link: "CanopenLink", communication: int, cob_base: int) -> None:
    link.write(communication, 1, (cob_base + link.node_id) | protocol.PDO_INVALID)


class PowerStage:
    """The state machine of one drive."""

    def __init__(self, link: "CanopenLink", node: Node) -> None:
        self._link = link
        self._node = node

    def enable(self) -> None:
        """Energise the motor in cyclic torque, its target torque 0.

        Raises:
            DriveFaultError: The drive has a fault.
            LinkTimeoutError: It does not reach operation in time.
        """
        code = self.fault_code()
        if code:
            raise fault(code)
        write, read = self._link.write, self._link.read
        write(0x6071, 0, 0)
        write(0x6060, 0, protocol.CYCLIC_TORQUE)
        self._node.wait("the mode", lambda: read(0x6061) == protocol.CYCLIC_TORQUE)
        write(0x6040, 0, protocol.SHUTDOWN)
        self._reach(State.READY)
        write(0x6040, 0, protocol.ENABLE_OPERATION)
        self._reach(State.OPERATION_ENABLED)

    def disable(self) -> None:
        """Take the motor out of force; returns when the drive has said that its stage is off.

        Raises:
            DriverError: It has not said so.
        """
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self._link.write(0x6071, 0, 0)
        self._node.wait("the power stage to be off", lambda: self._state() in protocol.POWERLESS)

    def reset_fault(self) -> None:
        """Reset a fault whose cause is gone; the stage stays off. LinkTimeoutError if it stays."""
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self._link.write(0x6040, 0, protocol.FAULT_RESET)
        self._node.wait(
            f"the state {State.SWITCH_ON_DISABLED.value!r}",
            lambda: self._state() is State.SWITCH_ON_DISABLED,
        )
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)

    def error_code(self) -> int:
        """Return the drive's newest error code, 0 when it has none."""
        return self._link.read(0x603F)

    def fault_code(self) -> int:
        """Return the code of the drive's fault, 0 when it has none."""
        return (self.error_code() or GENERIC_ERROR) if self._state() in FAULTY else 0

    def _reach(self, wanted: State) -> None:
        def reached() -> bool:
            state = self._state()
            if state in FAULTY:
                raise fault(self.error_code())
            return state is wanted

        self._node.wait(f"the state {wanted.value!r}", reached)

    def _state(self) -> State:
        """Return the state by request: before the first SYNC no process data contain it."""
        return protocol.state_of(self._link.read(0x6041))
