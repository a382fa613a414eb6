"""The moteus: the documentation's frames and lines, torque, faults, and how it stops."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.device import SampleFlag
from drivers.errors import DisarmUnconfirmedError, DriverError, FrameError
from drivers.moteus import protocol
from drivers.moteus.driver import Moteus
from drivers.moteus.fake import MoteusFake
from drivers.moteus.protocol import State
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import once, started

EXAMPLE = "01000a07206000200150ff140400130d"
"""Source: moteus documentation, "CAN protocol", Example: a command and what is read with it."""
ANSWER = "2404000a005000000170ff230d181400"
"""Source: there, the answer to it."""


def test_the_documented_frame_is_read_subframe_by_subframe():
    assert list(protocol.subframes(bytes.fromhex(EXAMPLE))) == [
        (protocol.WRITE, 0, 0x000, 1, (10,)),
        (protocol.WRITE, 1, 0x020, 3, (0x60, 0x120, -176)),
        (protocol.READ, 1, 0x000, 4, ()),
        (protocol.READ, 0, 0x00D, 3, ()),
    ]
    written = protocol.write(0, 0x000, [10]) + protocol.write(1, 0x020, [0x60, 0x120, -176])
    asked = protocol.read(1, 0x000, 4) + protocol.read(0, 0x00D, 3)
    assert (written + asked).hex() == EXAMPLE


def test_the_documented_answer_and_lines_are_read():
    data, answer = bytes.fromhex(EXAMPLE), bytes.fromhex(ANSWER)
    assert protocol.registers(answer) == {
        **{0x000: 10, 0x001: 80, 0x002: 256, 0x003: -144},
        **{0x00D: 24, 0x00E: 20, 0x00F: 0},
    }
    made = protocol.reply(1, 0, [10, 80, 256, -144]) + protocol.reply(0, 0x00D, [24, 20, 0])
    assert made == answer
    assert protocol.send_line(1, data) == f"can send 8001 {EXAMPLE}\n".encode()
    for line in (f"rcv 100 {ANSWER}\r\n".encode(), protocol.receive_line(1, answer)):
        assert protocol.decode_line(line) == (0x100, answer)
    assert protocol.decode_line(b"OK\r\n") is None


@pytest.mark.parametrize("line", [b"rcv 100", b"rcv 100 2x", b"noise", b"rcv zz 24"])
def test_another_line_is_refused(line):
    with pytest.raises(FrameError):
        protocol.decode_line(line)


def test_modes_faults_and_sizes_are_the_documented_ones():
    """Source: "Register reference", 0x000 and 0x00f; ISO 11898-1 for the sizes of CAN FD."""
    modes = (protocol.STOPPED, protocol.FAULT, protocol.POSITION_MODE, protocol.TIMEOUT)
    assert modes == (0, 1, 10, 11)
    assert set(protocol.PREPARING) == {2, 3, 4}
    words = {32: "calibrated", 33: "driver", 34: "too high", 38: "hot", 40: "too low"}
    assert all(word in protocol.FAULTS[code] for code, word in words.items())
    assert protocol.send_line(2, b"\x01").startswith(b"can send 8002 ")
    sizes = [0, *range(1, 9), 12, 16, 20, 24, 32, 48, 64]
    for size in range(65):
        assert len(protocol.padded(bytes(size))) == min(fits for fits in sizes if fits >= size)


def test_a_torque_command_holds_the_documented_registers():
    """Source: "Register reference", 0x020 to 0x027; padding 0x50 to a size of CAN-FD."""
    command = protocol.torque_command(0.05, 0.2, 0.1)
    mode, values = protocol.subframes(command)
    assert mode == (protocol.WRITE, 0, 0x000, 1, (10,))
    assert values[:4] == (protocol.WRITE, 3, 0x020, 8)
    position, velocity, torque, kp, kd, most, stop, watchdog = values[4]
    assert math.isnan(position)
    assert math.isnan(stop)
    assert (velocity, kp, kd) == (0.0, 0.0, 0.0)
    assert (torque, most, watchdog) == pytest.approx((0.05, 0.2, 0.1))
    assert command[:6] == bytes.fromhex("01000a 0c0820")
    assert command[6:10] == struct.pack("<f", math.nan)
    # a public driver's test vector, "can send 8001 ...11001F01130D505050": the query behind it
    assert protocol.STATE_QUESTION.hex() == "11001f01130d" + "1d04"  # and one float, register 4
    sent = protocol.padded(command + protocol.STATE_QUESTION)
    assert len(sent) == 48
    assert sent.endswith(b"\x13\x0d\x1d\x04" + b"\x50" * (48 - len(command) - 8))
    assert protocol.stop_command().hex() == "010000"
    wide = protocol.read(protocol.INT32, protocol.MODEL, 2)
    wide += protocol.read(protocol.INT32, protocol.SERIAL, 3)
    assert wide.hex() == "1a8002" + "1ba002"


def test_a_state_survives_its_frame_and_its_bytes_are_little_endian():
    state = State(10, 1.5, -0.25, 0.125, 2.5, 48, -5, 0)
    data = bytes.fromhex("21000a 2f01 0000c03f 000080be 0000003e 230d 30fb00 2d04 00002040")
    assert protocol.encode_state(state) == data
    assert protocol.decode_state(data + b"\x50\x50") == state


@given(data=st.binary(max_size=64))
def test_any_frame_is_read_or_refused(data):
    try:
        state = protocol.decode_state(data)
    except FrameError:
        return
    assert math.isfinite(state.position_rev)


def armed() -> tuple[MoteusFake, Moteus]:
    fake = MoteusFake()
    device = started(Moteus, fake)
    device.arm()
    return fake, device


def test_a_torque_turns_the_output_and_the_end_is_without_force():
    fake, device = armed()
    assert device.set_torque(0.01) == 0.01
    for _ in range(100):
        batch = device.read(0.1)
        assert batch.flags[0] == 0
    angle, speed, torque, _, commanded, supply, temperature = (
        value[0] for value in batch.columns.values()
    )
    assert angle > 5.0
    assert speed == pytest.approx(50.0, rel=0.02)
    assert (torque, commanded) == pytest.approx((0.01, 0.01))
    assert (supply, temperature) == pytest.approx((24.0, 302.15))
    device.close()
    assert fake.mode == protocol.STOPPED


def test_a_fault_is_reported_in_words_and_cleared_by_arming():
    fake, device = armed()
    fake.fail(35)
    with pytest.raises(DriverError, match=r"fit no magnet \(code 35\)"):
        device.read(0.1)
    assert device.read(0.1).flags[0] == SampleFlag.SUSPECT
    device.arm()
    assert device.read(0.1).flags[0] == 0
    device.close()


def test_a_controller_that_is_stopped_by_somebody_is_reported():
    fake, device = armed()
    fake.receive(protocol.send_line(1, protocol.stop_command()))
    with pytest.raises(DriverError, match=r"left operation and is in mode 4"):
        device.read(0.1)
    fake.advance(200)  # it is not started again behind the caller's back
    assert fake.mode == protocol.TIMEOUT
    device.close()


def test_a_disarm_is_not_believed_while_the_mode_differs():
    fake, device = armed()
    change, fake._change = fake._change, lambda mode: None
    with pytest.raises(DisarmUnconfirmedError, match="mode 10"):
        device.disarm()
    fake._change = change
    device.close()
    assert fake.mode == protocol.STOPPED


def test_who_answers():
    cable = FaultyTransport(SimulatedTransport(MoteusFake()))
    cable.incoming = once(lambda data: data.replace(b"rcv", b"r\xffv"))
    device = Moteus(cable)
    identity = device.identify()
    assert (identity.model, identity.serial) == ("moteus 0x0700", "333333332222222211111111")
    assert (device.counters["retries"], device.counters["crc_errors"]) == (1, 1)
