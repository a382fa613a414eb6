"""Compiled loops of `drivers.framing`: frames and CRCs of the bulk path."""

from binascii import crc_hqx
from functools import lru_cache

import numba
import numpy as np
from numpy.typing import NDArray

CRC_START = 0xFFFF
CRC_SIZE = 2
MAX_BLOCK = 254
"""Most bytes COBS carries behind one code byte."""
MAX_PAYLOAD = 1024
"""Longest payload a board takes or sends; longer frames are noise."""
MAX_BULK_PAYLOAD = MAX_BLOCK - CRC_SIZE
"""Longest payload of the bulk path: one code byte of overhead, whatever the content."""
MAX_WIRE = MAX_PAYLOAD + CRC_SIZE + (MAX_PAYLOAD + CRC_SIZE) // MAX_BLOCK + 1
"""Longest frame on the wire, without its delimiter."""


@lru_cache
def crc_tables(payload_size: int) -> tuple[NDArray[np.uint16], int]:
    """Return the CRC's share of each byte value at each place, and the share of the start value.

    The CRC is linear over GF(2): that of a message of fixed length is the XOR of the contribution
    of each byte at its place. The look-ups are independent, unlike those of a byte-wise CRC. Shape
    (payload_size * 256,).
    """
    if not 0 <= payload_size <= MAX_BULK_PAYLOAD:
        raise ValueError(f"bulk payloads have 0 to {MAX_BULK_PAYLOAD} bytes, not {payload_size}")
    tables = np.empty((payload_size, 256), np.uint16)
    for place in range(payload_size):
        zeros_behind = bytes(payload_size - 1 - place)
        tables[place] = [crc_hqx(bytes([value]) + zeros_behind, 0) for value in range(256)]
    return tables.ravel(), crc_hqx(bytes(payload_size), CRC_START)


# The loops below index flat arrays and never slice: a slice costs these kernels more than the copy.


@numba.njit(cache=True)
def unstuff(
    data: NDArray[np.uint8],
    ends: NDArray[np.int64],
    payload_size: int,
    payloads: NDArray[np.uint8],
    crcs: NDArray[np.uint16],
    spans: NDArray[np.int64],
) -> tuple[int, int, int, int]:
    """Undo COBS of every frame that fits, given where each ends, and note the spans of the others.

    Fills `payloads` (flat) and `crcs`, as received and not yet compared: comparing them here would
    hold up the next frame behind each frame's last branch.
    """
    wire = payload_size + 3  # code byte, payload, CRC
    position = whole = bad = bad_bytes = found = 0
    for end in ends:
        length = end - position
        if length == wire:
            if _unstuff_frame(data, position, payload_size, payloads, crcs, whole):
                whole += 1
            else:
                bad += 1
                bad_bytes += length + 1
        elif length > MAX_WIRE:
            bad += 1
            bad_bytes += length + 1
        elif length > 0:  # two delimiters in a row are a legal idle
            spans[found, 0] = position
            spans[found, 1] = end
            found += 1
        position = end + 1
    return whole, bad, bad_bytes, found


@numba.njit(cache=True)
def _unstuff_frame(
    data: NDArray[np.uint8],
    position: int,
    payload_size: int,
    payloads: NDArray[np.uint8],
    crcs: NDArray[np.uint16],
    row: int,
) -> bool:
    """Undo COBS of the frame at `position`; False when it is not COBS."""
    first = row * payload_size
    for place in range(payload_size):
        payloads[np.uintp(first + place)] = data[np.uintp(position + 1 + place)]
    low = data[position + payload_size + 1]
    high = data[position + payload_size + 2]
    wire = payload_size + 3
    following = int(data[position])
    while following < wire:  # every later code byte stands where a zero was
        place = following - 1
        if place < payload_size:
            payloads[np.uintp(first + place)] = 0
        elif place == payload_size:
            low = np.uint8(0)
        else:
            high = np.uint8(0)
        following += int(data[np.uintp(position + following)])
    crcs[row] = low + 256 * high
    return following == wire


@numba.njit(cache=True)
def keep_good(
    payloads: NDArray[np.uint8],
    whole: int,
    payload_size: int,
    crcs: NDArray[np.uint16],
    tables: NDArray[np.uint16],
    start: int,
) -> int:
    """Move the payloads whose CRC fits to the front; return how many there are."""
    good = 0
    for row in range(whole):
        first = row * payload_size
        if _crc(payloads, first, payload_size, tables, start) != crcs[row]:
            continue
        if good != row:
            for place in range(payload_size):
                payloads[good * payload_size + place] = payloads[first + place]
        good += 1
    return good


@numba.njit(cache=True)
def _crc(
    payloads: NDArray[np.uint8],
    first: int,
    payload_size: int,
    tables: NDArray[np.uint16],
    start: int,
) -> int:
    """Return the CRC of one payload; four sums side by side, so that none waits for another."""
    sums_0, sums_1, sums_2, sums_3 = np.uint32(start), np.uint32(0), np.uint32(0), np.uint32(0)
    place = 0
    while place + 4 <= payload_size:
        at, table = first + place, place << 8
        sums_0 ^= tables[np.uintp(table + payloads[np.uintp(at)])]
        sums_1 ^= tables[np.uintp(table + 256 + payloads[np.uintp(at + 1)])]
        sums_2 ^= tables[np.uintp(table + 512 + payloads[np.uintp(at + 2)])]
        sums_3 ^= tables[np.uintp(table + 768 + payloads[np.uintp(at + 3)])]
        place += 4
    while place < payload_size:
        sums_0 ^= tables[np.uintp((place << 8) + payloads[np.uintp(first + place)])]
        place += 1
    return int(sums_0 ^ sums_1 ^ sums_2 ^ sums_3)


@numba.njit(cache=True)
def encode(
    payloads: NDArray[np.uint8],
    payload_size: int,
    tables: NDArray[np.uint16],
    start: int,
    wire: NDArray[np.uint8],
) -> None:
    """Fill `wire`, shape (n, payload_size + 4), with one frame a row."""
    for row in range(wire.shape[0]):
        first = row * payload_size
        for place in range(payload_size):
            wire[row, place + 1] = payloads[np.uintp(first + place)]
        crc = _crc(payloads, first, payload_size, tables, start)
        wire[row, payload_size + 1] = crc & 0xFF
        wire[row, payload_size + 2] = crc >> 8
        wire[row, payload_size + 3] = 0
        following = payload_size + 3
        for place in range(payload_size + 2, 0, -1):
            if wire[row, place] == 0:
                wire[row, place] = following - place
                following = place
        wire[row, 0] = following
