"""The USB520: its lines, and finding the next whole one."""

import math

import numpy as np
import pytest

from drivers.errors import FrameError
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport
from drivers.usb520 import protocol
from drivers.usb520.driver import Usb520
from drivers.usb520.fake import Usb520Fake
from tests.drivers.taps import gathered, once, started

STRANGE = (
    *(b"\r\n", b"-0.00190\r\n", b"-0.00190 N-m", b"0.00190 N-m\r\n", b"-0.0019 N-m\r\n"),
    *(b"-0.00190 N-m x\r\n", b"-0.00190-0.00190 N-m\r\n", b"+nan N-m\r\n", b"-0.00190 lb\r\n"),
)


@pytest.mark.parametrize(
    ("line", "value", "unit"),
    [(b"-0.00190 N-m\r\n", -0.0019, "N-m"), (b"+0.00000 deg\r\n", 0.0, "deg")],
)
def test_lines_are_read_and_written_as_published(line, value, unit):
    assert protocol.decode_line(line) == (value, unit)
    assert protocol.encode_line(value or 0.0, unit) == line


@pytest.mark.parametrize("line", STRANGE)
def test_anything_else_is_refused(line):
    with pytest.raises(FrameError):
        protocol.decode_line(line)


@pytest.mark.parametrize(("unit", "factor"), [("N-m", 1.0), ("deg", math.pi / 180)])
def test_values_come_in_si(unit, factor):
    device = started(Usb520, Usb520Fake(unit))
    values, _ = gathered(device, 40, 1.0)
    assert np.abs(values).max() == pytest.approx(0.8 * factor, rel=0.01)
    assert device.channels[0].unit == protocol.QUANTITIES[unit].unit


def test_it_starts_within_a_line_and_merged_lines_cost_no_more_than_themselves():
    cable = FaultyTransport(SimulatedTransport(Usb520Fake()))
    cable.incoming = once(lambda data: data[5:])
    device = Usb520(cable)
    device.start()
    assert device.counters["crc_errors"] == 0
    gathered(device, 10, 1.0)
    cable.incoming = once(lambda data: data[:-2])
    after = device.read(1.0)
    assert (len(after), after.lost) == (1, 1)
    assert device.counters["crc_errors"] == 1
    cable.incoming = lambda data: bytes(1000)  # noise without an end of line is not kept
    device.read(0.3)
    assert device.counters["discarded_bytes"] >= 1000


def test_a_change_of_unit_is_not_mixed_in():
    fake = Usb520Fake()
    device = started(Usb520, fake)
    fake.unit = "deg"
    assert len(device.read(0.5)) == 0
    assert device.counters["unknown_frames"] > 0
