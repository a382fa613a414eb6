"""Who an EPOS4 is, and the motor data it holds."""

from typing import TYPE_CHECKING

from drivers.device import DeviceIdentity
from drivers.epos4 import protocol
from drivers.epos4.protocol import Ratings
from drivers.errors import ProtocolMismatchError

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink


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
        nominal_current_a=read(0x3001, 1) * 1e-3,
        current_limit_a=read(0x3001, 2) * 1e-3,
    )
    product, revision, serial = (read(0x1018, part) for part in (2, 3, 4))
    identity = DeviceIdentity(f"maxon EPOS4 {product:#010x}", f"{serial:08x}", f"{revision:08x}")
    return identity, ratings
