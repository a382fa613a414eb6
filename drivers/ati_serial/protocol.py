"""The digital F/T's bytes: Modbus RTU with two functions of its own, and frames of 13 bytes.

Source: the RS-485 handle of the public ROS driver `ati_force_torque` and ATI manual 9620-05-Digital
FT; functions 3 and 16 and the CRC are `drivers.modbus`.
"""

import struct
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from drivers import modbus
from drivers.ati_net import protocol as ati_net
from drivers.errors import FrameError

SLAVE = 0x0A
STREAM, STORAGE = 0x46, 0x6A
START_STREAM = b"\x55"
UNLOCK, LOCK = b"\xaa", b"\x18"
SUCCESS = b"\x01"
"""Answer to both functions of the sensor's own."""
FAILED = 0x80
"""Added to the function of a refused request."""
JAM = bytes(16)
"""Any 14 bytes or more, sent while it streams, end the stream."""
ACTIVE_GAINS, STATUS = 0x0000, 0x001D
FIRST_CALIBRATION, CALIBRATION_STEP = 0x00E3, 192
PIECES = ((0, 104), (104, 29))
"""Offset and length of the pieces a calibration is read in: Modbus gives 125 registers at most."""
FRAME_SIZE = 13
FRAME_ORDER = (0, 3, 1, 4, 2, 5)
"""Where gauges 0 to 5 stand in a frame: it carries 0, 2, 4, 1, 3, 5."""
_CALIBRATION = struct.Struct(">8s32s4s20s144sBB24sII6H6H")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Calibration(ati_net.Calibration):
    """Conversion of gauges to forces and torques."""

    serial: str
    part_number: str
    # counts of force and torque a gauge count, shape (6, 6); rows Fx to Tz
    matrix: NDArray[np.float64]
    gains: tuple[int, ...]  # to be copied to the active gains, shape (6,)
    offsets: tuple[int, ...]  # to be copied to the active offsets, shape (6,)


encode = partial(modbus.encode, SLAVE)
decode = partial(modbus.decode, SLAVE)
read_registers = partial(modbus.read_registers, SLAVE)
write_registers = partial(modbus.write_registers, SLAVE)


def decode_calibration(registers: bytes) -> Calibration:
    """Return the calibration in the 133 registers of its block.

    Raises:
        FrameError: It is not so long, or holds no counts per unit.
    """
    if len(registers) != _CALIBRATION.size:
        raise FrameError(f"A calibration has {_CALIBRATION.size} bytes, not {len(registers)}.")
    serial, part, _, _, matrix, force, torque, _, per_force, per_torque, *rest = (
        _CALIBRATION.unpack(registers)
    )
    gains, offsets = tuple(rest[:6]), tuple(rest[6:])
    wide = np.frombuffer(matrix, ">f4").reshape(6, 6).astype(np.float64)
    if not (per_force and per_torque and np.isfinite(wide).all()):
        raise FrameError("A digital F/T's calibration is empty or damaged.")
    return Calibration(
        *(force, torque, per_force, per_torque),
        serial=_text(serial),
        part_number=_text(part),
        matrix=wide,
        gains=gains,
        offsets=offsets,
    )


def encode_calibration(calibration: Calibration) -> bytes:
    """Return the registers of a calibration's block."""
    return _CALIBRATION.pack(
        calibration.serial.encode(),
        calibration.part_number.encode(),
        b"",
        b"",
        calibration.matrix.astype(">f4").tobytes(),
        calibration.force_unit,
        calibration.torque_unit,
        bytes(24),
        calibration.counts_per_force,
        calibration.counts_per_torque,
        *calibration.gains,
        *calibration.offsets,
    )


def frame_checks(candidates: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return for each row, shape (m, 13), whether its low 7 bits of checksum are right."""
    sums = candidates[:, :12].sum(axis=1, dtype=np.uint32) & 0x7F
    return np.asarray(sums == (candidates[:, 12] & 0x7F))


def decode_frames(frames: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the gauges in frames, shape (n, 6), and whether each reports a bad status."""
    words = np.ascontiguousarray(frames[:, :12]).view(">i2").astype(np.int64)
    return words[:, FRAME_ORDER], (frames[:, 12] & 0x80) != 0


def encode_frames(gauges: NDArray[np.int64], status_bad: bool = False) -> bytes:
    """Return gauges of shape (n, 6) as the stream carries them."""
    frames = np.empty((len(gauges), FRAME_SIZE), np.uint8)
    words = np.empty((len(gauges), 6), ">i2")
    words[:, FRAME_ORDER] = gauges
    frames[:, :12] = words.view(np.uint8)
    frames[:, 12] = frames[:, :12].sum(axis=1, dtype=np.uint32) & 0x7F
    frames[:, 12] |= 0x80 if status_bad else 0
    return frames.tobytes()


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("ascii", "replace").strip()
