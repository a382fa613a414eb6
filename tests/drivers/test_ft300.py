"""The FT 300: published bytes, who answers at its address, and its stream."""

import numpy as np
import pytest

from drivers.errors import DriverError
from drivers.ft300 import protocol
from drivers.ft300.driver import Ft300
from drivers.ft300.fake import Ft300Fake
from drivers.modbus import crc16
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import gathered, once, started


def test_requests_and_messages_are_the_published_bytes():
    """The instruction manual's request; `ft_sensor_test` of `robotiq_driver_noros`."""
    assert Ft300.begin_request == bytes.fromhex("09 10 01 9A 00 01 02 02 00 CD CA")
    assert crc16(b"123456789") == 0x4B37
    message = bytes.fromhex("20 4E 7B 00 38 FE 15 03 0C 00 DE FF 38 00 E4 5D")
    rows = np.frombuffer(message, np.uint8)[np.newaxis]
    assert protocol.message_checks(rows).all()
    counts = protocol.decode_messages(rows)
    assert protocol.encode_messages(counts) == message
    assert (counts * protocol.STEPS)[0] == pytest.approx([1.23, -4.56, 7.89, 0.012, -0.034, 0.056])


def test_messages_come_back_and_a_changed_byte_is_no_message():
    counts = np.array([[1, -1, 32767, -32768, 256, -300], [0, 0, 0, 0, 0, 0]])
    messages = np.frombuffer(protocol.encode_messages(counts), np.uint8).reshape(-1, 16)
    assert protocol.decode_messages(messages).tolist() == counts.tolist()
    for place in range(16):
        changed = messages.copy()
        changed[:, place] ^= 0x10
        assert not protocol.message_checks(changed).any()


def test_it_identifies_itself_and_streams_in_si():
    fake = Ft300Fake()
    fake.streaming = True  # as another program left it
    cable = FaultyTransport(SimulatedTransport(fake))
    asked: list[bytes] = []
    cable.outgoing = lambda data: asked.append(data) or data
    device = Ft300(cable)
    identity = device.identify()
    registers = [data[2:6].hex() for data in asked if data[:2] == b"\x09\x03"]
    assert registers == ["01f40003", "01fe0004"]  # as in Robotiq's own driver
    assert (identity.serial, identity.firmware) == ("FTS-1234", "FTS-2.0.9")
    cable.incoming = once(lambda data: data[3:])  # the answer to the start is lost
    device.start()
    assert device.counters["retries"] == 1
    values, flags = gathered(device, 110, 0.2)
    expected = np.abs(fake.counts) * protocol.STEPS
    assert values.max(axis=0).tolist() == pytest.approx(expected.tolist(), rel=1e-6)
    assert not flags.any()
    device.close()
    assert not fake.streaming


def test_a_load_beyond_the_measuring_range_is_flagged():
    fake = Ft300Fake()
    fake.counts = np.array([0, 0, 0, 0, 30_500, 0])
    values, flags = gathered(started(Ft300, fake), 110, 0.2)
    assert (flags == (np.abs(values[:, 4]) > 30.0)).all()
    assert flags.any()


def test_a_gripper_at_the_same_address_is_refused():
    with pytest.raises(DriverError, match="not an FT 300"):
        started(Ft300, Ft300Fake(firmware=b"GRP\x01\x02\x03"))
