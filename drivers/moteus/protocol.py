"""The moteus' bytes: subframes of its register protocol, and the fdcanusb's lines around them.

Source: moteus' published documentation, "CAN protocol" (with its example) and "Register reference";
lines as in the fdcanusb's documentation. All little-endian.
"""

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.errors import FrameError

HIGHEST_ID = 126
HOST = 0
WANTS_REPLY = 0x8000
WRITE, READ, REPLY, NOP = 0x00, 0x10, 0x20, 0x50
INT8, INT32, FLOAT = 0, 2, 3
"""Types of values; a subframe's two bits above the two of its count."""
_FORMATS = {INT8: "b", 1: "h", INT32: "i", FLOAT: "f"}
_FRAME_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""What a CAN-FD frame can carry, bytes."""
LONGEST_LINE = 256
"""Bytes; a reply has less than 180. More without a line feed is noise."""

MODE, POSITION, CURRENT, VOLTAGE, COMMAND = 0x000, 0x001, 0x004, 0x00D, 0x020
"""First registers of what is read and written: mode; position, velocity, torque; current in
quadrature; voltage, temperature, fault; and the position command's eight."""
MODEL, SERIAL = 0x100, 0x120
STOPPED, FAULT, POSITION_MODE, TIMEOUT = 0, 1, 10, 11
PREPARING = (2, 3, 4)
VOLTS_A_UNIT = 0.5
FAULTS = {
    32: "the encoder sensed no magnet while it was calibrated",
    33: "the motor driver failed, most often because the supply gave in",
    34: "the bus voltage is too high: the motor feeds energy back",
    35: "the encoder's readings fit no magnet",
    36: "the motor has not been calibrated (moteus_tool --calibrate)",
    37: "the firmware was too slow for its cycle",
    38: "it is too hot",
    39: "it stands outside its position limits",
    40: "the voltage is too low",
    41: "its configuration changed while it ran",
    42: "it has no valid commutation encoder",
    43: "it has no valid output encoder",
    44: "its gate driver could not be enabled",
    46: "the firmware missed a deadline",
    48: "its position limits are beyond what it can count",
}
"""Meaning of a fault code. Codes from 96 on name the active limit; they are not faults."""


@dataclass(frozen=True, slots=True)
class State:
    """What a controller answers in every cycle."""

    mode: int
    position_rev: float  # angle of the output, turns
    velocity_rev_s: float  # speed of the output, turns a second
    torque_n_m: float  # torque at the output
    current_a: float  # motor current in quadrature
    voltage: int  # supply, 0.5 V
    temperature: int  # board, degrees Celsius
    fault: int


STATE_QUESTION = bytes([0x11, MODE, 0x1F, POSITION, 0x13, VOLTAGE, 0x1D, CURRENT])
"""Read one int8 from the mode on, three floats from the position, three int8 from the voltage, and
the current in quadrature."""


def stop_command() -> bytes:
    """Return the subframe that takes the motor out of force and clears a fault."""
    return write(INT8, MODE, [STOPPED])


def torque_command(torque_n_m: float, most_n_m: float, watchdog_s: float) -> bytes:
    """Return the subframes of position mode with no control but a torque at the output.

    `most_n_m` is what the controller may apply; after the watchdog's time it enters its timeout
    mode.
    """
    values = [math.nan, 0.0, torque_n_m, 0.0, 0.0, most_n_m, math.nan, watchdog_s]
    return write(INT8, MODE, [POSITION_MODE]) + write(FLOAT, COMMAND, values)


def write(kind: int, first: int, values: Sequence[float]) -> bytes:
    """Return the subframe that writes registers from `first` on."""
    return _head(WRITE, kind, len(values), first) + _packed(kind, values)


def read(kind: int, first: int, count: int) -> bytes:
    """Return the subframe that reads registers."""
    return _head(READ, kind, count, first)


def reply(kind: int, first: int, values: Sequence[float]) -> bytes:
    """Return the subframe that answers a reading."""
    return _head(REPLY, kind, len(values), first) + _packed(kind, values)


def subframes(data: bytes) -> Iterator[tuple[int, int, int, int, tuple[float, ...]]]:
    """Yield what a frame is made of: operation, type, first register, count and values.

    Raises:
        FrameError: It is not made of whole subframes of the known kinds.
    """
    place = 0
    while place < len(data):
        head = data[place]
        place += 1
        if head == NOP:
            continue
        operation, kind, count = head & 0xF0, head >> 2 & 3, head & 3
        if operation not in (WRITE, READ, REPLY):
            raise FrameError(f"{head:#04x} begins no subframe of a moteus.")
        if not count:
            count, place = _number(data, place)
        first, place = _number(data, place)
        values: tuple[float, ...] = ()
        if operation != READ:
            layout = struct.Struct(f"<{count}{_FORMATS[kind]}")
            if len(data) < place + layout.size:
                raise FrameError("A subframe of a moteus has not all of its values.")
            values = layout.unpack_from(data, place)
            place += layout.size
        yield operation, kind, first, count, values


def registers(data: bytes) -> dict[int, float]:
    """Return the values of an answer by register; `FrameError` where it is none."""
    found: dict[int, float] = {}
    for operation, _, first, _, values in subframes(data):
        if operation != REPLY:
            raise FrameError("A frame of a moteus is not an answer.")
        found |= {first + offset: value for offset, value in enumerate(values)}
    return found


def decode_state(data: bytes) -> State:
    """Return the content of the answer to `STATE_QUESTION`.

    Raises:
        FrameError: A register is missing, or a value is not finite.
    """
    found = registers(data)
    names = (MODE, *range(POSITION, POSITION + 4), *range(VOLTAGE, VOLTAGE + 3))
    values = [found.get(name, math.nan) for name in names]
    if not all(map(math.isfinite, values)):
        raise FrameError("An answer of a moteus lacks a register, or holds no number.")
    mode, position, velocity, torque, current, *last = values
    voltage, temperature, fault = map(int, last)
    return State(int(mode), position, velocity, torque, current, voltage, temperature, fault)


def encode_state(state: State) -> bytes:
    """Return the answer to `STATE_QUESTION`."""
    motion = [state.position_rev, state.velocity_rev_s, state.torque_n_m]
    return (
        reply(INT8, MODE, [state.mode])
        + reply(FLOAT, POSITION, motion)
        + reply(INT8, VOLTAGE, [state.voltage, state.temperature, state.fault])
        + reply(FLOAT, CURRENT, [state.current_a])
    )


def send_line(device_id: int, data: bytes) -> bytes:
    """Return the fdcanusb's line that sends a frame from the host and wants a reply."""
    return f"can send {WANTS_REPLY | HOST << 8 | device_id:x} {padded(data).hex()}\n".encode()


def receive_line(device_id: int, data: bytes) -> bytes:
    """Return the fdcanusb's line for a frame from a controller to the host."""
    return f"rcv {device_id << 8 | HOST:x} {padded(data).hex()} E B F\r\n".encode()


def padded(data: bytes) -> bytes:
    """Return a frame's data filled up to a size that a CAN-FD frame has."""
    return data.ljust(next(size for size in _FRAME_SIZES if size >= len(data)), bytes([NOP]))


def decode_line(line: bytes) -> tuple[int, bytes] | None:
    """Return identifier and data of a line, None of one without a frame; FrameError of neither."""
    words = line.split()
    if not words or words == [b"OK"]:
        return None
    if words[0] not in (b"rcv", b"can") or len(words) < 3:
        raise FrameError(f"{line[:40]!r} is not a line of an fdcanusb.")
    identifier, data = (words[2], words[3:4]) if words[0] == b"can" else (words[1], words[2:3])
    try:
        return int(identifier, 16), bytes.fromhex(data[0].decode("ascii"))
    except (ValueError, IndexError, UnicodeDecodeError) as error:
        raise FrameError(f"{line[:40]!r} is not an fdcanusb line.", "Bytes changed.") from error


def _head(operation: int, kind: int, count: int, first: int) -> bytes:
    begins = operation | kind << 2
    counted = bytes([begins | count]) if count <= 3 else bytes([begins]) + _varuint(count)
    return counted + _varuint(first)


def _packed(kind: int, values: Sequence[float]) -> bytes:
    whole = values if kind == FLOAT else [int(value) for value in values]
    return struct.pack(f"<{len(values)}{_FORMATS[kind]}", *whole)


def _varuint(value: int) -> bytes:
    data = bytearray()
    while value > 0x7F:
        data.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*data, value])


def _number(data: bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while place < len(data) and shift < 35:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if not byte & 0x80:
            return value, place
    raise FrameError("A number in a frame of a moteus does not end.")
