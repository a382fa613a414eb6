"""The digital F/T: messages as published, its calibration put in force, its stream."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.constants import ExcCodes
from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersResponse,
    WriteMultipleRegistersResponse,
)

from drivers import modbus
from drivers.ati_serial import protocol
from drivers.ati_serial.driver import AtiSerial
from drivers.ati_serial.fake import AtiSerialFake, example_calibration
from drivers.errors import DriverError, FrameError
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import gathered, once, started

PUBLISHED = {
    "0A 6A AA FF 1D": protocol.encode(protocol.STORAGE, protocol.UNLOCK),
    "0A 6A 18 7F 68": protocol.encode(protocol.STORAGE, protocol.LOCK),
    "0A 46 55 A3 9D": protocol.encode(protocol.STREAM, protocol.START_STREAM),
    "0A 46 01 A2 62": protocol.encode(protocol.STREAM, b"\x01"),
    "0A 03 00 1D 00 01 15 77": protocol.read_registers(protocol.STATUS, 1),
}


@pytest.mark.parametrize("published", PUBLISHED)
def test_messages_are_the_published_bytes(published):
    assert PUBLISHED[published] == bytes.fromhex(published)
    assert protocol.encode(*protocol.decode(PUBLISHED[published])) == PUBLISHED[published]


def test_another_library_reads_the_questions_and_writes_the_answers():
    framer = FramerRTU(DecodePDU(True))
    _, read = framer.handleFrame(protocol.read_registers(0x00E3, 104), protocol.SLAVE, 0)
    assert (read.function_code, read.address, read.count) == (modbus.READ, 0x00E3, 104)
    _, write = framer.handleFrame(protocol.write_registers(7, (1, 0xFFFE)), protocol.SLAVE, 0)
    written = (modbus.WRITE, 7, [1, 0xFFFE])
    assert (write.function_code, write.address, write.registers) == written
    refused = ExceptionResponse(modbus.READ, ExcCodes.ILLEGAL_ADDRESS)
    for answer, content in (
        (ReadHoldingRegistersResponse(registers=[1, 0xFFFE]), (modbus.READ, b"\4\0\1\xff\xfe")),
        (WriteMultipleRegistersResponse(address=7, count=2), (modbus.WRITE, b"\0\7\0\2")),
        (refused, (modbus.READ | protocol.FAILED, b"\2")),
    ):
        answer.dev_id = protocol.SLAVE
        assert protocol.decode(framer.buildFrame(answer)) == content


@given(data=st.binary(min_size=1, max_size=40), bit=st.integers(0, 7), place=st.integers(0, 60))
def test_one_changed_bit_is_refused(data, bit, place):
    message = bytearray(protocol.encode(modbus.READ, data))
    message[place % len(message)] ^= 1 << bit
    with pytest.raises(FrameError):
        protocol.decode(bytes(message))


@given(
    gauges=st.lists(st.lists(st.integers(-32768, 32767), min_size=6, max_size=6), min_size=1),
    bad=st.booleans(),
)
def test_frames_come_back(gauges, bad):
    wire = protocol.encode_frames(np.array(gauges), bad)
    frames = np.frombuffer(wire, np.uint8).reshape(-1, protocol.FRAME_SIZE)
    assert protocol.frame_checks(frames).all()
    got, status = protocol.decode_frames(frames)
    assert got.tolist() == gauges
    assert status.tolist() == [bad] * len(gauges)


def test_a_frame_carries_the_gauges_in_the_published_order():
    wire = protocol.encode_frames(np.array([[0x0100, 0x0201, 0x0302, 0x0403, 0x0504, 0x0605]]))
    assert wire[:12].hex(" ", 2) == "0100 0302 0504 0201 0403 0605"
    assert wire[12:] == bytes([sum(wire[:12]) & 0x7F])


def test_a_calibration_laid_out_by_hand_is_read():
    """Source: the public driver `ati_force_torque`; offsets in registers, high byte first."""
    matrix = np.arange(36, dtype=np.float32).reshape(6, 6) * 10 - 100
    gains, offsets = (540, 541, 542, 543, 544, 545), (34920, 34921, 34922, 34923, 34924, 34925)
    pieces = {
        **{0: b"FT12345", 4: b"SI-130-10", 32: struct.pack(">36f", *matrix.ravel())},
        **{104: bytes([2, 3]), 117: struct.pack(">II", 1_000_000, 500_000)},
        **{121: struct.pack(">6H", *gains), 127: struct.pack(">6H", *offsets)},
    }
    block = bytearray(2 * 133)
    for offset, data in pieces.items():
        block[2 * offset : 2 * offset + len(data)] = data
    found = protocol.decode_calibration(bytes(block))
    assert (found.serial, found.part_number) == ("FT12345", "SI-130-10")
    assert (found.gains, found.offsets) == (gains, offsets)
    assert np.array_equal(found.matrix, matrix)
    assert found.slopes().tolist() == [1e-6] * 3 + [2e-6] * 3
    assert protocol.encode_calibration(found) == block


def test_it_reads_its_calibration_and_puts_it_in_force():
    fake = AtiSerialFake()
    fake.receive(protocol.encode(protocol.STREAM, protocol.START_STREAM))  # another program's
    fake.advance(20)
    device = AtiSerial(SimulatedTransport(fake))
    identity = device.identify()
    assert (identity.serial, identity.model) == ("FT99999", "ATI digital F/T SI-145-5")
    assert device.status() == 0
    device.start()
    calibration = example_calibration()
    tops = np.abs(calibration.matrix).sum(axis=1) * 32768 / 1e6
    assert [channel.upper for channel in device.channels] == pytest.approx(tops.tolist())
    assert fake.registers(0, 12) == calibration.gains + calibration.offsets
    values, _ = gathered(device, 1)
    assert len(values) == 7 * 50 - 1  # the newest waits for its successor
    began = np.arange(fake._sent - 350, fake._sent)
    assert np.allclose(values, fake.gauges(began)[:-1] @ calibration.matrix.T / 1e6)
    device.close()
    assert not fake.streaming


def test_each_calibration_is_read_192_registers_behind_the_one_before():
    """Source: the register addresses of the public KIT driver."""
    cable = FaultyTransport(SimulatedTransport(AtiSerialFake()))
    asked: list[bytes] = []
    cable.outgoing = lambda data: asked.append(data) or data
    with pytest.raises(FrameError, match="empty"):  # the fake has one only
        AtiSerial(cable, calibration=3).identify()
    registers = [data[2:6].hex() for data in asked if data[:2] == b"\x0a\x03"]
    assert registers[0] == "02630068"
    with pytest.raises(DriverError, match="1 to 16"):
        AtiSerial(cable, calibration=17)


def test_a_bad_status_and_a_full_gauge_flag_their_samples():
    fake = AtiSerialFake()
    device = started(AtiSerial, fake)
    fake.status_bad = True
    device.read(0.1)
    assert set(gathered(device, 1)[1]) == {8}
    assert device.counters["device_errors"] > 350
    fake.status_bad = False
    fake.gauges = lambda numbers: np.full((len(numbers), 6), 32767)
    device.read(0.1)
    assert set(gathered(device, 1)[1]) == {1}


def test_damaged_and_lost_answers_are_asked_for_again():
    cable = FaultyTransport(SimulatedTransport(AtiSerialFake()))
    cable.incoming = once(lambda data: data[:9] + b"\x55" + data[10:])
    device = AtiSerial(cable)
    device.identify()
    assert device.counters["retries"] == 1

    def lose(data: bytes) -> bytes:
        if data[:2] != bytes([protocol.SLAVE, protocol.STREAM]):
            return data
        cable.incoming = lambda later: later
        return b""

    cable.incoming = lose
    device.start()
    assert device.counters["retries"] == 2
    assert len(device.read(0.1)) > 100


def test_what_may_differ_can_be_set():
    fake = AtiSerialFake()
    started(AtiSerial, fake)
    fake.receive(bytes(14))
    fake.receive(protocol.write_registers(0, (1, 2)))  # its storage is locked again
    assert protocol.decode(fake.transmit()) == (modbus.WRITE | protocol.FAILED, b"\x02")
    other = {"matrix_by_rows": False, "force_unit": 4, "torque_unit": 4, "lock_answers": False}
    device = started(AtiSerial, fake, **other)
    began = np.arange(fake._sent, fake._sent + 20)
    expected = fake.gauges(began) @ example_calibration().matrix / 1e6 * np.repeat([1e3, 1e-3], 3)
    assert np.allclose(gathered(device, 1)[0][:20], expected)


def answering(function: int, answer: bytes) -> AtiSerialFake:
    """A sensor that answers so to one of its own functions."""

    class Strange(AtiSerialFake):
        def transmit(self) -> bytes:
            data = super().transmit()
            return answer if data[1:2] == bytes([function]) else data

    return Strange()


def test_a_sensor_that_does_not_answer_the_lock_still_starts():
    device = started(AtiSerial, answering(protocol.STORAGE, b""), lock_answers=False)
    assert len(device.read(0.1)) > 100


@pytest.mark.parametrize("function", [protocol.STREAM, protocol.STORAGE])
def test_an_answer_that_is_no_success_is_a_refusal(function):
    with pytest.raises(DriverError, match=f"refused function {function:#04x}"):
        started(AtiSerial, answering(function, protocol.encode(function, b"\0")))
