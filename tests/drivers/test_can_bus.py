"""CAN buses: URLs, frames both ways, error frames, refusals, virtual time, faults."""

import errno
from collections.abc import Iterator
from unittest.mock import Mock

import can
import pytest

from drivers import errors
from drivers.errors import BusOffError, LinkError, LinkLostError, LinkTimeoutError
from drivers.transport.can_bus import CanFrame
from drivers.transport.faulty import Fault, Faults, FaultyCanBus
from drivers.transport.python_can import PythonCanBus, open_can
from drivers.transport.simulated_can import SimulatedCanBus


@pytest.fixture
def other() -> Iterator[can.BusABC]:
    """Another node on the bus can:virtual:test."""
    bus = can.Bus(interface="virtual", channel="test")
    yield bus
    bus.shutdown()


def test_frames_go_both_ways(other):
    bus = open_can("can:virtual:test")
    frame = CanFrame(0x123, b"\x01\x02\x03")
    bus.send(frame)
    seen = other.recv(1.0)
    assert CanFrame(seen.arbitration_id, bytes(seen.data), seen.is_extended_id) == frame
    other.send(can.Message(arbitration_id=0x1ABCDEF, data=b"", is_extended_id=True))
    assert bus.read(1.0) == CanFrame(0x1ABCDEF, b"", extended=True)
    assert bus.read(0.0) is None
    bus.close()
    bus.close()
    with pytest.raises(LinkLostError, match="closed"):
        bus.read(0.0)
    with pytest.raises(LinkLostError, match="closed"):
        bus.send(frame)


def test_remote_and_error_frames_are_counted_and_not_passed_on(other):
    bus = open_can("can:virtual:test")
    other.send(can.Message(arbitration_id=1, is_remote_frame=True, is_extended_id=False))
    other.send(can.Message(arbitration_id=0x04, data=b"\0\x01", is_error_frame=True))
    other.send(can.Message(arbitration_id=0x08, data=bytes(8), is_error_frame=True))
    other.send(can.Message(arbitration_id=7, data=b"x", is_extended_id=False))
    assert bus.read(1.0) == CanFrame(7, b"x")
    counters = bus.counters
    assert (counters.error_frames, counters.overruns) == (2, 1)
    bus.close()


def test_bus_off_is_an_error_from_then_on(other):
    bus = open_can("can:virtual:test")
    other.send(can.Message(arbitration_id=0x40, data=bytes(8), is_error_frame=True))
    for _ in range(2):
        with pytest.raises(BusOffError, match="terminator"):
            bus.read(1.0)
    with pytest.raises(BusOffError):
        bus.send(CanFrame(1))
    bus.close()


def test_an_interface_that_echoes_is_freed_of_it(other):
    inner = can.Bus(interface="virtual", channel="test", receive_own_messages=True)
    bus = PythonCanBus("can:udp_multicast:x", inner, echoes=True)
    bus.send(CanFrame(5, b"a"))
    other.send(can.Message(arbitration_id=5, data=b"a", is_extended_id=False))
    assert bus.read(1.0) == CanFrame(5, b"a")
    assert bus.read(0.0) is None
    bus.close()


def broken(error: Exception) -> PythonCanBus:
    """A bus over an interface that raises an error at every call."""
    inner = Mock(**{"send.side_effect": error, "recv.side_effect": error})
    return PythonCanBus("can:x:y", inner)


def test_what_an_interface_raises_becomes_ours_and_stays_the_cause():
    gone = can.CanOperationError("device vanished")
    bus = broken(gone)
    with pytest.raises(LinkLostError, match="vanished") as lost:
        bus.read(0.1)
    assert lost.value.__cause__ is gone
    with pytest.raises(LinkLostError, match="vanished"):
        bus.send(CanFrame(1))
    for error in (can.CanTimeoutError("full"), can.CanOperationError("full", errno.ENOBUFS)):
        with pytest.raises(LinkTimeoutError, match="acknowledges"):
            broken(error).send(CanFrame(1))


@pytest.mark.parametrize(
    ("url", "error", "words"),
    [
        ("can:pigeon:1", errors.UnknownSchemeError, "socketcan, slcan"),
        ("can:socketcan:", errors.UnknownSchemeError, "can0"),
        ("can:socketcan:can0?bitrate=5", LinkError, "ip link set"),
        ("can:slcan:/dev/ttyX?baud=5", LinkError, "no option baud"),
        ("can:slcan:/dev/ttyX", LinkError, "bitrate=1000000"),
        ("can:gs_usb:left?bitrate=5", LinkError, "left"),
        ("can:slcan:/dev/nothing_here?bitrate=1000000", LinkError, "nothing_here"),
    ],
)
def test_a_url_that_opens_nothing_reports_why(url, error, words):
    with pytest.raises(error, match=words):
        open_can(url)


@pytest.mark.parametrize(
    ("raised", "error", "words"),
    [
        (OSError(errno.ENODEV, "No such device"), errors.PortNotFoundError, "up type can"),
        (OSError(errno.EAFNOSUPPORT, "Address family"), LinkError, "has no CAN support"),
        (OSError(errno.EPERM, "Not permitted"), errors.PortPermissionError, "udev"),
        (can.CanInitializationError("held", errno.EBUSY), errors.PortBusyError, "in use"),
        (can.CanInterfaceNotImplementedError("no module"), errors.MissingExtraError, "extra 'can'"),
        (ValueError("odd"), LinkError, "odd"),
    ],
)
def test_a_refusal_is_explained(monkeypatch, raised, error, words):
    def refuse(**_: object) -> None:
        raise raised

    monkeypatch.setattr(can, "Bus", refuse)
    with pytest.raises(error, match=words) as caught:
        open_can("can:socketcan:can0")
    assert caught.value.__cause__ is raised


def test_a_frame_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="0x7ff"):
        CanFrame(0x800)
    with pytest.raises(ValueError, match="9"):
        CanFrame(1, bytes(9))


class Parrot:
    """Repeats what it hears 3 ms later, one identifier up."""

    def __init__(self) -> None:
        self.heard: list[tuple[int, CanFrame]] = []
        self.now = 0

    def receive(self, frame: CanFrame) -> None:
        self.heard.append((self.now + 3, CanFrame(frame.can_id + 1, frame.data)))

    def advance(self, ticks: int) -> None:
        self.now += ticks

    def transmit(self) -> list[CanFrame]:
        due = [frame for at, frame in self.heard if at <= self.now]
        self.heard = [entry for entry in self.heard if entry[0] > self.now]
        return due


def test_virtual_time_passes_by_reading_alone():
    bus = SimulatedCanBus([Parrot()])
    bus.send(CanFrame(1, b"hi"))
    assert (bus.read(0.0), bus.now_s) == (None, 0.0)
    assert bus.read(1.0) == CanFrame(2, b"hi")
    assert bus.now_s == pytest.approx(0.003)
    assert bus.read(0.05) is None
    assert bus.now_s == pytest.approx(0.053)


def test_a_late_frame_comes_though_its_time_is_but_a_rounding_away():
    bus = FaultyCanBus(SimulatedCanBus([Parrot()]), Faults())
    bus.faults.inject(Fault.DELAY, duration_s=0.05 + 5e-10)
    bus.send(CanFrame(1, b"\x07"))
    assert bus.read(0.05) is None
    assert bus.read(0.1) == CanFrame(2, b"\x07")
