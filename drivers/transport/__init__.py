"""Byte transports opened by URL."""

from drivers.transport.serial_port import open_serial
from drivers.transport.transport import Transport, known_schemes, open_transport, register_scheme
from drivers.transport.udp import open_udp

__all__ = ["Transport", "known_schemes", "open_transport", "register_scheme"]

for _scheme in ("serial", "usb", "socket", "rfc2217", "loop", "spy"):
    register_scheme(_scheme, open_serial)
register_scheme("udp", open_udp)
