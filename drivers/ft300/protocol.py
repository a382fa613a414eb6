"""The FT 300's bytes: Modbus RTU for its registers, and messages of 16 bytes while it streams.

Source: Robotiq's own public driver for ROS (`robotiq_ft_sensor/src/rq_sensor_com.cpp`), which gives
the registers, the stream's header, scale and CRC, and the signal that ends it.
"""

import numpy as np
from numpy.typing import NDArray

from drivers.modbus import crc16

SLAVE = 9
FIRMWARE, SERIAL = (500, 3), (510, 4)
"""First register, and how many."""
SELECT_OUTPUT, STREAM = 410, 0x0200
JAM = b"\xff" * 50
"""Ends the stream."""
MESSAGE_SIZE = 16
_HEADER = np.array([0x20, 0x4E], np.uint8)
STEPS = np.array([0.01] * 3 + [0.001] * 3)
"""N, then N m, of a count; shape (6,)."""
# a byte's CRC begins with 0xFFFF; without that it is the table that takes many rows byte by byte
_TABLE = np.array([crc16(bytes([byte ^ 0xFF])) ^ 0x00FF for byte in range(256)], np.uint16)


def message_checks(candidates: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return for each row, shape (m, 16), whether it is a message: its header and its CRC."""
    crc = np.full(len(candidates), 0xFFFF, np.uint16)
    for column in range(MESSAGE_SIZE - 2):
        crc = crc >> 8 ^ _TABLE[(crc ^ candidates[:, column]) & 0xFF]
    sent = candidates[:, 14].astype(np.uint16) | candidates[:, 15].astype(np.uint16) << 8
    return np.asarray((candidates[:, :2] == _HEADER).all(axis=1) & (crc == sent))


def decode_messages(messages: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the counts in messages of shape (n, 16), three forces and three torques, (n, 6)."""
    return np.ascontiguousarray(messages[:, 2:14]).view("<i2").astype(np.int64)


def encode_messages(counts: NDArray[np.integer]) -> bytes:
    """Return counts of shape (n, 6) as the stream carries them."""
    bodies = [_HEADER.tobytes() + row.astype("<i2").tobytes() for row in np.asarray(counts)]
    return b"".join(body + crc16(body).to_bytes(2, "little") for body in bodies)


def identity(firmware: bytes, serial: bytes) -> tuple[str, str]:
    """Return firmware and serial number as on the label, empty where it has none.

    Three registers have three letters, then three numbers; four have three letters and a zero, then
    a number, low word first.
    """
    version = f"{_letters(firmware)}-{firmware[3]}.{firmware[4]}.{firmware[5]}"
    number = int.from_bytes(serial[6:8] + serial[4:6], "big")
    return version, f"{_letters(serial)}-{number:04d}" if number else ""


def _letters(raw: bytes) -> str:
    return raw[:3].decode("ascii", "replace")
