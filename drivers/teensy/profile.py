"""The limits that every board is armed with, and how boards differ: samples, setpoints, rate.

A profile corresponds to a class in `firmware/core/profile_*.hpp`. Its `text` is the contract that
both sides hash: `firmware/core` has the same text, and its CRC-32 is compared before any motion.
"""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError, FrameError
from drivers.teensy import protocol
from drivers.teensy.protocol import (
    SESSION_DTYPE,
    TOP,
    VERSION,
    WATCHDOG_US,
    Kind,
    Result,
    SafeState,
    Trip,
    TripReport,
)

_STATES = (
    *("ARMED", "SATURATED", "QUEUE_DRY", "WATCHDOG_TRIPPED", "LIMIT_TRIPPED"),
    *("HOLDING", "REFERENCED"),
)
"""Bits of the board's state, as the contract names them."""


@dataclass(frozen=True, kw_only=True)
class MotorLimits:
    """What is watched over time of a motor with a position loop."""

    max_motor_step: int = TOP  # fastest motor, counts a tick, in three ticks on end
    continuous_current: int = TOP  # current that warms the motor no further, counts
    # heat above it that the motor can take, counts^2 s: the integral of the measured current
    # squared less the continuous one squared, never below 0
    i2t: int = TOP
    stall_current: int = TOP  # current, counts, above which a motor that does not move is stalled
    stall_motion: int = 0  # motor counts within which it does not move


@dataclass(frozen=True, kw_only=True)
class LoopLimits(MotorLimits):
    """What a motor's position loop is believed by, too."""

    max_motor_jump: int = TOP  # farthest the motor's count may go in one tick
    # farthest a setpoint may be from the one before it, counts; the first after arming may be
    # `max_following` from where the shaft stands
    max_target_step: int = TOP
    max_following: int = TOP  # farthest the shaft may be from its target, counts
    following_ticks: int = TOP  # how long it may be farther
    # measured current at a command of 10000, counts, signed; 0 where current and command are not
    # compared
    full_scale_current: int = 0
    current_offset: int = 0  # measured current at a command of 0, counts
    # largest difference between measured and commanded current, counts
    max_current_error: int = TOP
    current_ticks: int = 1  # ticks over which that difference is averaged
    # change of the current, counts, behind which a motor that did not move has a dead encoder
    frozen_current: int = TOP
    frozen_motion: int = 0  # motor counts within which it did not move


@dataclass(frozen=True, kw_only=True)
class Choices:
    """How long each watch lasts, and what a tripped board does."""

    stall_ticks: int = TOP  # how long a motor may be stalled
    saturated_ticks: int = TOP  # how long a converter's count may be at the end of its range
    stale_ticks: int = TOP  # how long a converter's count may stay the same
    dry_ticks: int = TOP  # how long the last setpoint is held while none follows
    watchdog_us: int = WATCHDOG_US  # how long the host may be silent, 5 ms to 1 s
    # `SafeState`. Held are a silent host, a stall, and a saturated or stale sensor; any other
    # crossing releases whatever is asked for.
    safe_state: int = SafeState.RELEASE
    hold_command_e4: int = 0  # largest command while holding, 1e-4 of full scale
    hold_ticks: int = TOP  # how long it may hold; then it releases
    # 1 to move without a reference, towards a stop: the controller's limit is then no larger than
    # `hold_command_e4`, and the board has no reference from then on. 0 on a grasper, which is
    # referenced by hand
    seek: int = 0


MOTOR_LIMIT_NAMES = tuple(MotorLimits.__annotations__)
LOOP_LIMIT_NAMES = tuple(LoopLimits.__annotations__)
CHOICE_NAMES = tuple(Choices.__annotations__)
"""Each group in the order of the wire; the choices end the limits of every board."""


class ArmLimits(Protocol):
    """The limits a board is armed with."""

    def as_array(self) -> NDArray[np.int64]:
        """Return the limits in the order of the wire."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A kind of board, as described by its frames."""

    name: str  # its name: in the host library, in messages, in configurations
    title: str  # first line of the contract
    tick_us: int  # period of a control tick and of a sample, microseconds
    sample: np.dtype[np.void]  # layout of a sample
    arm: np.dtype[np.void]  # layout of the arm command: header, gains, limits
    setpoint: np.dtype[np.void]  # layout of one setpoint, one field a motor
    max_setpoints: int  # most setpoints in one frame
    motors: int  # motors with a position loop
    # fields of a sample that the guards check, in the order of their channels
    input_names: tuple[str, ...]
    further_names: tuple[str, ...] = ()  # fields a trip can name behind those
    sampled_hz: float | None = None  # samples a second where they are not those of the core's ticks

    @property
    def rate_hz(self) -> float:
        """Samples a second, by default one each control tick."""
        return self.sampled_hz or 1e6 / self.tick_us

    @property
    def setpoint_names(self) -> tuple[str, ...]:
        """Names of a setpoint's fields."""
        return tuple(self.setpoint.names or ())

    @cached_property
    def layouts(self) -> dict[Kind, np.dtype[np.void]]:
        """Layout of every frame kind; that of setpoints is the header before them."""
        own = {Kind.SAMPLE: self.sample, Kind.ARM: self.arm}
        return {kind: (own | protocol.LAYOUTS)[kind] for kind in Kind}

    @cached_property
    def text(self) -> str:
        """The contract, one line a frame kind, the same in the firmware's source."""
        lines = [self.title, "COBS(payload, CRC-16/CCITT-FALSE u2) 00"]
        repeated = f", {self.max_setpoints} x ({_fields(self.setpoint)})"
        for kind, layout in self.layouts.items():
            more = repeated if kind is Kind.SETPOINTS else ""
            lines.append(f"{kind} {kind.name}: {_fields(layout)}{more}")
        states = ", ".join(f"{getattr(protocol, f'STATUS_{name}')} {name}" for name in _STATES)
        lines.append(f"status: {states}, trip << {protocol.TRIP_SHIFT}")
        for named in (Trip, Result):
            meanings = ", ".join(f"{one.value} {one.name}" for one in named)
            lines.append(f"{named.__name__.lower()}: {meanings}")
        return "".join(f"{line}\n" for line in lines)

    @cached_property
    def protocol_hash(self) -> int:
        """CRC-32 of `text`; the board's hello carries its own."""
        return zlib.crc32(self.text.encode())

    def encode_arm(
        self, sequence: int, gains: NDArray[np.float64], limits: ArmLimits, session: int
    ) -> bytes:
        """Return the payload of the arm command; gains motor after motor."""
        values = (*gains.ravel().tolist(), *limits.as_array().tolist())
        return np.array((VERSION, Kind.ARM, sequence, session, *values), self.arm).tobytes()

    def whole_setpoints(self, columns: Sequence[NDArray[np.integer]]) -> list[NDArray[Any]]:
        """Return the fields of setpoints, in the order of `setpoint`, in the board's number types.

        Raises:
            DriverError: The arrays do not fit each other or the board's number range.
        """
        names = self.setpoint_names
        if len(columns) != len(names):
            raise DriverError(f"A setpoint has {', '.join(names)}; {len(columns)} were given.")
        pairs = list(zip(names, columns, strict=True))
        whole = [_whole(values, self.setpoint[name], name) for name, values in pairs]
        if len({values.shape for values in whole}) > 1:
            sizes = ", ".join(f"{v.size} of {n}" for n, v in zip(names, whole, strict=True))
            raise DriverError(f"The fields of the setpoints differ in number: {sizes}.")
        return whole

    def encode_setpoints(
        self, sequence: int, columns: Sequence[NDArray[Any]], session: int
    ) -> bytes:
        """Return the payload of one block of setpoints: a column a field, each of shape (n,)."""
        block = np.empty(len(columns[0]), self.setpoint)
        for name, values in zip(self.setpoint_names, columns, strict=True):
            block[name] = values
        head = np.array((VERSION, Kind.SETPOINTS, sequence, session), SESSION_DTYPE)
        return head.tobytes() + block.tobytes()

    def decode(self, payload: bytes) -> tuple[Kind, int, np.void]:
        """Return kind, sequence and fields of any frame but a sample.

        The fields of a block of setpoints are its header; the block is `decode_setpoints`.

        Raises:
            FrameError: Too short, of another version, of an unknown kind, or of the wrong size.
        """
        if len(payload) < protocol.HEADER_DTYPE.itemsize:
            raise FrameError(f"A frame of {len(payload)} bytes holds no header.")
        version, number = payload[0], payload[1]
        if version != VERSION:
            raise FrameError(f"A frame has layout version {version}, not {VERSION}.")
        if number not in Kind.__members__.values() or number == Kind.SAMPLE:
            raise FrameError(f"A frame has the unknown kind {number}.")
        kind = Kind(number)
        body = len(payload) - self.layouts[kind].itemsize
        setpoints, rest = divmod(body, self.setpoint.itemsize)
        whole = rest == 0 and 1 <= setpoints <= self.max_setpoints
        if not (whole if kind is Kind.SETPOINTS else body == 0):
            raise FrameError(f"A {kind.name} frame has {len(payload)} bytes.")
        fields = np.frombuffer(payload, self.layouts[kind], count=1)[0]
        return kind, int(fields["sequence"]), fields

    def decode_setpoints(self, payload: bytes) -> NDArray[np.void]:
        """Return the setpoints of a block, shape (n,), fields as in `setpoint`."""
        return np.frombuffer(payload, self.setpoint, offset=SESSION_DTYPE.itemsize)

    def decode_trip_report(self, fields: np.void) -> TripReport:
        """Return the crossed limit that a board reports; FrameError of an unknown reason."""
        code, channel = int(fields["code"]), int(fields["channel"])
        named = self.input_names + self.further_names
        if code not in Trip.__members__.values():
            raise FrameError(f"A board tripped for the unknown reason {code}.")
        numbers = (int(fields[name]) for name in ("value", "limit", "tick_us", "late_us"))
        return TripReport(Trip(code), named[channel] if channel < len(named) else "", *numbers)


def _fields(layout: np.dtype[np.void]) -> str:
    assert layout.names is not None  # noqa: S101
    return ", ".join(f"{name} {layout[name].str.lstrip('<|')}" for name in layout.names)


def _whole(values: NDArray[np.integer], kind: np.dtype[Any], name: str) -> NDArray[Any]:
    array = np.atleast_1d(np.asarray(values))
    bounds = np.iinfo(kind)
    if not np.issubdtype(array.dtype, np.integer) or array.ndim != 1:
        raise DriverError(
            f"A {name} setpoint is a whole number, not {array.dtype} of {array.ndim} dimensions.",
            fix="Round to counts first.",
        )
    if array.size and not (bounds.min <= array.min() and array.max() <= bounds.max):
        raise DriverError(
            f"A {name} setpoint lies outside {bounds.min}..{bounds.max}.",
            f"The setpoints reach from {array.min()} to {array.max()}.",
        )
    return np.asarray(array.astype(kind))
