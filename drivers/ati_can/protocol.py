"""NETCANOEM's frames: one operation a request, replies of one to three frames. All big-endian.

The identifier is `base << 4 | operation`, of a reply as of a request; a reply's second and third
frame carry the operations that follow. Frames have no number: only their order identifies the
request of a reply.

Source: ATI manual 9610-05-1030 (NETCANOEM).
"""

import struct

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError
from drivers.transport.can_bus import CanFrame

DEFAULT_BASE = 0x20
HIGHEST_BASE = 0x7F
READ, READ_SECOND, MATRIX_ROW, SERIAL, CALIBRATION = 0x0, 0x1, 0x2, 0x5, 0x6
COUNTS_PER_UNIT, UNIT_CODES, FIRMWARE = 0x7, 0x8, 0xF
ASSUMED_COUNTS_PER_UNIT = 1_000_000
"""Value for firmware before 3.7, which does not report it."""
TELLS_UNITS = (3, 7)
"""First firmware that answers for counts per unit and unit codes."""
GAUGES = 6
GAUGE_MIN, GAUGE_MAX = -(2**15), 2**15 - 1

STATUS_BITS = {
    0: "watchdog reset the board",
    1: "excitation or converter too high",
    2: "excitation or converter too low",
    3: "artificial ground out of range",
    4: "supply too high",
    5: "supply too low",
    6: "active calibration is bad",
    7: "settings memory failed",
    8: "configuration is invalid",
    11: "temperature too high",
    12: "temperature too low",
    14: "CAN error",
}
"""Meaning of each bit of the status; bit 15 is set when any other is set."""
UNUSABLE = sum(1 << bit for bit in (1, 2, 3, 4, 5, 6, 7, 11, 12))
"""Bits with which the readings are not to be used."""

_FIRST = struct.Struct(">H3h")
_SECOND = struct.Struct(">3h")
_PAIR = struct.Struct(">2f")
VERSION_REPLY = struct.Struct(">BBH")
COUNTS_REPLY = struct.Struct(">II")


def identifier(base: int, operation: int) -> int:
    """Return the CAN identifier of an operation."""
    return base << 4 | operation


def request(base: int, operation: int, data: bytes = b"") -> CanFrame:
    """Return the request for an operation."""
    return CanFrame(identifier(base, operation), data)


def encode_reading(base: int, status: int, gauges: list[int]) -> list[CanFrame]:
    """Return the two frames of a reading; gauges in their order 0 to 5."""
    g0, g1, g2, g3, g4, g5 = gauges
    return [
        request(base, READ, _FIRST.pack(status, g0, g2, g4)),
        request(base, READ_SECOND, _SECOND.pack(g1, g3, g5)),
    ]


def decode_reading(first: bytes, second: bytes) -> tuple[int, NDArray[np.int16]]:
    """Return status and gauges 0 to 5, shape (6,), of the two frames of a reading.

    Raises:
        FrameError: A frame has the wrong size.
    """
    status, g0, g2, g4 = _FIRST.unpack(_sized(first, _FIRST.size, "first frame of a reading"))
    g1, g3, g5 = _SECOND.unpack(_sized(second, _SECOND.size, "second frame of a reading"))
    return status, np.array([g0, g1, g2, g3, g4, g5], np.int16)


def encode_matrix_row(base: int, row: NDArray[np.float64]) -> list[CanFrame]:
    """Return the three frames of a row of the matrix, shape (6,)."""
    return [
        request(base, MATRIX_ROW + pair, _PAIR.pack(*row[2 * pair : 2 * pair + 2]))
        for pair in range(3)
    ]


def decode_matrix_row(replies: list[bytes]) -> NDArray[np.float64]:
    """Return a row of the matrix, shape (6,), of its three frames.

    Raises:
        FrameError: A frame has the wrong size, or a value is not finite.
    """
    values = [_PAIR.unpack(_sized(reply, _PAIR.size, "matrix frame")) for reply in replies]
    row = np.array(values, np.float64).reshape(GAUGES)
    if not np.isfinite(row).all():
        raise FrameError("The sensor's matrix holds a value that is not finite.")
    return row


def decode_counts_per_unit(reply: bytes) -> tuple[int, int]:
    """Return counts per unit of force and of torque; `FrameError` for a wrong size or a 0."""
    force, torque = COUNTS_REPLY.unpack(_sized(reply, COUNTS_REPLY.size, "counts frame"))
    if not (force and torque):
        raise FrameError("The sensor has no counts per unit.")
    return force, torque


def decode_firmware(reply: bytes) -> tuple[int, int, int]:
    """Return major and minor version and build; `FrameError` for a wrong size."""
    major, minor, build = VERSION_REPLY.unpack(_sized(reply, VERSION_REPLY.size, "firmware frame"))
    return major, minor, build


def decode_serial(reply: bytes) -> str:
    """Return the serial number; `FrameError` for a wrong size, or where it is not text."""
    text = _sized(reply, 8, "serial number frame").rstrip(b"\0 ")
    if not text.isascii():
        raise FrameError("The sensor's serial number is not text.")
    return text.decode("ascii")


def is_saturated(gauges: NDArray[np.int16]) -> bool:
    """Whether any gauge is at an end of its range: the whole wrench is then wrong."""
    return bool(((gauges <= GAUGE_MIN) | (gauges >= GAUGE_MAX)).any())


def status_words(status: int) -> list[str]:
    """Return the meaning of a status, one phrase per bit; empty for a healthy device."""
    return [STATUS_BITS.get(bit, f"bit {bit} is set") for bit in range(15) if status >> bit & 1]


def _sized(data: bytes, size: int, name: str) -> bytes:
    if len(data) != size:
        raise FrameError(f"A {name} has {size} bytes, not {len(data)}.")
    return data
