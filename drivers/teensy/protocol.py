"""The protocol between logger and host, independent of the wiring of the logger.

Every payload begins with `version u1, kind u1`. All but the sample go on with `sequence u2`: the
host's command number, which the answer repeats. A board's profile (`drivers.teensy.profile`)
defines the sample, setpoints and limits of these frames: the reference rig's, or the grasper's.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

VERSION = 1
QUEUE_CAPACITY = 2000
"""Setpoints the board holds: two seconds of motion at 1 kHz."""
WATCHDOG_US = 250_000
"""Board time without a valid host frame until an armed board is safe, unless the host sets it."""
MIN_WATCHDOG_US, MAX_WATCHDOG_US = 5_000, 1_000_000
MISSING = -(2**31)
"""Count of a sensor that gave nothing: a whole number's NaN."""


class Kind(IntEnum):
    """Frame kinds: below 16 from the board, from 16 on from the host."""

    SAMPLE = 1
    HELLO_REPLY = 2
    ACK = 3
    PONG = 4
    TRIP_REPORT = 5
    HELLO = 16
    ARM = 17
    START = 18
    SETPOINTS = 19
    STOP = 20
    DISARM = 21
    PING = 22
    TRIP = 23
    REFERENCE = 24
    CLEAR = 25


STATUS_ARMED = 1
STATUS_SATURATED = 2
STATUS_QUEUE_DRY = 4
STATUS_WATCHDOG_TRIPPED = 8
STATUS_LIMIT_TRIPPED = 16
STATUS_HOLDING = 32
STATUS_REFERENCED = 64
"""Bits of the board's state, in every sample and every acknowledgement. Trips stay until clear."""
TRIP_SHIFT = 8
"""The high byte of the state is the `Trip` that came first, until clear."""


class Trip(IntEnum):
    """Why a board made itself safe."""

    NONE = 0
    HOST_SILENT = 1
    OVER_CURRENT = 2
    PROXIMAL_TORQUE = 3
    DISTAL_TORQUE = 4
    SPINDLE_TRAVEL = 5
    JAW_TRAVEL = 6
    OVER_SPEED = 7
    OVERHEATED = 8
    STALLED = 9
    SENSOR_SATURATED = 10
    SENSOR_STALE = 11
    SENSOR_MISSING = 12
    MOTOR_TRAVEL = 13
    OVER_FORCE = 14
    ENCODERS_DISAGREE = 15
    FOLLOWING_ERROR = 16
    CURRENT_MISMATCH = 17
    ENCODER_JUMP = 18
    ENCODER_FROZEN = 19
    QUEUE_RAN_DRY = 20
    EMERGENCY_STOP = 21


class SafeState(IntEnum):
    """What a board does with the motor once it has tripped."""

    RELEASE = 0
    """No current."""
    HOLD = 1
    """Hold the spindle where it stands, with a low command; released by a second trip."""


class Result(IntEnum):
    """The board's answer to a command."""

    OK = 0
    UNKNOWN_KIND = 1
    WRONG_SIZE = 2
    BAD_VALUE = 3
    QUEUE_FULL = 4
    NOT_ARMED = 5
    WRONG_VERSION = 6
    NOT_REFERENCED = 7
    NOT_AT_REST = 8
    WRONG_SESSION = 9
    OLD_SEQUENCE = 10
    TRIPPED = 11
    WRONG_TRIP = 12
    ALREADY_ARMED = 13
    TOO_HOT = 14
    BEYOND_BOARD = 15
    TOO_FAST = 16
    NO_INDEX = 17


def layout(*fields: str) -> np.dtype[np.void]:
    """Return a packed dtype from `name type` strings."""
    names_and_types = [field.split() for field in fields]
    return np.dtype(
        [(name, kind if kind[0] == "S" else f"<{kind}") for name, kind in names_and_types]
    )


HEADER_FIELDS = ("version u1", "kind u1", "sequence u2")
SESSION_FIELDS = (*HEADER_FIELDS, "session u4")
"""How what only the host that armed may send begins: arm, setpoints and ping."""
SAMPLE_FIELDS = ("version u1", "kind u1", "status u2", "sequence u4", "tick_us u4")
"""How every sample begins; it ends with `dropped`, the frames the board could not queue."""
HEADER_DTYPE = layout(*HEADER_FIELDS)
HELLO_REPLY_DTYPE = layout(
    *(*HEADER_FIELDS, "protocol_hash u4", "firmware_version u4", "build_hash u4"),
    *("serial S24", "boot u4", "status u2", "offer u4"),
)
SESSION_DTYPE = layout(*SESSION_FIELDS)
LAYOUTS: dict[Kind, np.dtype[np.void]] = {
    Kind.HELLO_REPLY: HELLO_REPLY_DTYPE,
    Kind.ACK: layout(*HEADER_FIELDS, "command u1", "result u1", "status u2", "queue_free u2"),
    Kind.PONG: layout(*HEADER_FIELDS, "token u8", "tick_us u4"),
    Kind.TRIP_REPORT: layout(
        *(*HEADER_FIELDS, "code u1", "channel u1"),
        *("value i4", "limit i4", "tick_us u4", "late_us u4"),
    ),
    Kind.HELLO: HEADER_DTYPE,
    Kind.START: HEADER_DTYPE,
    Kind.SETPOINTS: SESSION_DTYPE,
    Kind.STOP: HEADER_DTYPE,
    Kind.DISARM: HEADER_DTYPE,
    Kind.PING: layout(*SESSION_FIELDS, "token u8"),
    Kind.TRIP: HEADER_DTYPE,
    Kind.REFERENCE: layout(*HEADER_FIELDS, "count_1 i4", "count_2 i4", "count_3 i4", "at_index u1"),
    Kind.CLEAR: layout(*HEADER_FIELDS, "code u1"),
}
"""Layouts that every board has; setpoints follow their header.

The counts of a reference are each encoder's, ordered as in a sample: at the present place, or where
the index came.
"""
GAIN_NAMES = ("kp", "ki", "kd", "velocity_filter", "limit")
"""Of one position loop."""
FIRMWARE_VERSION = 0x000500
"""Version of the firmware that goes with this program: major, minor, patch, one byte each."""
TOP = 2**31 - 1
"""A limit that nothing crosses."""


@dataclass(frozen=True, slots=True)
class TripReport:
    """What a board tripped over first since it was cleared."""

    code: Trip
    channel: str  # name of the count that crossed; empty where it was none
    value: int  # that count; for the host's silence its length, us; for heat, counts^2 s
    limit: int
    tick_us: int  # board clock at the trip
    late_us: int  # how long the crossing had lasted by then


@dataclass(frozen=True, slots=True)
class Identity:
    """Who answered the hello."""

    serial: str
    firmware_version: str
    protocol_hash: int
    build_hash: int = 0
    """CRC-32 of the sources the firmware was built from; 0 where it was not built."""
    boot: int = 0
    """Number of this start of the board; it changes with every reset."""
    status: int = 0
    """State of the board."""
    offer: int = 0
    """The session the board takes at the next arming; it changes with every arming."""

    @property
    def referenced(self) -> bool:
        """Whether its counts have their zeros."""
        return bool(self.status & STATUS_REFERENCED)

    @property
    def trip(self) -> int:
        """Code of what it tripped over and nobody has cleared; 0 for nothing."""
        return self.status >> TRIP_SHIFT


@dataclass(frozen=True, slots=True)
class Ack:
    """The board's answer to a command, in the order of its layout."""

    sequence: int
    command: int
    result: int
    status: int
    queue_free: int


def version_text(version: int) -> str:
    """Return a packed version as `major.minor.patch`."""
    return f"{version >> 16 & 255}.{version >> 8 & 255}.{version & 255}"


def encode(kind: Kind, sequence: int, *fields: Any) -> bytes:
    """Return the payload of a frame: its command's number, and what follows in `LAYOUTS`."""
    return np.array((VERSION, kind, sequence, *fields), LAYOUTS[kind]).tobytes()


def decode_identity(fields: np.void) -> Identity:
    """Return the content of a hello reply."""
    names = ("protocol_hash", "build_hash", "boot", "status", "offer")
    serial = bytes(fields["serial"]).decode("ascii", "replace")
    version = version_text(int(fields["firmware_version"]))
    return Identity(serial, version, *(int(fields[name]) for name in names))


def decode_ack(fields: np.void) -> Ack:
    """Return the content of an acknowledgement."""
    _version, _kind, *content = fields.tolist()
    return Ack(*content)
