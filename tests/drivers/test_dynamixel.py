"""The Dynamixel: the e-Manual's packets, current control, and how it stops."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.device import SampleFlag
from drivers.dynamixel import protocol
from drivers.dynamixel.driver import Dynamixel, InstructionRefusedError
from drivers.dynamixel.fake import DynamixelFake
from drivers.errors import DisarmUnconfirmedError, DriverError, FrameError
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import once, started

READ_POSITION = protocol.read_question(protocol.Register(132, 4))
GOAL_POSITION = protocol.write_question(protocol.Register(116, 4), 512)
GOAL_VELOCITY = protocol.write_question(protocol.Register(104, 4), 200)
EXAMPLES = {
    "FF FF FD 00 01 03 00 01 19 4E": (1, protocol.PING, b""),
    "FF FF FD 00 FE 03 00 01 31 42": (254, protocol.PING, b""),
    "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D": (1, protocol.STATUS, b"\0\x06\x04\x26"),
    "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D": (2, protocol.STATUS, b"\0\x06\x04\x26"),
    "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15": (1, protocol.READ, READ_POSITION),
    "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0": (1, protocol.STATUS, b"\0\xa6\0\0\0"),
    "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89": (1, protocol.WRITE, GOAL_POSITION),
    "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E": (1, 0x04, GOAL_VELOCITY),
    "FF FF FD 00 01 04 00 55 00 A1 0C": (1, protocol.STATUS, b"\0"),
}
"""Source: ROBOTIS e-Manual, Protocol 2.0, the examples of ping, read, write and reg write."""


@pytest.mark.parametrize("packet", EXAMPLES)
def test_packets_are_those_of_the_manual(packet):
    data = bytes.fromhex(packet)
    assert protocol.encode(*EXAMPLES[packet]) == data
    assert protocol.decode(data) == EXAMPLES[packet]
    assert protocol.find(b"\xff\xff" + data + b"x") == (data, b"x")


def test_the_registers_are_those_of_the_manual():
    """Source: control tables of XM430-W210 and XL330-M288."""
    registers = {
        protocol.OPERATING_MODE: (11, 1),
        protocol.CURRENT_LIMIT: (38, 2),
        protocol.TORQUE_ENABLE: (64, 1),
        protocol.HARDWARE_ERROR: (70, 1),
        protocol.BUS_WATCHDOG: (98, 1),
        protocol.GOAL_CURRENT: (102, 2),
        protocol.PRESENT: (126, 21),
    }
    assert all((r.address, r.size) == told for r, told in registers.items())
    instructions = (protocol.PING, protocol.READ, protocol.WRITE, protocol.REBOOT, protocol.STATUS)
    assert instructions == (0x01, 0x02, 0x03, 0x08, 0x55)
    assert (protocol.CURRENT_MODE, protocol.WATCHDOG_UNIT_MS) == (0, 20)
    errors = (protocol.ALERT, protocol.RANGE_ERROR, protocol.ACCESS_ERROR)
    assert (*errors, protocol.WATCHDOG_TRIPPED) == (0x80, 4, 7, 0xFF)
    data = bytes.fromhex("feff 0a000000 a6000000 00000000 00000000 3200 1f")
    assert protocol.decode_present(data) == protocol.Present(-2, 10, 166, 50, 31)
    assert pytest.approx(math.radians(0.087890625)) == protocol.RAD_PER_COUNT
    assert pytest.approx(0.229 * 2 * math.pi / 60) == protocol.RAD_S_PER_COUNT
    assert protocol.write_question(protocol.GOAL_CURRENT, -2).hex() == "6600feff"


def test_errors_and_models_are_those_of_the_manual():
    words = ("failed", "does not know", "checksum", "out of range", "length", "limit", "accessed")
    assert all(word in protocol.ERRORS[number] for number, word in enumerate(words, 1))
    models = {1020: "XM430-W350", 1030: "XM430-W210", 1120: "XM540-W270"}
    assert all(protocol.model_of(k) == (name, 2.69e-3) for k, name in models.items())
    small = {1190: "XL330-M077", 1200: "XL330-M288"}
    assert all(protocol.model_of(k) == (name, 1e-3) for k, name in small.items())


@given(parameters=st.binary(max_size=40), bit=st.integers(0, 7), place=st.integers(4, 60))
def test_packets_come_back_and_one_changed_bit_is_refused(parameters, bit, place):
    packet = protocol.encode(7, protocol.WRITE, parameters)
    assert protocol.decode(packet) == (7, protocol.WRITE, parameters)
    damaged = bytearray(packet)
    damaged[4 + place % (len(packet) - 4)] ^= 1 << bit
    with pytest.raises(FrameError):
        protocol.decode(bytes(damaged))


def test_a_header_within_a_packet_is_stuffed():
    packet = protocol.encode(1, protocol.WRITE, b"\x74\0\xff\xff\xfd\0")
    assert packet[7:-2] == b"\x03\x74\0\xff\xff\xfd\xfd\0"
    assert packet[5] == 10  # the length counts what was stuffed
    assert protocol.decode(packet)[2] == b"\x74\0\xff\xff\xfd\0"


def armed(**options: int) -> tuple[DynamixelFake, Dynamixel]:
    fake = DynamixelFake()
    device = started(Dynamixel, fake, **options)
    device.arm()
    return fake, device


def test_a_current_turns_the_horn_and_the_end_is_without_force():
    fake, device = armed()
    assert device.current_limit_a == pytest.approx(1.75)
    assert device.set_current(0.0301) == pytest.approx(0.030)
    for _ in range(200):
        batch = device.read(0.1)
        assert batch.flags[0] == 0
    values = {name: value[0] for name, value in batch.columns.items()}
    assert values.pop("angle_rad") > 5.0
    assert values.pop("speed_rad_s") == pytest.approx(300 * 0.229 * math.tau / 60, rel=0.02)
    assert list(values.values()) == pytest.approx([0.030, 0.030, 5.0, 304.15])
    device.close()
    assert not fake.in_force


def test_a_host_that_reads_slowly_but_steadily_is_heard():
    fake, device = armed(rate_hz=10, watchdog_ms=200)
    device.set_current(0.03)
    for _ in range(30):
        device.read(1.0)
    assert fake.current == 30
    device.close()


def test_a_hardware_error_is_reported_in_words_and_cleared_by_a_restart():
    fake, device = armed()
    device.set_current(0.03)
    device.read(0.1)
    fake.fail(1 << 2 | 1 << 5)
    with pytest.raises(DriverError, match="too hot; it was overloaded"):  # noqa: PT012
        for _ in range(3):
            device.read(0.1)
    assert device.read(0.1).flags[0] == SampleFlag.SUSPECT
    with pytest.raises(DriverError, match="hardware error"):
        device.arm()
    device.clear_fault()
    device.arm()
    assert device.read(0.1).flags[0] == 0
    device.close()


def test_a_refusal_gives_its_reason_and_a_disarm_is_not_believed_while_the_register_differs():
    fake, device = armed()
    with pytest.raises(InstructionRefusedError, match="cannot be accessed") as caught:
        device._line.write(protocol.OPERATING_MODE, 3)
    assert caught.value.code == 7
    write = fake._write
    fake._write = lambda address, data: 0 if address == 64 else write(address, data)
    with pytest.raises(DisarmUnconfirmedError, match="holds 1"):
        device.disarm()
    fake._write = write
    device.close()
    assert not fake.in_force


def test_damage_is_asked_for_again_and_an_echo_is_dealt_with():
    cable = FaultyTransport(SimulatedTransport(DynamixelFake(echo=True)))
    device = Dynamixel(cable)
    cable.incoming = once(lambda data: data[:-1] + bytes([data[-1] ^ 1]))
    assert device.identify().model == "Dynamixel XL330-M288"
    assert (device.counters["retries"], device.counters["crc_errors"]) == (1, 1)


@pytest.mark.parametrize(("model", "words"), [(1060, "XL430-W250 neither"), (9999, "not known")])
def test_models_that_cannot_be_driven_so_are_refused(model, words):
    with pytest.raises(DriverError, match=words):
        started(Dynamixel, DynamixelFake(model))
    started(Dynamixel, DynamixelFake(model), current_unit_a=1e-3)
