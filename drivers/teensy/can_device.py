"""The logger on a CAN bus as a device among others."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from drivers.errors import LinkError
from drivers.registry import CanUse, Driver
from drivers.teensy.can_segments import BOARD_ID, HOST_ID
from drivers.teensy.can_transport import CanTransport
from drivers.teensy.device import TeensyDevice
from drivers.transport.python_can import open_can


class TeensyCanDevice(TeensyDevice):
    """The logger's stream over CAN; all else as over USB."""

    name = "teensy-can"


Identifier = Annotated[int, Field(ge=1, le=0x7FF)]
"""An 11-bit identifier; 0 is the bus' network management."""


def open_can_transport(url: str, host_id: int = HOST_ID, board_id: int = BOARD_ID) -> CanTransport:
    """Open the way to a logger on a CAN bus.

    Raises:
        LinkError: The bus cannot be opened, or the identifiers are none or the same.
    """
    if host_id == board_id or not (0 < host_id < 0x800 and 0 < board_id < 0x800):
        raise LinkError(
            f"A logger cannot have the identifiers {host_id:#x} and {board_id:#x}.",
            "They are two different ones of 11 bits.",
        )
    return CanTransport(open_can(url), host_id, board_id)


def open_teensy_can(
    url: str, host_id: Identifier = HOST_ID, board_id: Identifier = BOARD_ID
) -> TeensyCanDevice:
    """Open the logger on a CAN bus, its inputs in raw counts.

    Args:
        url: The bus, e.g. `can:socketcan:can0`.
        host_id: Identifier of what the host sends.
        board_id: Identifier of what the board sends.

    Raises:
        LinkError: The bus cannot be opened, or the identifiers are none or the same.
    """
    return TeensyCanDevice(open_can_transport(url, host_id, board_id))


def _identifiers(options: Mapping[str, Any]) -> frozenset[int]:
    return frozenset({options["host_id"], options["board_id"]})


DRIVER = Driver(
    "teensy-can",
    "The 1 kHz logger on a Teensy, over CAN",
    open_teensy_can,
    CanUse(_identifiers, 1_000_000),
)
