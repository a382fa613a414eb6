"""Byte transports opened by URL."""

import re
from collections.abc import Callable

from drivers.errors import UnknownSchemeError
from drivers.transport.serial_port import SerialTransport, open_serial
from drivers.transport.transport import Transport
from drivers.transport.udp import open_udp

__all__ = ["Transport", "open_line", "open_transport"]

_SCHEME = re.compile(r"([a-z][a-z0-9+.-]*):", re.IGNORECASE)
_SERIAL = ("loop", "rfc2217", "serial", "socket", "spy", "usb")
_OPENERS: dict[str, Callable[[str], Transport]] = {
    **dict.fromkeys(_SERIAL, open_serial),
    "udp": open_udp,
}


def open_transport(url: str) -> Transport:
    """Open the transport a URL names.

    `/dev/...`, `COM3`, `usb:VID:PID:SERIAL` and pyserial's own URLs (`socket://host:port`) are
    serial ports; `udp:HOST:PORT` is UDP.

    Raises:
        UnknownSchemeError: No opener for the URL's scheme.
        LinkError: The link cannot be opened.
    """
    found = _SCHEME.match(url)
    scheme = found[1].lower() if found else "serial"
    if scheme not in _OPENERS:
        raise UnknownSchemeError(
            f"No transport opens {url!r}.",
            f"The scheme {scheme!r} is not one of {', '.join(sorted(_OPENERS))}.",
            "Give a port such as /dev/ttyACM0 or usb:16c0:0483:SERIAL.",
        )
    return _OPENERS[scheme](url)


def open_line(url: str, baud_rate: int, parity: str = "N") -> Transport:
    """Open any transport; where it is a serial port, set its speed, bit/s, and its parity.

    Raises:
        LinkError: The link cannot be opened, or the port cannot be set so.
    """
    transport = open_transport(url)
    if isinstance(transport, SerialTransport):
        transport.set_line(baud_rate, parity)
    return transport
