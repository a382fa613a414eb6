"""CAN frames to and from a bus: what every way to a bus offers, real or simulated."""

from dataclasses import dataclass
from typing import Protocol

from drivers.device import Clocked

MAX_STANDARD_ID = 0x7FF
MAX_EXTENDED_ID = 0x1FFFFFFF
MAX_DATA = 8


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One classic CAN data frame: identifier of 11 bits, or 29 where `extended`; 0 to 8 bytes."""

    can_id: int
    data: bytes = b""
    extended: bool = False

    def __post_init__(self) -> None:
        top = MAX_EXTENDED_ID if self.extended else MAX_STANDARD_ID
        if not 0 <= self.can_id <= top:
            raise ValueError(f"a CAN identifier lies in 0..{top:#x}, not {self.can_id:#x}")
        if len(self.data) > MAX_DATA:
            raise ValueError(f"a CAN frame carries {MAX_DATA} bytes, not {len(self.data)}")


@dataclass(slots=True)
class CanCounters:
    """Error frames of a bus's controller, and times that it had to drop received frames."""

    error_frames: int = 0
    overruns: int = 0


class CanBus(Clocked, Protocol):
    """Frames to and from one bus, read where they are wanted. Not for two threads at once."""

    @property
    def counters(self) -> CanCounters:
        """Counters of the bus."""

    def send(self, frame: CanFrame) -> None:
        """Send one frame.

        Raises:
            LinkLostError: The bus is gone.
            LinkTimeoutError: The interface does not take the frame.
        """

    def read(self, timeout_s: float) -> CanFrame | None:
        """Return the next frame, or None when none came in `timeout_s`.

        Raises:
            LinkLostError: The bus is gone; every later call raises it again.
        """
