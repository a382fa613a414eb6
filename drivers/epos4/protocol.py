"""An EPOS4's state machine, process data and units.

Source: maxon EPOS4 Communication Guide (2019-11) for identifiers and network states; CiA 402 for
the state machine; units as in maxon's own set-up scripts.
"""

import math
import struct
from dataclasses import dataclass
from enum import Enum

from drivers.errors import DriverError, FrameError

VENDOR_ID = 0xFB
CYCLIC_TORQUE = 10
"""Mode of operation: cyclic synchronous torque."""
CYCLIC_TORQUE_SUPPORTED = 1 << 9
"""Its bit among the supported modes."""
PDO_INVALID = 1 << 31
SYNCHRONOUS, EVENT_DRIVEN = 1, 255
"""Transmission types: at every SYNC; at once."""

NMT_START, NMT_PRE_OPERATIONAL, NMT_RESET_COMMUNICATION = 0x01, 0x80, 0x82
STOPPED, OPERATIONAL, PRE_OPERATIONAL = 4, 5, 127
"""Network states, as in a heartbeat."""

DISABLE_ON_LOST_HOST = 2
"""0x6007: voltage off when the connection is lost; 3 brakes along the quick stop's ramp."""
DISABLE_ON_FAULT = 0
"""0x605E: voltage off at a fault; 1 and 2 brake along a ramp."""
PRE_OPERATIONAL_ON_LOST_HOST = 0
"""0x1029:1: objects can still be read and written; 1 stays operational, 2 stops the node."""

SHUTDOWN, ENABLE_OPERATION, DISABLE_VOLTAGE, FAULT_RESET = 0x06, 0x0F, 0x00, 0x80
"""Controlwords."""

TPDO_MAP = (0x60410010, 0x60640020, 0x30D20110)
"""Statusword, position, averaged torque: exactly 8 bytes."""
RPDO_MAP = (0x60400010, 0x60710010)
"""Controlword, target torque."""
_TPDO = struct.Struct("<Hih")
_RPDO = struct.Struct("<Hh")
_EMERGENCY = struct.Struct("<HB5s")


class State(Enum):
    """States of CiA 402."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


POWERLESS = (State.NOT_READY, State.SWITCH_ON_DISABLED, State.READY, State.FAULT)
"""States in which the power stage is off."""
FAULTY = (State.FAULT, State.FAULT_REACTION)

_STATES = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP),
    (0x4F, 0x0F, State.FAULT_REACTION),
    (0x4F, 0x08, State.FAULT),
)


def state_of(statusword: int) -> State:
    """Return the state of a statusword; `FrameError` where it contains none."""
    for mask, value, state in _STATES:
        if statusword & mask == value:
            return state
    raise FrameError(f"The statusword {statusword:#06x} is not a state of CiA 402.")


@dataclass(frozen=True, slots=True)
class Feedback:
    """What the drive sends at each SYNC: position in quadrature counts, and averaged torque."""

    statusword: int
    position_count: int
    torque_per_mille: int


def encode_feedback(feedback: Feedback) -> bytes:
    """Return the 8 bytes of a feedback."""
    return _TPDO.pack(feedback.statusword, feedback.position_count, feedback.torque_per_mille)


def decode_feedback(data: bytes) -> Feedback:
    """Return the content of a TPDO1; `FrameError` where it has not 8 bytes."""
    if len(data) != _TPDO.size:
        raise FrameError(f"The drive's process data have {_TPDO.size} bytes, not {len(data)}.")
    return Feedback(*_TPDO.unpack(data))


def encode_command(controlword: int, torque_per_mille: int) -> bytes:
    """Return the 4 bytes of an RPDO1."""
    return _RPDO.pack(controlword, torque_per_mille)


def decode_emergency(data: bytes) -> tuple[int, int]:
    """Return error code and error register of an emergency frame; FrameError unless of 8 bytes."""
    if len(data) != _EMERGENCY.size:
        raise FrameError(f"An emergency frame has 8 bytes, not {len(data)}.")
    code, register, _ = _EMERGENCY.unpack(data)
    return code, register


@dataclass(frozen=True, slots=True)
class Ratings:
    """What the drive is set to, as read from it; the output current limit is what takes effect.

    Torques are the motor's, before any gearhead, and in thousandths of the rated torque.
    """

    rated_torque_n_m: float
    torque_constant_n_m_per_a: float
    current_limit_a: float

    def __post_init__(self) -> None:
        for name in ("rated_torque_n_m", "torque_constant_n_m_per_a", "current_limit_a"):
            if not getattr(self, name) > 0:
                raise DriverError(
                    f"The drive's {name} is {getattr(self, name)}.",
                    "The motor data are not set.",
                    "Set up the motor in EPOS Studio and store the parameters.",
                )

    @property
    def resolution_n_m(self) -> float:
        """Step of a torque command: a thousandth of the rated torque, N m."""
        return self.rated_torque_n_m / 1000

    @property
    def torque_limit_n_m(self) -> float:
        """Torque at the current limit, N m."""
        return self.current_limit_a * self.torque_constant_n_m_per_a

    def torque_n_m(self, per_mille: int) -> float:
        """Return a torque in N m."""
        return per_mille * self.resolution_n_m

    def current_a(self, per_mille: int) -> float:
        """Return the current of a torque, by the torque constant, A."""
        return self.torque_n_m(per_mille) / self.torque_constant_n_m_per_a

    def per_mille(self, torque_n_m: float) -> int:
        """Return the nearest command to a torque.

        Raises:
            DriverError: The torque is not finite, or beyond what the current limit allows.
        """
        if not math.isfinite(torque_n_m):
            raise DriverError(f"A torque of {torque_n_m} cannot be commanded.")
        top = min(self.torque_limit_n_m, 32767 * self.resolution_n_m)
        if abs(torque_n_m) > top:
            raise DriverError(
                f"A torque of {torque_n_m:g} N m is beyond the drive's limit of {top:g} N m.",
                f"Its output current is limited to {self.current_limit_a:g} A.",
                "Command less, or raise the limit (0x3001:2) if motor and rig allow.",
            )
        return round(torque_n_m / self.resolution_n_m)
