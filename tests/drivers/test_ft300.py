"""The FT 300: published bytes, who answers at its address, and its stream."""

import numpy as np
import pytest

from drivers.errors import DriverError, LinkTimeoutError
from drivers.ft300 import protocol
from drivers.ft300.driver import Ft300
from drivers.ft300.fake import Ft300Fake
from drivers.modbus import crc16, write_registers
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import once


def test_the_request_for_the_stream_is_the_published_one():
    """Bytes of the instruction manual, as public drivers of others have them."""
    request = write_registers(protocol.SLAVE, protocol.SELECT_OUTPUT, (protocol.STREAM,))
    assert request == bytes.fromhex("09 10 01 9A 00 01 02 02 00 CD CA")
    assert crc16(b"123456789") == 0x4B37


def test_a_message_of_another_projects_tests_is_read():
    """From `ft_sensor_test` of `robotiq_driver_noros`, an independent driver."""
    message = bytes.fromhex("20 4E 7B 00 38 FE 15 03 0C 00 DE FF 38 00 E4 5D")
    rows = np.frombuffer(message, np.uint8)[np.newaxis]
    assert protocol.message_checks(rows).all()
    values = protocol.decode_messages(rows) * protocol.STEPS
    assert values[0] == pytest.approx([1.23, -4.56, 7.89, 0.012, -0.034, 0.056])


def test_messages_come_back_and_a_changed_byte_is_no_message():
    counts = np.array([[1, -1, 32767, -32768, 256, -300], [0, 0, 0, 0, 0, 0]])
    messages = np.frombuffer(protocol.encode_messages(counts), np.uint8).reshape(-1, 16)
    assert messages[0, :6].tobytes() == bytes.fromhex("20 4E 01 00 FF FF")
    assert protocol.message_checks(messages).all()
    assert protocol.decode_messages(messages).tolist() == counts.tolist()
    for place in range(16):
        changed = messages.copy()
        changed[:, place] ^= 0x10
        assert not protocol.message_checks(changed).any()


def test_it_identifies_itself_and_streams_in_si():
    fake = Ft300Fake()
    cable = FaultyTransport(SimulatedTransport(fake))
    asked: list[bytes] = []
    cable.outgoing = lambda data: asked.append(data) or data
    device = Ft300(cable)
    identity = device.identify()
    registers = [data[2:6].hex() for data in asked if data[:2] == b"\x09\x03"]
    assert registers == ["01f40003", "01fe0004"]  # as in Robotiq's own driver
    assert (identity.model, identity.serial, identity.firmware) == (
        "FT 300",
        "FTS-1234",
        "FTS-2.0.9",
    )
    device.start()
    batches = [device.read(0.2) for _ in range(110)]
    most = {name: max(b.columns[name].max(initial=0) for b in batches) for name in AXES}
    expected = np.abs(fake.counts) * protocol.STEPS
    assert list(most.values()) == pytest.approx(expected.tolist(), rel=1e-6)
    assert not any(batch.flags.any() for batch in batches)
    device.close()
    assert not fake.streaming


AXES = ("force_x_n", "force_y_n", "force_z_n", "torque_x_n_m", "torque_y_n_m", "torque_z_n_m")


def test_a_load_beyond_the_measuring_range_is_flagged():
    fake = Ft300Fake()
    fake.counts = np.array([0, 0, 0, 0, 30_500, 0])
    device = Ft300(SimulatedTransport(fake))
    device.start()
    batches = [device.read(0.2) for _ in range(110)]
    torque = np.concatenate([batch.columns["torque_y_n_m"] for batch in batches])
    flags = np.concatenate([batch.flags for batch in batches])
    assert (flags == (np.abs(torque) > 30.0)).all()
    assert flags.any()


def test_a_stream_that_another_program_left_on_is_ended_first():
    fake = Ft300Fake()
    fake.streaming = True
    assert Ft300(SimulatedTransport(fake)).identify().serial == "FTS-1234"


def test_a_gripper_at_the_same_address_is_refused():
    fake = Ft300Fake(firmware=b"GRP\x01\x02\x03")
    with pytest.raises(DriverError, match="not an FT 300"):
        Ft300(SimulatedTransport(fake)).identify()


def test_a_lost_answer_to_the_start_is_asked_for_again_and_silence_is_a_timeout():
    cable = FaultyTransport(SimulatedTransport(Ft300Fake()))
    device = Ft300(cable)
    device.identify()
    cable.incoming = once(lambda data: data[3:])
    device.start()
    assert device.counters["retries"] == 1
    assert len(device.read(0.2))
    cable.incoming = lambda data: b""
    with pytest.raises(LinkTimeoutError, match="24 V"):
        Ft300(cable).identify()
