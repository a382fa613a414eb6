"""The EPOS4 as a registered driver: how it is opened and which frames it uses."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from drivers.epos4.drive import Epos4
from drivers.epos4.node import HOST_NODE
from drivers.registry import CanUse, Driver, made
from drivers.transport.python_can import open_can


def open_epos4(
    url: str,
    node_id: Annotated[int, Field(ge=1, le=126)] = 1,
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 1000.0,
    host_timeout_ms: Annotated[int, Field(ge=0, le=65535)] = 250,
) -> Epos4:
    """Open the drive on a CAN bus.

    Options are those of `Epos4`; at 1 Mbit/s one node at 1 kHz takes a quarter of the bus. A URL is
    e.g. `can:socketcan:can0`.

    Raises:
        LinkError: The bus cannot be opened, an option is unknown, or `canopen` is missing.
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
