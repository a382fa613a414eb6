"""Serial ports by pyserial: device paths, USB identities, and pyserial's own URLs.

Every port is opened `exclusive`: without it a second program opens the same port in silence and the
two steal each other's bytes.
"""

import errno
import os
import select
import stat
import sys
from collections.abc import Sequence
from pathlib import Path

import serial
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from drivers import errors
from drivers.transport.transport import HostLink

BAUD_RATE = 115200
"""Has no effect on a Teensy's USB port; a real UART behind an adapter uses it."""
WRITE_TIMEOUT_S = 1.0
_READ_SIZE = 65536
_SETTING_ERRORS: tuple[type[Exception], ...] = (serial.SerialException, OSError, ValueError)
try:
    import termios
except ImportError:  # Windows
    pass
else:
    _SETTING_ERRORS = (*_SETTING_ERRORS, termios.error)  # pyserial lets it through


class SerialTransport(HostLink):
    """A transport over an open pyserial port."""

    def __init__(self, url: str, port: serial.SerialBase) -> None:
        super().__init__(url)
        self._port = port

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that are there, waiting at most `timeout_s` for the first."""
        self._require_link()
        try:
            if isinstance(self._port, serial.Serial):
                return self._read_port(timeout_s)
            self._set_timeout(timeout_s)  # a socket has no count of waiting bytes
            first = bytes(self._port.read(1))
            if not first:
                return b""
            self._set_timeout(0.0)
            return first + bytes(self._port.read(_READ_SIZE))
        except (serial.SerialException, OSError, TypeError) as error:
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        self._require_link()
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise errors.LinkTimeoutError(
                f"{self.url} took no bytes for {WRITE_TIMEOUT_S:g} s.",
                "The device has stopped reading.",
                "Unplug it and plug it in again.",
            ) from error
        except (serial.SerialException, OSError) as error:
            raise self._gone(error) from error

    def set_line(self, baud_rate: int, parity: str = "N") -> None:
        """Set the speed of the line and its parity (`N`, `E` or `O`); 8 bits, 1 stop bit.

        Raises:
            LinkError: The port cannot be set so; it is closed.
        """
        try:
            self._port.baudrate = baud_rate
            self._port.parity = parity
        except _SETTING_ERRORS as error:
            self.close()
            raise errors.LinkError(
                f"{self.url} cannot be set to {baud_rate} bit/s, parity {parity}.",
                str(error),
                "Use an adapter that has this speed, or set the device to another one.",
            ) from error

    def close(self) -> None:
        """Close the port."""
        self._closes()
        self._port.close()

    def _read_port(self, timeout_s: float) -> bytes:
        """Return the waiting bytes; pyserial would configure the port again for every timeout."""
        if sys.platform == "win32":  # its ports are not file descriptors
            self._set_timeout(timeout_s)
            return bytes(self._port.read(max(1, self._port.in_waiting)))
        descriptor = self._port.fileno()
        if not select.select([descriptor], [], [], max(0.0, timeout_s))[0]:
            return b""
        data = os.read(descriptor, _READ_SIZE)
        if not data:
            raise serial.SerialException("it is ready to be read and gives nothing")
        return data

    def _set_timeout(self, timeout_s: float) -> None:
        if self._port.timeout != timeout_s:
            self._port.timeout = timeout_s

    def _gone(self, error: Exception) -> errors.LinkLostError:
        self._port.close()
        return self._lose(
            f"The link to {self.url} is gone.",
            f"The device was unplugged or reset, or another program took the port ({error}).",
            "Check the cable and start again.",
        )


def open_serial(url: str) -> SerialTransport:
    """Open a port for this program alone: a path, `usb:VID:PID[:SERIAL]`, or a pyserial URL.

    Raises:
        PortNotFoundError: No such port or USB device, or the identity fits several.
        PortBusyError: Another program holds the port; names it where it can be found.
        PortPermissionError: The user may not open it; names the group that may.
        LinkError: Anything else pyserial refuses.
    """
    name = find_usb_port(url) if url.lower().startswith("usb:") else url.removeprefix("serial:")
    try:
        port = serial.serial_for_url(
            name, baudrate=BAUD_RATE, write_timeout=WRITE_TIMEOUT_S, exclusive=True
        )
    except (serial.SerialException, ValueError) as error:
        raise _explain(url, name, error) from error
    return SerialTransport(url, port)


def find_usb_port(url: str) -> str:
    """Return the device path of the one serial port with the USB identity `usb:VID:PID[:SERIAL]`.

    Raises:
        PortNotFoundError: No port or several ports have it, or the URL cannot be read.
    """
    parts = url.split(":", 3)
    try:
        vendor, product = int(parts[1], 16), int(parts[2], 16)
    except (IndexError, ValueError) as error:
        raise errors.PortNotFoundError(
            f"{url!r} is not a USB identity.", "", "Write it as usb:16c0:0483:SERIAL."
        ) from error
    ports = list(list_ports.comports())
    matching = [port for port in ports if (port.vid, port.pid) == (vendor, product)]
    if len(parts) == 4:
        matching = [port for port in matching if port.serial_number == parts[3]]
    if len(matching) == 1:
        return str(matching[0].device)
    what = f"{'Several devices have' if matching else 'No device has'} the identity {url}."
    fix = "Give its serial number too: usb:VID:PID:SERIAL." if matching else "Plug it in."
    raise errors.PortNotFoundError(what, _present(ports), f"{fix} See: rig devices")


def port_holders(path: str) -> list[str]:
    """Return the processes that hold a device open, as `PID 123 (name)`; Linux only."""
    device = Path(path).resolve()
    holders = []
    for process in sorted(Path("/proc").glob("[0-9]*"), key=lambda found: int(found.name)):
        try:
            if any(link.resolve() == device for link in (process / "fd").iterdir()):
                holders.append(f"PID {process.name} ({(process / 'comm').read_text().strip()})")
        except OSError:
            continue  # ended meanwhile, or another user's
    return holders


def _explain(url: str, name: str, error: Exception) -> errors.LinkError:
    code = getattr(error, "errno", None)
    if code in (errno.EAGAIN, errno.EBUSY):
        holders = ", ".join(port_holders(name)) or "a program of another user"
        return errors.PortBusyError(
            f"{url} is in use.", f"It is held by {holders}.", "Close that program and try again."
        )
    if code in (errno.EACCES, errno.EPERM):
        return errors.PortPermissionError(
            f"You may not open {url}.", f"{name} belongs to group {_group(name)}.", _join(name)
        )
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return errors.PortNotFoundError(
            f"There is no port {url}.", _present(list(list_ports.comports())), "Is it plugged in?"
        )
    return errors.LinkError(f"{url} cannot be opened.", str(error))


def _present(ports: Sequence[ListPortInfo]) -> str:
    if not ports:
        return "No serial port is present."
    names = (
        f"{port.device} (usb:{port.vid:04x}:{port.pid:04x}:{port.serial_number})"
        if port.vid is not None and port.pid is not None
        else str(port.device)
        for port in ports
    )
    return f"Present: {', '.join(names)}."


def _group(path: str) -> str:
    import grp  # not on Windows

    try:
        return grp.getgrgid(os.stat(path).st_gid).gr_name  # noqa: PTH116
    except (OSError, KeyError):
        return "unknown"


def _join(path: str) -> str:
    try:
        shared = Path(path).stat().st_mode & stat.S_IRGRP
    except OSError:
        shared = 0
    group = _group(path)
    if shared and group not in ("root", "unknown"):
        return f"Run: sudo usermod -aG {group} $USER, then log in again."
    return "Give your user access by a udev rule for the device."
