"""What the logger and the host say to each other: one packed little-endian layout a frame kind.

Every payload begins with `version u1, kind u1`. All but the sample go on with `sequence u2`: the
host's command number, which the answer repeats. The layouts below are the only place they are
written down on this side; `layout_text` spells them out, `firmware/core/protocol.hpp` holds the
same text, and its CRC-32 (`PROTOCOL_HASH`) is compared before anything moves.
"""

import zlib
from dataclasses import astuple, dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError

VERSION = 1
SAMPLE_RATE_HZ = 1000
TICK_US = 1_000_000 // SAMPLE_RATE_HZ
"""Period of a control tick and of a sample, microseconds."""
MAX_SETPOINTS = 100
"""Most setpoints in one frame."""
QUEUE_CAPACITY = 2000
"""Setpoints the board holds: two seconds of motion."""
WATCHDOG_US = 250_000
"""Board time without a valid host frame after which an armed board makes itself safe, where the
host does not ask for another."""
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


STATUS_ARMED = 1
STATUS_SATURATED = 2
STATUS_QUEUE_DRY = 4
STATUS_WATCHDOG_TRIPPED = 8
STATUS_LIMIT_TRIPPED = 16
STATUS_HOLDING = 32
"""Bits of the board's state, in every sample and every acknowledgement. A trip stays until arm."""
TRIP_SHIFT = 8
"""The high byte of the state is the `Trip` that came first, until arm."""


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


def _layout(*fields: str) -> np.dtype[np.void]:
    """Return a packed dtype from `name type` strings."""
    names_and_types = [field.split() for field in fields]
    return np.dtype(
        [(name, kind if kind[0] == "S" else f"<{kind}") for name, kind in names_and_types]
    )


_HEADER = ("version u1", "kind u1", "sequence u2")
SAMPLE_DTYPE = _layout(
    "version u1",
    "kind u1",
    "status u2",
    "sequence u4",
    "tick_us u4",
    "motor i4",
    "spindle i4",
    "jaw i4",
    "target i4",
    "proximal i2",
    "distal i2",
    "current i2",
    "fsr u2",
    "command_e4 i2",
    "load_ma i2",
    "dropped u2",
)
"""One sample, raw counts with the rig's raw signs.

`dropped` counts the frames the board could not queue since it started, modulo 65536. `target` is
the spindle count itself while nothing is asked.
"""
HEADER_DTYPE = _layout(*_HEADER)
HELLO_REPLY_DTYPE = _layout(
    *_HEADER, "protocol_hash u4", "firmware_version u4", "build_hash u4", "serial S24"
)
ACK_DTYPE = _layout(*_HEADER, "command u1", "result u1", "status u2", "queue_free u2")
PONG_DTYPE = _layout(*_HEADER, "token u8", "tick_us u4")
LIMIT_NAMES = (
    "max_current",
    "max_load_ma",
    "max_proximal",
    "max_distal",
    "min_spindle",
    "max_spindle",
    "min_jaw",
    "max_jaw",
    "max_motor_step",
    "continuous_current",
    "i2t",
    "stall_current",
    "stall_motion",
    "stall_ticks",
    "saturated_ticks",
    "stale_ticks",
    "watchdog_us",
    "safe_state",
    "hold_command_e4",
)
GAIN_NAMES = ("kp", "ki", "kd", "velocity_filter", "limit")
ARM_DTYPE = _layout(
    *_HEADER, *(f"{name} f8" for name in GAIN_NAMES), *(f"{name} i4" for name in LIMIT_NAMES)
)
SETPOINT_DTYPE = _layout("target i4", "load_ma i2")
PING_DTYPE = _layout(*_HEADER, "token u8")
TRIP_REPORT_DTYPE = _layout(
    *_HEADER, "code u1", "channel u1", "value i4", "limit i4", "tick_us u4", "late_us u4"
)

_LAYOUTS: dict[Kind, np.dtype[np.void]] = {
    Kind.SAMPLE: SAMPLE_DTYPE,
    Kind.HELLO_REPLY: HELLO_REPLY_DTYPE,
    Kind.ACK: ACK_DTYPE,
    Kind.PONG: PONG_DTYPE,
    Kind.TRIP_REPORT: TRIP_REPORT_DTYPE,
    Kind.HELLO: HEADER_DTYPE,
    Kind.ARM: ARM_DTYPE,
    Kind.START: HEADER_DTYPE,
    Kind.SETPOINTS: HEADER_DTYPE,
    Kind.STOP: HEADER_DTYPE,
    Kind.DISARM: HEADER_DTYPE,
    Kind.PING: PING_DTYPE,
    Kind.TRIP: HEADER_DTYPE,
}


def layout_text() -> str:
    """Return the protocol as text, one line a frame kind, the same in the firmware's source."""
    lines = [f"rig teensy protocol {VERSION}", "COBS(payload, CRC-16/CCITT-FALSE u2) 00"]
    for kind, layout in _LAYOUTS.items():
        repeated = f", {MAX_SETPOINTS} x ({_fields(SETPOINT_DTYPE)})"
        lines.append(
            f"{kind} {kind.name}: {_fields(layout)}{repeated if kind is Kind.SETPOINTS else ''}"
        )
    lines.append(
        f"status: {STATUS_ARMED} ARMED, {STATUS_SATURATED} SATURATED, {STATUS_QUEUE_DRY} QUEUE_DRY,"
        f" {STATUS_WATCHDOG_TRIPPED} WATCHDOG_TRIPPED, {STATUS_LIMIT_TRIPPED} LIMIT_TRIPPED,"
        f" {STATUS_HOLDING} HOLDING, trip << {TRIP_SHIFT}"
    )
    lines.append("trip: " + ", ".join(f"{trip.value} {trip.name}" for trip in Trip))
    lines.append("result: " + ", ".join(f"{result.value} {result.name}" for result in Result))
    return "".join(f"{line}\n" for line in lines)


def _fields(layout: np.dtype[np.void]) -> str:
    assert layout.names is not None  # noqa: S101
    return ", ".join(f"{name} {layout[name].str.lstrip('<|')}" for name in layout.names)


PROTOCOL_HASH = zlib.crc32(layout_text().encode())
"""CRC-32 of `layout_text`; the board's hello carries its own."""
FIRMWARE_VERSION = 0x000200
"""Version of the firmware that goes with this program: major, minor, patch, one byte each."""


TOP = 2**31 - 1
"""A limit that nothing crosses."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the board holds against every sample while armed, in counts; beyond it, it is safe.

    What has a default is not held unless it is given.

    Attributes:
        max_current: Largest size of the measured current, counts of 1 mA.
        max_load_ma: Largest size of a load setpoint, mA; a larger one is refused.
        max_proximal: Largest size of the proximal torque, counts.
        max_distal: Largest size of the distal torque, counts.
        min_spindle: Lowest spindle count, for the sample and for a setpoint.
        max_spindle: Highest spindle count.
        min_jaw: Lowest jaw count.
        max_jaw: Highest jaw count.
        max_motor_step: Fastest motor, counts a tick, in three ticks on end.
        continuous_current: Current that warms the motor no further, counts.
        i2t: Heat above it that the motor can take, counts^2 s: the integral of the measured current
            squared less the continuous one squared, never below 0.
        stall_current: Current, counts, above which a motor that does not move is stalled.
        stall_motion: Motor counts within which it does not move.
        stall_ticks: How long it may be stalled.
        saturated_ticks: How long a torque or current count may be at the end of its range.
        stale_ticks: How long a torque or current count may stay the same.
        watchdog_us: How long the host may be silent, 5 ms to 1 s.
        safe_state: `SafeState`. Held are a silent host, a stall, and a saturated or stale sensor;
            any other crossing releases whatever is asked for.
        hold_command_e4: Largest command while holding, 1e-4 of full scale.
    """

    max_current: int
    max_load_ma: int
    max_proximal: int
    max_distal: int
    min_spindle: int
    max_spindle: int
    min_jaw: int = -TOP - 1
    max_jaw: int = TOP
    max_motor_step: int = TOP
    continuous_current: int = TOP
    i2t: int = TOP
    stall_current: int = TOP
    stall_motion: int = 0
    stall_ticks: int = TOP
    saturated_ticks: int = TOP
    stale_ticks: int = TOP
    watchdog_us: int = WATCHDOG_US
    safe_state: int = SafeState.RELEASE
    hold_command_e4: int = 0

    @classmethod
    def widest(cls) -> "Limits":
        """Return limits that nothing can cross: for a board that moves nothing real."""
        return cls(TOP, TOP, TOP, TOP, -TOP - 1, TOP)

    @property
    def valid(self) -> bool:
        """Whether a board takes them: the twin of `Limits::valid` in the firmware."""
        sizes = (
            *(self.max_current, self.max_load_ma, self.max_proximal, self.max_distal),
            *(self.max_motor_step, self.continuous_current, self.i2t),
            *(self.stall_current, self.stall_motion),
        )
        return (
            min(sizes) >= 0
            and min(self.stall_ticks, self.saturated_ticks, self.stale_ticks) >= 1
            and self.min_spindle <= self.max_spindle
            and self.min_jaw <= self.max_jaw
            and MIN_WATCHDOG_US <= self.watchdog_us <= MAX_WATCHDOG_US
            and self.safe_state in (SafeState.RELEASE, SafeState.HOLD)
            and 0 <= self.hold_command_e4 <= 10_000
        )

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire, shape (19,)."""
        return np.array(astuple(self), np.int64)


@dataclass(frozen=True, slots=True)
class TripReport:
    """What a board tripped over first since it was armed.

    Attributes:
        code: What it was.
        channel: Name of the count that crossed; empty where it was none.
        value: That count; for the host's silence its length, us; for heat, counts^2 s.
        limit: What it was held against.
        tick_us: Board clock at the trip.
        late_us: How long the crossing had lasted by then.
    """

    code: Trip
    channel: str
    value: int
    limit: int
    tick_us: int
    late_us: int


@dataclass(frozen=True, slots=True)
class Identity:
    """Who answered the hello."""

    serial: str
    firmware_version: str
    protocol_hash: int
    build_hash: int = 0
    """CRC-32 of the sources the firmware was built from; 0 where it was not built."""


@dataclass(frozen=True, slots=True)
class Ack:
    """The board's answer to a command.

    Attributes:
        sequence: Number of the command.
        command: Kind of the command.
        result: What became of it.
        status: State of the board after it.
        queue_free: Setpoints that still fit into the board's queue.
    """

    sequence: int
    command: int
    result: int
    status: int
    queue_free: int


def version_text(version: int) -> str:
    """Return a packed version as `major.minor.patch`."""
    return f"{version >> 16 & 255}.{version >> 8 & 255}.{version & 255}"


def encode_command(kind: Kind, sequence: int) -> bytes:
    """Return the payload of a command that is all header: hello, start, stop, disarm."""
    return np.array((VERSION, kind, sequence), HEADER_DTYPE).tobytes()


def encode_arm(sequence: int, gains: NDArray[np.float64], limits: Limits) -> bytes:
    """Return the payload of the arm command."""
    fields = (VERSION, Kind.ARM, sequence, *gains.tolist(), *astuple(limits))
    return np.array(fields, ARM_DTYPE).tobytes()


def encode_setpoints(
    sequence: int, targets: NDArray[np.int32], loads_ma: NDArray[np.int16]
) -> bytes:
    """Return the payload of one block of setpoints; both arrays have shape (n,)."""
    block = np.empty(len(targets), SETPOINT_DTYPE)
    block["target"] = targets
    block["load_ma"] = loads_ma
    return encode_command(Kind.SETPOINTS, sequence) + block.tobytes()


def encode_ping(sequence: int, token: int) -> bytes:
    """Return the payload of a clock ping; `token` comes back in the pong."""
    return np.array((VERSION, Kind.PING, sequence, token), PING_DTYPE).tobytes()


def encode_hello_reply(
    sequence: int, serial: str, protocol_hash: int = PROTOCOL_HASH, build_hash: int = 0
) -> bytes:
    """Return the payload of the answer to a hello."""
    fields = (
        VERSION,
        Kind.HELLO_REPLY,
        sequence,
        protocol_hash,
        FIRMWARE_VERSION,
        build_hash,
        serial.encode()[:24],
    )
    return np.array(fields, HELLO_REPLY_DTYPE).tobytes()


def encode_ack(ack: Ack) -> bytes:
    """Return the payload of an acknowledgement."""
    fields = (
        VERSION,
        Kind.ACK,
        ack.sequence,
        ack.command,
        ack.result,
        ack.status,
        ack.queue_free,
    )
    return np.array(fields, ACK_DTYPE).tobytes()


def encode_trip_report(
    sequence: int, code: int, channel: int, value: int, limit: int, tick_us: int, late_us: int
) -> bytes:
    """Return the payload of the answer to a question for the trip; values are cut to 32 bits."""
    whole = [max(MISSING, min(number, TOP)) for number in (value, limit)]
    late_us = min(late_us, 2**32 - 1)
    fields = (VERSION, Kind.TRIP_REPORT, sequence, code, channel, *whole, tick_us, late_us)
    return np.array(fields, TRIP_REPORT_DTYPE).tobytes()


def encode_pong(sequence: int, token: int, tick_us: int) -> bytes:
    """Return the payload of the answer to a ping."""
    return np.array((VERSION, Kind.PONG, sequence, token, tick_us), PONG_DTYPE).tobytes()


def decode(payload: bytes) -> tuple[Kind, int, np.void]:
    """Return kind, sequence and fields of any frame but a sample.

    The fields of a block of setpoints are its header; the block is `decode_setpoints`.

    Raises:
        FrameError: Too short, of another version, of an unknown kind, or of the wrong size.
    """
    if len(payload) < HEADER_DTYPE.itemsize:
        raise FrameError(f"A frame of {len(payload)} bytes holds no header.")
    version, number = payload[0], payload[1]
    if version != VERSION:
        raise FrameError(f"A frame has layout version {version}, not {VERSION}.")
    if number not in Kind.__members__.values() or number == Kind.SAMPLE:
        raise FrameError(f"A frame has the unknown kind {number}.")
    kind = Kind(number)
    body = len(payload) - _LAYOUTS[kind].itemsize
    setpoints, rest = divmod(body, SETPOINT_DTYPE.itemsize)
    whole = rest == 0 and 1 <= setpoints <= MAX_SETPOINTS
    if not (whole if kind is Kind.SETPOINTS else body == 0):
        raise FrameError(f"A {kind.name} frame has {len(payload)} bytes.")
    fields = np.frombuffer(payload, _LAYOUTS[kind], count=1)[0]
    return kind, int(fields["sequence"]), fields


def decode_setpoints(payload: bytes) -> NDArray[np.void]:
    """Return the setpoints of a block, shape (n,), fields `target` and `load_ma`."""
    return np.frombuffer(payload, SETPOINT_DTYPE, offset=HEADER_DTYPE.itemsize)


def decode_identity(fields: np.void) -> Identity:
    """Return what a hello reply says."""
    return Identity(
        serial=bytes(fields["serial"]).decode("ascii", "replace"),
        firmware_version=version_text(int(fields["firmware_version"])),
        protocol_hash=int(fields["protocol_hash"]),
        build_hash=int(fields["build_hash"]),
    )


def decode_ack(fields: np.void) -> Ack:
    """Return what an acknowledgement says."""
    return Ack(
        sequence=int(fields["sequence"]),
        command=int(fields["command"]),
        result=int(fields["result"]),
        status=int(fields["status"]),
        queue_free=int(fields["queue_free"]),
    )


INPUT_NAMES = ("motor", "spindle", "jaw", "proximal", "distal", "current")
"""Fields of a sample a trip can name, in the order of its channel number."""


def decode_trip_report(fields: np.void) -> TripReport:
    """Return what a board says it tripped over.

    Raises:
        FrameError: It gives a reason this program does not know.
    """
    code, channel = int(fields["code"]), int(fields["channel"])
    if code not in Trip.__members__.values():
        raise FrameError(f"A board tripped for the unknown reason {code}.")
    return TripReport(
        code=Trip(code),
        channel=INPUT_NAMES[channel] if channel < len(INPUT_NAMES) else "",
        value=int(fields["value"]),
        limit=int(fields["limit"]),
        tick_us=int(fields["tick_us"]),
        late_us=int(fields["late_us"]),
    )
