"""The logger's frames on a CAN bus: the same payload and CRC, cut into 7-byte pieces, no COBS.

Byte 0 of every CAN frame: bit 7 the first piece, bit 6 the last, bits 0 to 5 a counter that goes on
from frame to frame. The board's side is `firmware/core/can_segments.hpp`.
"""

from collections.abc import Iterator

FIRST, LAST, COUNTER = 0x80, 0x40, 0x3F
PIECE = 7
HOST_ID, BOARD_ID = 0x690, 0x6A0
"""Identifiers of what the host and what the board sends, unless set otherwise."""
LONGEST = 1026
"""Longest payload with its CRC."""


class Splitter:
    """Cuts frames into pieces, numbered through."""

    def __init__(self) -> None:
        self._counter = 0

    def split(self, body: bytes) -> Iterator[bytes]:
        """Yield the data of the CAN frames that carry a payload and its CRC."""
        for start in range(0, len(body), PIECE):
            head = self._counter
            self._counter = (self._counter + 1) & COUNTER
            head |= FIRST if start == 0 else 0
            head |= LAST if start + PIECE >= len(body) else 0
            yield bytes([head]) + body[start : start + PIECE]


class Joiner:
    """Joins pieces. A frame with a lost piece is returned incomplete: its CRC fails."""

    def __init__(self) -> None:
        self._body = b""
        self._open = False
        self._expected: int | None = None

    def join(self, data: bytes) -> list[bytes]:
        """Take the data of one CAN frame; return the bodies it ends, whole or broken."""
        if not data:
            return []
        head = data[0]
        in_order = self._expected is None or head & COUNTER == self._expected
        self._expected = (head + 1) & COUNTER
        ended = []
        if self._open and (head & FIRST or not in_order):
            ended.append(self._take())
        if head & FIRST:
            self._open, self._body = True, b""
        if self._open:
            self._body += data[1:]
            if head & LAST or len(self._body) > LONGEST:
                ended.append(self._take())
        elif not in_order:
            ended.append(data[1:])  # a frame whose beginning was lost is to be counted as well
        return ended

    def _take(self) -> bytes:
        body, self._body, self._open = self._body, b"", False
        return body
