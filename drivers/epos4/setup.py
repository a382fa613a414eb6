"""What is written to an EPOS4 before it runs, each value read back: reactions and process data.

The reactions decide how the motor stops when the host is gone or the drive finds a fault. Both are
set to "voltage off". The other choice of 0x6007 and the other two of 0x605E brake along a ramp, by
the drive's position and velocity controllers; these are not used in cyclic torque and may never
have been tuned, and a motor that brakes is energised for as long as the ramp takes.

Source: objects 0x6007, 0x605E and 0x1029 with their values as transcribed from maxon's firmware
specification in the public library `Imcab/EposLib`; re-mapping order of CiA 301.
"""

from typing import TYPE_CHECKING

from drivers.epos4 import protocol
from drivers.epos4.node import DRIVE_HEARTBEAT_MS, HOST_NODE, Node
from drivers.errors import ProtocolMismatchError

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

REACTIONS = (
    (0x6007, 0, protocol.DISABLE_ON_LOST_HOST),
    (0x605E, 0, protocol.DISABLE_ON_FAULT),
    (0x1029, 1, protocol.PRE_OPERATIONAL_ON_LOST_HOST),
)
"""Index, sub-index and value of what the drive does by itself."""


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
    """Make sure that a PDO which is not used says nothing."""
    link.write(communication, 1, (cob_base + link.node_id) | protocol.PDO_INVALID)
