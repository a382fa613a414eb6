"""The QIA128's bytes: packets with a weighted checksum, and a bare stream of readings.

Source: `qia128_uart.h`, a public motor-controller library's list of the amplifier's packets; the
checksum is checked against every packet there. FUTEK's own description is guide EM1066.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError

FRAME_SIZE = 4
MIDDLE = 1 << 23
"""Reading without input."""
TOP = (1 << 24) - 1
STREAM = (0x00, 0x0C)
GET_SERIAL = (0x01, 0x00)
GET_CALIBRATION = (0x03, 0x19)
SET_RATE = (0x04, 0x1E)
ZERO_POINT, FULL_SCALE_POINT = 0, 5
RATE_1300 = 7
"""Code of 1300 samples a second, the only one known."""


def checksum(data: bytes) -> int:
    """Return the sum of the bytes, each times its place counted from 1, modulo 256."""
    return sum(place * byte for place, byte in enumerate(data, 1)) % 256


def encode_packet(command: tuple[int, int], payload: bytes = b"") -> bytes:
    """Return the packet of a command, or of the answer to it."""
    body = bytes([0x00, len(payload) + 5, *command]) + payload
    return body + bytes([checksum(body)])


def set_stream(on: bool) -> bytes:
    """Return the packet that switches the stream of readings."""
    return encode_packet(STREAM, bytes([on]))


def set_rate() -> bytes:
    """Return the packet that sets the sample rate, 1300 Hz."""
    return encode_packet(SET_RATE, bytes([0x00, RATE_1300]))


def decode_packet(packet: bytes) -> tuple[tuple[int, int], bytes]:
    """Return command and payload of a packet; FrameError where length or checksum do not fit."""
    if len(packet) < 5 or packet[0] != 0x00 or packet[1] != len(packet):
        raise FrameError("A QIA128 packet has the wrong length.", "Bytes were lost.")
    if checksum(packet[:-1]) != packet[-1]:
        raise FrameError("The checksum of a QIA128 packet does not fit.", "Bytes changed.")
    return (packet[2], packet[3]), packet[4:-1]


def find_packet(data: bytes, command: tuple[int, int]) -> tuple[bytes, int] | None:
    """Return the payload of the first good packet of a command in `data`, and where it ends."""
    for start in range(len(data) - 4):
        end = start + data[start + 1]
        if data[start] or data[start + 2 : start + 4] != bytes(command) or end > len(data):
            continue
        try:
            return decode_packet(data[start:end])[1], end
        except FrameError:
            continue
    return None


def frame_checks(candidates: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return for each row, shape (m, 4), whether it is a reading with its checksum."""
    weighted = candidates[:, :3] * np.array([1, 2, 3], np.uint8)
    return np.asarray(weighted.sum(axis=1, dtype=np.uint8) == candidates[:, 3])


def readings(frames: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the raw readings in frames of shape (n, 4), 0 to 2^24 - 1, shape (n,)."""
    wide = frames.astype(np.int64)
    return wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2]


def encode_frames(raw: NDArray[np.integer]) -> bytes:
    """Return readings as the stream carries them."""
    wide = np.asarray(raw, np.int64)
    frames = np.stack([wide >> 16, wide >> 8, wide, np.zeros_like(wide)], axis=1).astype(np.uint8)
    frames[:, 3] = (frames[:, :3] * np.array([1, 2, 3], np.uint8)).sum(axis=1, dtype=np.uint8)
    return frames.tobytes()
