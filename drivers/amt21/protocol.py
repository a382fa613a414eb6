"""The AMT21's bytes: one byte asks, two answer.

Source: Same Sky, AMT21 RS-485 sample code (position request, check bits, extended commands).
"""

import math

from drivers.errors import FrameError

DEFAULT_ADDRESS = 0x54
REPLY_SIZE = 2
TURNS = 0x01
"""Added to the address: ask a multi-turn encoder for its turns."""
BITS = 14
FULL_TURN = 1 << BITS
RAD_PER_COUNT = 2 * math.pi / FULL_TURN


def request(address: int, turns: bool = False) -> bytes:
    """Return the byte that asks for the position, or for the turns.

    Raises:
        ValueError: The address is not 0 to 252 with its two low bits zero.
    """
    if not 0 <= address <= 0xFC or address & 0x03:
        raise ValueError(f"an AMT21 address is a multiple of 4 up to 252, not {address:#x}")
    return bytes([address | (TURNS if turns else 0)])


def check_bits(value: int) -> int:
    """Return the two check bits of a 14-bit value: the odd parities of its odd and even bits."""
    bits = 0b11
    for shift in range(0, BITS, 2):
        bits ^= value >> shift & 0b11
    return bits


def encode_reply(value: int) -> bytes:
    """Return the two bytes, low byte first, that carry a 14-bit value."""
    value %= FULL_TURN
    return (check_bits(value) << BITS | value).to_bytes(REPLY_SIZE, "little")


def decode_reply(reply: bytes) -> int:
    """Return the 14-bit value in an answer; FrameError for a wrong size or check bits."""
    if len(reply) != REPLY_SIZE:
        raise FrameError(f"An AMT21 answers with {REPLY_SIZE} bytes, not {len(reply)}.")
    word = int.from_bytes(reply, "little")
    value = word % FULL_TURN
    if word >> BITS != check_bits(value):
        raise FrameError("The check bits of an AMT21's answer do not fit.", "Bytes changed.")
    return value


def signed(value: int) -> int:
    """Return a 14-bit value as the signed number of turns it stands for."""
    return value - FULL_TURN if value >= FULL_TURN // 2 else value
