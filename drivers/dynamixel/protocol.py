"""The Dynamixel's bytes: packets of Protocol 2.0, and the registers of the X series used here.

Source: ROBOTIS e-Manual, "Protocol 2.0" (packets with their examples, byte stuffing, errors), "CRC
calculation", and the control tables of XM430-W210 and XL330-M288. All little-endian.
"""

import math
import struct
from dataclasses import dataclass

from drivers.errors import DriverError, FrameError

HEADER = b"\xff\xff\xfd\x00"
STUFFED = b"\xff\xff\xfd"
"""Within a packet it is followed by one more 0xFD, so that no header is seen there."""
PING, READ, WRITE, REBOOT, STATUS = 0x01, 0x02, 0x03, 0x08, 0x55
HIGHEST_ID = 252
ALERT = 0x80
"""Bit of a status packet's error: the device has a hardware error."""
RANGE_ERROR, ACCESS_ERROR = 4, 7
ERRORS = {
    1: "it failed to carry out the instruction",
    2: "it does not know the instruction",
    3: "the checksum did not fit",
    4: "the value is out of range",
    5: "the value has the wrong length",
    6: "the value is beyond a limit",
    7: "the register cannot be accessed now",
}
"""What the number in a status packet's error says."""


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of the control table, `size` bytes from `address` on."""

    address: int
    size: int


OPERATING_MODE = Register(11, 1)
CURRENT_LIMIT = Register(38, 2)
TORQUE_ENABLE = Register(64, 1)
HARDWARE_ERROR = Register(70, 1)
BUS_WATCHDOG = Register(98, 1)
GOAL_CURRENT = Register(102, 2)
PRESENT = Register(126, 21)
"""Current, velocity, position, two trajectories, voltage and temperature, in one reading."""
CURRENT_MODE = 0
WATCHDOG_UNIT_MS = 20
WATCHDOG_TRIPPED = 0xFF
HARDWARE_ERRORS = {
    0: "the input voltage is out of range",
    2: "it is too hot",
    3: "the motor's encoder fails",
    4: "an electrical shock, or too weak a supply",
    5: "it was overloaded for too long",
}
"""What each bit of the hardware error says."""

COUNTS_A_TURN = 4096
RAD_PER_COUNT = 2 * math.pi / COUNTS_A_TURN
RAD_S_PER_COUNT = 0.229 * 2 * math.pi / 60
_PRESENT = struct.Struct("<hiiiiHB")
_READ_QUESTION = struct.Struct("<HH")
_PING_ANSWER = struct.Struct("<HB")


@dataclass(frozen=True, slots=True)
class Present:
    """What the device measures."""

    current: int  # motor current, the model's units
    velocity: int  # speed of the horn, counts of 0.229 turns a minute
    position: int  # angle of the horn over all turns, 4096 counts a turn
    voltage: int  # supply, 0.1 V
    temperature: int  # degrees Celsius


def crc16(data: bytes) -> int:
    """Return the CRC-16 of a packet: polynomial 0x8005, high bit first, start 0."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x8005 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


def encode(device_id: int, instruction: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, or a status packet whose parameters begin with its error."""
    body = (bytes([instruction]) + parameters).replace(STUFFED, STUFFED + b"\xfd")
    packet = HEADER + bytes([device_id]) + (len(body) + 2).to_bytes(2, "little") + body
    return packet + crc16(packet).to_bytes(2, "little")


def find(data: bytes) -> tuple[bytes, bytes] | None:
    """Return the first whole packet in `data` and what follows it, None while there is none."""
    start = data.find(HEADER)
    if start < 0 or len(data) < start + 7:
        return None
    end = start + 7 + int.from_bytes(data[start + 5 : start + 7], "little")
    return None if len(data) < end else (data[start:end], data[end:])


def decode(packet: bytes) -> tuple[int, int, bytes]:
    """Return identifier, instruction and parameters of a whole packet.

    Raises:
        FrameError: It has no instruction, or its checksum does not fit.
    """
    if len(packet) < 10:
        raise FrameError(f"A packet of {len(packet)} bytes has no instruction.")
    if crc16(packet[:-2]) != int.from_bytes(packet[-2:], "little"):
        raise FrameError("The checksum of a Dynamixel's packet does not fit.", "Bytes changed.")
    body = packet[7:-2].replace(STUFFED + b"\xfd", STUFFED)
    return packet[4], body[0], body[1:]


def read_question(register: Register) -> bytes:
    """Return the parameters of an instruction that reads a register."""
    return _READ_QUESTION.pack(register.address, register.size)


def write_question(register: Register, value: int) -> bytes:
    """Return the parameters of an instruction that writes a register.

    Negative values are written in two's complement.
    """
    data = (value % (1 << 8 * register.size)).to_bytes(register.size, "little")
    return register.address.to_bytes(2, "little") + data


def decode_ping(parameters: bytes) -> tuple[int, int]:
    """Return model number and firmware version of the answer to a ping; FrameError of others."""
    if len(parameters) != _PING_ANSWER.size:
        raise FrameError(f"The answer to a ping has 3 bytes, not {len(parameters)}.")
    model, firmware = _PING_ANSWER.unpack(parameters)
    return model, firmware


def decode_present(data: bytes) -> Present:
    """Return the values of the registers from 126 on; `FrameError` unless they are 21 bytes."""
    if len(data) != _PRESENT.size:
        raise FrameError(f"The present values have {_PRESENT.size} bytes, not {len(data)}.")
    current, velocity, position, _, _, voltage, temperature = _PRESENT.unpack(data)
    return Present(current, velocity, position, voltage, temperature)


def encode_present(present: Present) -> bytes:
    """Return the registers from 126 on."""
    p = present
    return _PRESENT.pack(p.current, p.velocity, p.position, 0, 0, p.voltage, p.temperature)


MODELS = {
    1020: ("XM430-W350", 2.69e-3),
    1030: ("XM430-W210", 2.69e-3),
    1120: ("XM540-W270", 2.69e-3),
    1190: ("XL330-M077", 1.0e-3),
    1200: ("XL330-M288", 1.0e-3),
    1060: ("XL430-W250", 0.0),
    1070: ("XC430-W150", 0.0),
}
"""Name and amperes a unit of current, by model number; 0 for a model that measures no current."""


def model_of(number: int) -> tuple[str, float]:
    """Return a model's name and its amperes a unit of current; `DriverError` where it has none."""
    name, unit_a = MODELS.get(number, ("", 0.0))
    if not name:
        raise DriverError(
            f"The Dynamixel's model number {number} is not known.",
            f"Known are: {', '.join(known for known, _ in MODELS.values())}.",
            "Give the unit of its current, from its e-Manual: option current_unit_a.",
        )
    if not unit_a:
        raise DriverError(
            f"A Dynamixel {name} neither measures nor controls its current.",
            "It has a load estimate in its place.",
            "Use a model of the XL330, XM or XH series.",
        )
    return name, unit_a
