"""The USB520's lines: a signed value with five decimals, a space, a unit, CR LF.

Source: a public Python class for the USB520 and notes of other users; the binary mode, which
FUTEK's own software switches to, is not published.
"""

import math
import re
from dataclasses import dataclass

from drivers.errors import FrameError

LONGEST_LINE = 64
"""Bytes; the lines seen have about 18. More without a line feed is noise."""
_LINE = re.compile(rb"([+-]\d{1,9}\.\d{5}) ([A-Za-z-]{1,8})\r\n")


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a unit on a line stands for: a column, its SI unit, and how many of it one is."""

    name: str
    unit: str
    factor: float


QUANTITIES = {
    "N-m": Quantity("torque_n_m", "N m", 1.0),
    "deg": Quantity("angle_rad", "rad", math.pi / 180),
    "rpm": Quantity("speed_rad_s", "rad/s", 2 * math.pi / 60),
    "KW": Quantity("power_w", "W", 1000.0),
}
"""The units seen, by the text on a line."""


def decode_line(line: bytes) -> tuple[float, str]:
    """Return value and unit of a whole line, its end included; `FrameError` for any other."""
    found = _LINE.fullmatch(line)
    if found is None:
        raise FrameError(f"{line!r} is not a USB520's value and unit.", "Bytes were lost.")
    unit = found[2].decode("ascii")
    if unit not in QUANTITIES:
        raise FrameError(
            f"A USB520 sends the unit {unit!r}.",
            f"Known are: {', '.join(QUANTITIES)}.",
            "Choose another unit in FUTEK's software.",
        )
    return float(found[1]), unit


def encode_line(value: float, unit: str) -> bytes:
    """Return the line of a value."""
    return f"{value:+.5f} {unit}\r\n".encode("ascii")
