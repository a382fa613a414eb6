"""The Net F/T's bytes: commands and records over UDP, the calibration over TCP. All big-endian.

Source: ATI manual 9620-05-Net FT (raw data transfer, status code, TCP interface) and 9610-05-1022
Ethernet Axia.
"""

import struct
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.errors import FrameError

CALIBRATION_PORT = 49151
HEADER = 0x1234
STOP, STREAM, RESET_LATCH, SET_BIAS = 0x0000, 0x0002, 0x0041, 0x0042
"""Commands; setting the bias is not answered."""
RECORD_DTYPE = np.dtype(
    [("rdt_sequence", ">u4"), ("ft_sequence", ">u4"), ("status", ">u4"), ("counts", ">i4", (6,))]
)
"""One record: 36 bytes, one or more a datagram."""
READ_CALIBRATION = bytes([0x01]) + bytes(19)
_COMMAND = struct.Struct(">HHI")
_CALIBRATION = struct.Struct(">HBBII12x")
"""It ends with divisors of the 16-bit readings of other interfaces."""
CALIBRATION_SIZE = _CALIBRATION.size

SUMMARY, LATCHED, SATURATED = 1 << 31, 1 << 16, 1 << 17
STATUS_BITS = {
    30: "processor or memory failed",
    29: "digital board failed",
    28: "analog board failed",
    27: "serial link failed",
    26: "program memory failed",
    25: "halted by its configuration",
    24: "settings do not pass their check",
    23: "configuration does not fit the calibration",
    22: "network failed",
    21: "CAN failed",
    20: "raw data transfer failed",
    19: "EtherNet/IP failed",
    18: "DeviceNet failed",
    17: "sensor saturated or its converter failed",
    16: "a threshold has been crossed",
    14: "watchdog tripped",
    13: "stack overflowed",
    12: "settings memory failed",
    11: "flash memory failed",
    10: "analog watchdog tripped",
    9: "excitation too high",
    8: "excitation too low",
    7: "artificial ground out of range",
    6: "supply too high",
    5: "supply too low",
    4: "no data from the sensor",
    3: "reference voltage out of range",
    2: "internal temperature out of range",
    1: "web server failed",
}
"""Meaning of each bit of the status; bit 31 is set when any other is set."""
N_PER_UNIT = {1: 4.4482216152605, 2: 1.0, 3: 4448.2216152605, 4: 1e3, 5: 9.80665, 6: 9.80665e-3}
"""By the code of the force unit: lbf, N, klbf, kN, kgf, gf."""
N_M_PER_UNIT = {1: 0.1129848290276167, 2: 1.3558179483314004, 3: 1.0, 4: 1e-3, 5: 0.0980665, 6: 1e3}
"""By the code of the torque unit: lbf in, lbf ft, N m, N mm, kgf cm, kN m."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Units of force and torque by their codes, and how many counts each has."""

    force_unit: int
    torque_unit: int
    counts_per_force: int
    counts_per_torque: int

    def slopes(self) -> NDArray[np.float64]:
        """Return N a count three times, then N m a count three times, shape (6,)."""
        force = N_PER_UNIT[self.force_unit] / self.counts_per_force
        torque = N_M_PER_UNIT[self.torque_unit] / self.counts_per_torque
        return np.repeat([force, torque], 3)


def encode_command(command: int, samples: int = 0) -> bytes:
    """Return a command; `samples` 0 streams without end."""
    return _COMMAND.pack(HEADER, command, samples)


def decode_command(datagram: bytes) -> tuple[int, int]:
    """Return command and sample count of a request; `FrameError` where it is none."""
    if len(datagram) != _COMMAND.size or datagram[:2] != HEADER.to_bytes(2, "big"):
        raise FrameError("A datagram is not an RDT request.")
    _, command, samples = _COMMAND.unpack(datagram)
    return command, samples


def decode_records(datagram: bytes) -> NDArray[np.void]:
    """Return the records of a datagram, shape (n,), `RECORD_DTYPE`; FrameError of partial ones."""
    if not datagram or len(datagram) % RECORD_DTYPE.itemsize:
        raise FrameError(f"A datagram of {len(datagram)} bytes is not made of RDT records.")
    return np.frombuffer(datagram, RECORD_DTYPE)


def encode_calibration(calibration: Calibration) -> bytes:
    """Return the answer to `READ_CALIBRATION`."""
    return _CALIBRATION.pack(HEADER, *astuple(calibration))


def decode_calibration(answer: bytes) -> Calibration:
    """Return the content of the answer to `READ_CALIBRATION`.

    Raises:
        FrameError: It is not such an answer, has an unknown unit, or zero counts per unit.
    """
    if len(answer) != CALIBRATION_SIZE:
        raise FrameError(f"A calibration has {CALIBRATION_SIZE} bytes, not {len(answer)}.")
    header, force_unit, torque_unit, per_force, per_torque = _CALIBRATION.unpack(answer)
    if header != HEADER or force_unit not in N_PER_UNIT or torque_unit not in N_M_PER_UNIT:
        raise FrameError(f"{answer[:4].hex(' ')} does not begin a Net F/T's calibration.")
    if not (per_force and per_torque):
        raise FrameError("A Net F/T's calibration has no counts per unit.")
    return Calibration(force_unit, torque_unit, per_force, per_torque)


def status_words(status: int) -> list[str]:
    """Return the meaning of a status, one phrase per bit; empty for a healthy device."""
    return [
        STATUS_BITS.get(bit, f"bit {bit} is set") for bit in range(30, -1, -1) if status >> bit & 1
    ]


def is_data_fault(status: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Whether each status makes its sample doubtful; a latched threshold alone does not."""
    return np.asarray((status & ~np.uint32(SUMMARY | LATCHED)) != 0)
