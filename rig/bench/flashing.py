"""Which board is flashed: the only Teensy that is plugged in, by its serial number, disarmed.

A Teensy's loader takes the first board it finds and cannot select another, so a second one on the
same computer is refused. Grasper and master carry the same image: only the serial number
distinguishes them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.errors import DriverError, LinkError, PortBusyError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.profile import Profile
from drivers.teensy.protocol import STATUS_ARMED, STATUS_HOLDING
from drivers.transport import open_transport
from rig.errors import SafetyTripError, UsageError

VENDOR, PRODUCT = 0x16C0, 0x0483
"""USB identity of a Teensy with a serial port."""
LOOK_S = 1.0


@dataclass(frozen=True, slots=True)
class Board:
    """A board that may be flashed."""

    serial: str  # its USB serial number, the chip's own
    port: str
    state: str  # what is known of its state, in words


def board_to_flash(serial: str, profile: Profile) -> Board:
    """Return the board to flash, once it is known to be the only one and not armed.

    It must have the serial number, if one is given; its present firmware may speak the profile.

    Raises:
        UsageError: No board, several, or another one than named is plugged in.
        PortBusyError: Another program has it: it may be armed.
        SafetyTripError: It is armed, or holds its motors.
    """
    found, port = _the_one(_ports())
    if serial and serial != found:
        raise UsageError(
            f"The board that is plugged in is {found}, not {serial}.",
            fix="Plug in the one you mean, and no other.",
        )
    return Board(found, port, _state(port, profile))


def _ports() -> list[tuple[str, str]]:
    """Return serial number and path of every Teensy with a serial port."""
    from serial.tools import list_ports

    return [
        (port.serial_number or "", port.device)
        for port in list_ports.comports()
        if (port.vid, port.pid) == (VENDOR, PRODUCT)
    ]


def _the_one(ports: Sequence[tuple[str, str]]) -> tuple[str, str]:
    if not ports:
        raise UsageError(
            "No Teensy is plugged in.",
            "None with a serial port was found; a board in its boot loader has none.",
            "Plug it in. See: rig devices",
        )
    if len(ports) > 1:
        named = ", ".join(f"{serial} at {port}" for serial, port in ports)
        raise UsageError(
            f"{len(ports)} Teensys are plugged in: {named}.",
            "The loader takes the first it finds, which may be another rig's.",
            "Unplug all but the one to flash.",
        )
    return ports[0]


def _state(port: str, profile: Profile) -> str:
    try:
        link = open_transport(port)
    except PortBusyError as error:
        raise PortBusyError(
            error.what, f"{error.why} It may be armed.", "Run: rig stop. Then flash again."
        ) from error
    try:
        with TeensyLogger(link, profile) as logger:
            logger.identify()
            logger.start()
            samples = logger.read(LOOK_S).samples
    except LinkError as error:
        return f"it does not answer ({error.what})"
    except DriverError as error:
        return f"it speaks another protocol ({error.what})"
    if len(samples) == 0:
        return "it sends no samples"
    if int(samples["status"][-1]) & (STATUS_ARMED | STATUS_HOLDING):
        raise SafetyTripError(
            f"The board at {port} is armed.", "Its motors are energised.", "Run: rig stop"
        )
    return "it is disarmed"
