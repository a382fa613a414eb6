"""Transports: URLs, serial ports over a pty, and a board in virtual time."""

import errno
import os
import socket
import termios
import tty
from collections.abc import Iterator
from types import SimpleNamespace
from unittest.mock import Mock, PropertyMock

import pytest
import serial
from serial.tools import list_ports

from drivers.errors import (
    LinkError,
    LinkLostError,
    PortBusyError,
    PortNotFoundError,
    PortPermissionError,
    UnknownSchemeError,
)
from drivers.transport import Transport, open_line, open_transport
from drivers.transport.serial_port import SerialTransport
from drivers.transport.simulated import SimulatedTransport


class Pty:
    """A cable: `device` is our end, `path` the port a transport opens."""

    def __init__(self) -> None:
        self.device, self._port = os.openpty()
        tty.setraw(self.device)
        tty.setraw(self._port)
        self.path = os.ttyname(self._port)

    def unplug(self) -> None:
        for end in (self.device, self._port):
            if end >= 0:
                os.close(end)
        self.device = self._port = -1


@pytest.fixture
def pty() -> Iterator[Pty]:
    cable = Pty()
    yield cable
    cable.unplug()


def received(transport: Transport, size: int) -> bytes:
    got = b""
    while len(got) < size:
        got += transport.read(1.0)
    return got


def test_bytes_go_both_ways(pty):
    transport = open_transport(pty.path)
    os.write(pty.device, b"\x00\x11from the device\x13\xff")
    assert received(transport, 19) == b"\x00\x11from the device\x13\xff"
    transport.write(b"\x00to the device\r\n")
    assert os.read(pty.device, 100) == b"\x00to the device\r\n"
    assert transport.read(0.0) == b""
    assert transport.url == pty.path
    transport.close()
    transport.close()
    with pytest.raises(LinkLostError, match="closed"):
        transport.read(0.0)


def test_a_line_has_its_own_speed_and_parity(pty):
    transport = open_line(pty.path, 1_250_000)
    os.write(pty.device, b"at this speed")
    assert received(transport, 13) == b"at this speed"
    transport.close()
    with pytest.raises(LinkError, match="parity Z"):
        open_line(pty.path, 9600, "Z")
    open_transport(pty.path).close()


def test_a_speed_the_adapter_does_not_have_is_reported():
    port = Mock()
    refused = PropertyMock(side_effect=termios.error(errno.EINVAL, "Invalid argument"))
    type(port).baudrate = refused
    transport = SerialTransport("/dev/refusing", port)
    with pytest.raises(LinkError, match="cannot be set to 1250000 bit/s"):
        transport.set_line(1_250_000, "E")
    port.close.assert_called()


def test_a_port_is_opened_by_one_program_only(pty):
    first = open_transport(pty.path)
    with pytest.raises(PortBusyError, match=rf"PID {os.getpid()} \("):
        open_transport(pty.path)
    first.close()
    open_transport(pty.path).close()


def test_an_unplugged_cable_is_a_lost_link_from_then_on(pty):
    transport = open_transport(pty.path)
    pty.unplug()
    for _ in range(2):
        with pytest.raises(LinkLostError, match="gone"):
            transport.read(0.1)
    with pytest.raises(LinkLostError):
        transport.write(b"x")
    transport.close()


def test_an_unreachable_address_is_a_lost_link_from_then_on():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        transport = open_transport(f"udp:127.0.0.1:{taken.getsockname()[1]}")
    transport.write(b"x")  # nobody is there any more
    for _ in range(2):
        with pytest.raises(LinkLostError, match="gone"):
            transport.read(1.0)
    with pytest.raises(LinkLostError):
        transport.write(b"x")
    transport.close()


def test_a_missing_port_names_those_that_are_there(monkeypatch):
    present(monkeypatch, ("/dev/ttyACM3", 0x16C0, 0x0483, "1234567"))
    with pytest.raises(PortNotFoundError, match=r"ttyACM3.*usb:16c0:0483:1234567"):
        open_transport("/dev/tty_that_is_not_there")


def test_a_refused_port_names_the_group(monkeypatch, tmp_path):
    port = tmp_path / "port"
    port.touch(mode=0o660)

    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    monkeypatch.setattr(
        "drivers.transport.serial_port._group", lambda path: "dialout" if path else ""
    )
    with pytest.raises(PortPermissionError, match="usermod -aG dialout"):
        open_transport(str(port))


def present(monkeypatch: pytest.MonkeyPatch, *ports: tuple[str, int, int, str]) -> None:
    """Pretend that these serial ports are plugged in."""
    names = ("device", "vid", "pid", "serial_number")
    found = [SimpleNamespace(**dict(zip(names, port, strict=True))) for port in ports]
    monkeypatch.setattr(list_ports, "comports", lambda: found)


def test_a_usb_device_is_found_by_its_serial_number(monkeypatch, pty):
    present(monkeypatch, ("/dev/none", 0x16C0, 0x0483, "1"), (pty.path, 0x16C0, 0x0483, "2"))
    transport = open_transport("usb:16c0:0483:2")
    os.write(pty.device, b"it is me")
    assert transport.read(1.0)
    transport.close()
    wrong = {"16C0:0483": "Several", "16c0:0483:3": "No device", "teensy": "usb:16c0:0483:SERIAL"}
    for identity, words in wrong.items():
        with pytest.raises(PortNotFoundError, match=words):
            open_transport(f"usb:{identity}")


def test_a_socket_url_is_a_client():
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(f"socket://127.0.0.1:{server.getsockname()[1]}")
        device, _ = server.accept()
        with device:
            device.sendall(b"x" * 5000)
            assert received(transport, 5000) == b"x" * 5000
            transport.write(b"answer")
            assert device.recv(100) == b"answer"
        with pytest.raises(LinkLostError):
            transport.read(1.0)
        transport.close()


def test_an_unknown_scheme_is_named():
    with pytest.raises(UnknownSchemeError, match=r"'smoke'.*serial"):
        open_transport("smoke://signals")


class CountingBoard:
    """Sends one byte every 40 ticks and returns the bytes it receives."""

    def __init__(self) -> None:
        self.ticks = 0
        self.out = b""

    def receive(self, data: bytes) -> None:
        self.out += data

    def advance(self, ticks: int) -> None:
        self.out += b"." * ((self.ticks + ticks) // 40 - self.ticks // 40)
        self.ticks += ticks

    def transmit(self) -> bytes:
        data, self.out = self.out, b""
        return data


def test_virtual_time_passes_by_reading_alone():
    transport = SimulatedTransport(CountingBoard(), step_s=0.01)
    transport.write(b"echo")
    reads = ((1.0, b"echo", 0.0), (1.0, b".", 0.04), (0.025, b"", 0.065), (1e-12, b"", 0.066))
    for timeout_s, expected, now_s in reads:
        assert transport.read(timeout_s) == expected
        assert transport.now_s == pytest.approx(now_s)
    assert transport.read(0.0) == b""
    transport.close()
    with pytest.raises(LinkLostError):
        transport.read(1.0)


def test_a_pace_waits_only_for_time_not_yet_passed(monkeypatch):
    real_s = [100.0]
    waits: list[float] = []

    def wait(seconds: float) -> None:
        waits.append(seconds)
        real_s[0] += seconds

    monkeypatch.setattr("drivers.transport.simulated.sleep", wait)
    monkeypatch.setattr("drivers.transport.simulated.monotonic", lambda: real_s[0])
    transport = SimulatedTransport(CountingBoard(), step_s=0.01, pace=2.0)
    transport.read(0.08)
    assert transport.now_s == pytest.approx(0.04)
    assert sum(waits) == pytest.approx(0.02, abs=0.006)
    real_s[0] += 1.0
    waits.clear()
    transport.read(0.08)
    assert waits == []
