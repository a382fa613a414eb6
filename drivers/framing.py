"""Frames on a byte link: COBS, a CRC-16/CCITT-FALSE at the end, 0x00 between frames.

A frame on the wire is `COBS(payload + CRC little-endian) + 0x00`. The delimiter never occurs inside
a frame, so a reader that has lost its place discards up to the next 0x00 and is in step again.

Two ways in: one frame at a time (`encode_frame`, `decode_frame`) for commands and replies, and a
compiled bulk path (`encode_frames`, `decode_frames`, `FrameStream`) for the stream of equal-sized
sample frames.

Source: S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on
Networking 7(2), 1999. CRC: polynomial 0x1021, start 0xFFFF, not reflected, no final XOR
(check value of "123456789": 0x29B1).
"""

from binascii import crc_hqx
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers import framing_compiled as compiled
from drivers.errors import FrameError
from drivers.framing_compiled import CRC_SIZE, CRC_START, MAX_BLOCK, MAX_WIRE

DELIMITER = b"\x00"


def crc16(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE of `data`."""
    return crc_hqx(data, CRC_START)


def cobs_encode(data: bytes) -> bytes:
    """Return `data` stuffed so that it holds no zero byte, without a delimiter."""
    encoded = bytearray()
    *others, last = data.split(b"\x00")
    for part in others:
        for first in range(0, len(part) + 1, MAX_BLOCK):
            encoded += _block(part[first : first + MAX_BLOCK])
    for first in range(0, len(last) or 1, MAX_BLOCK):  # a full block at the end needs no more
        encoded += _block(last[first : first + MAX_BLOCK])
    return bytes(encoded)


def _block(part: bytes) -> bytes:
    return bytes([len(part) + 1]) + part


def cobs_decode(encoded: bytes) -> bytes:
    """Return the bytes that `cobs_encode` stuffed; `FrameError` for what is not COBS."""
    data, position = bytearray(), 0
    while position < len(encoded):
        code = encoded[position]
        part = encoded[position + 1 : position + code]
        if len(part) != code - 1 or 0 in part:
            raise FrameError("A frame is not COBS.", "Bytes were lost or changed on the link.")
        data += part
        position += code
        if code <= MAX_BLOCK and position < len(encoded):
            data.append(0)
    return bytes(data)


def encode_frame(payload: bytes) -> bytes:
    """Return one frame as it goes on the wire, delimiter included."""
    return cobs_encode(payload + crc16(payload).to_bytes(CRC_SIZE, "little")) + DELIMITER


def decode_frame(encoded: bytes) -> bytes:
    """Return the payload of one frame, given without its delimiter.

    Raises:
        FrameError: Not COBS, too short to hold a CRC, or the CRC does not fit.
    """
    body = cobs_decode(encoded)
    if len(body) < CRC_SIZE:
        raise FrameError("The frame is too short to hold a CRC.")
    payload, expected = body[:-CRC_SIZE], int.from_bytes(body[-CRC_SIZE:], "little")
    if crc16(payload) != expected:
        raise FrameError("The CRC of a frame does not fit.", "Bytes changed on the link.")
    return payload


@dataclass(frozen=True, slots=True)
class DecodedFrames:
    """What a stretch of a byte stream held."""

    # good frames of the expected size, shape (n, payload_size), uint8, in order
    payloads: NDArray[np.uint8]
    others: list[bytes]  # payloads of good frames of any other size, in order
    bad: int  # frames dropped: not COBS, wrong CRC, or too long
    bad_bytes: int  # bytes in those frames, delimiters included
    tail: bytes  # bytes behind the last delimiter: the start of the next frame


def decode_frames(data: bytes, payload_size: int) -> DecodedFrames:
    """Decode every whole frame in `data`, which starts at a frame's start.

    Those of `payload_size`, 0 to `MAX_BULK_PAYLOAD` bytes, are decoded by compiled code.
    """
    tables, start = compiled.crc_tables(payload_size)
    stream = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(stream == 0)
    room = len(data) // (payload_size + CRC_SIZE + 2)
    payloads = np.empty(room * payload_size, np.uint8)
    crcs = np.empty(room, np.uint16)
    spans = np.empty((len(ends), 2), np.int64)
    whole, bad, bad_bytes, found = compiled.unstuff(
        stream, ends, payload_size, payloads, crcs, spans
    )
    good = compiled.keep_good(payloads, whole, payload_size, crcs, tables, start)
    bad += whole - good
    bad_bytes += (whole - good) * (payload_size + CRC_SIZE + 2)
    tail = data[ends[-1] + 1 :] if len(ends) else data
    others = []
    for first, end in spans[:found].tolist():
        try:
            others.append(decode_frame(data[first:end]))
        except FrameError:
            bad += 1
            bad_bytes += end - first + 1
    rows = payloads[: good * payload_size].reshape(good, payload_size)
    return DecodedFrames(rows, others, bad, bad_bytes, tail)


def encode_frames(payloads: NDArray[np.uint8]) -> bytes:
    """Encode equal-sized payloads, shape (n, payload_size), as one run of frames."""
    count, payload_size = payloads.shape
    tables, start = compiled.crc_tables(payload_size)
    wire = np.empty((count, payload_size + CRC_SIZE + 2), np.uint8)
    compiled.encode(np.ascontiguousarray(payloads).ravel(), payload_size, tables, start, wire)
    return wire.tobytes()


class FrameStream:
    """Decodes a byte stream, however it is cut; frequent frames have a payload of so many bytes."""

    def __init__(self, payload_size: int) -> None:
        self._payload_size = payload_size
        self._tail = b""
        self._overlong_bytes = 0

    def feed(self, data: bytes) -> DecodedFrames:
        """Take the next bytes and return the frames they complete; `tail` stays inside."""
        bad = bad_bytes = 0
        if self._overlong_bytes:
            end = data.find(DELIMITER)
            if end < 0:
                self._overlong_bytes += len(data)
                return DecodedFrames(np.empty((0, self._payload_size), np.uint8), [], 0, 0, b"")
            bad, bad_bytes = 1, self._overlong_bytes + end + 1
            self._overlong_bytes = 0
            data = data[end + 1 :]
        frames = decode_frames(self._tail + data, self._payload_size)
        self._tail = frames.tail
        if len(self._tail) > MAX_WIRE:
            self._overlong_bytes = len(self._tail)
            self._tail = b""
        return DecodedFrames(
            frames.payloads, frames.others, frames.bad + bad, frames.bad_bytes + bad_bytes, b""
        )
