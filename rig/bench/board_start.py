"""A board that is restarted during a session: its counts have lost their zeros."""

from typing import Protocol

from drivers.errors import DriverError
from drivers.teensy.protocol import Identity
from rig.errors import ExitCode, RigError


class BoardResetError(RigError):
    """The board was restarted while the session ran."""

    exit_code = ExitCode.DEVICE


class Identified(Protocol):
    """What can be asked who it is."""

    def identify(self) -> Identity:
        """Ask who is there."""
        ...


def require_same_start(logger: Identified, boot: int) -> None:
    """Compare the board's present start number with the session's.

    Args:
        logger: The board. One that does not answer is left to the caller to report.
        boot: Start number when the session began.

    Raises:
        BoardResetError: The numbers differ.
    """
    try:
        present = logger.identify().boot
    except DriverError:
        return
    if present != boot:
        raise BoardResetError(
            "The board was restarted while it was in use.",
            f"Its start number is {present} and was {boot} when the session began. The cause is a"
            " reset, its watchdog, or its supply.",
            "It is disarmed and its counts have lost their zeros. Find the cause of the restart,"
            " then run: rig reference",
        )
