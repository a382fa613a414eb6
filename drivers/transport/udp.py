"""UDP to one device: `udp:HOST:PORT`. Each read is one datagram.

The socket is connected: the kernel drops datagrams from anyone else.
"""

import select
import socket

from drivers.errors import LinkError, LinkLostError
from drivers.transport.transport import HostLink

LARGEST_DATAGRAM = 65535
RECEIVE_BUFFER = 1 << 20
"""Receive buffer of the kernel for a late reader, bytes: seconds of a 7 kHz stream."""


class UdpTransport(HostLink):
    """Datagrams to and from one address."""

    def __init__(self, url: str, connected: socket.socket) -> None:
        super().__init__(url)
        self._socket = connected
        connected.setblocking(False)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)

    def read(self, timeout_s: float) -> bytes:
        """Return the next datagram, waiting at most `timeout_s` for it."""
        self._require_link()
        try:
            if not select.select([self._socket], [], [], max(0.0, timeout_s))[0]:
                return b""
            return self._socket.recv(LARGEST_DATAGRAM)
        except BlockingIOError:
            return b""  # a datagram with a bad checksum was there and is not
        except OSError as error:
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Send `data` as one datagram."""
        self._require_link()
        try:
            self._socket.send(data)
        except OSError as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Close the socket."""
        self._closes()
        self._socket.close()

    def _gone(self, error: OSError) -> LinkLostError:
        return self._lose(
            f"The link to {self.url} is gone.",
            f"{error}.",
            "Check that the device is powered and in this computer's network.",
        )


def open_udp(url: str) -> UdpTransport:
    """Open `udp:HOST:PORT` (or `udp://HOST:PORT`).

    Raises:
        LinkError: The URL is not so written, or the host is unknown or out of reach.
    """
    host, port = split_address(url)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[
            0
        ]
        connected = socket.socket(family, kind, protocol)
    except OSError as error:
        raise LinkError(
            f"{url} cannot be opened.", f"{error}.", "Check the host's name."
        ) from error
    try:
        connected.connect(address)
    except OSError as error:
        connected.close()
        raise LinkError(f"{url} cannot be reached.", f"{error}.", "Check the network.") from error
    return UdpTransport(url, connected)


def split_address(url: str) -> tuple[str, int]:
    """Return host and port of `udp:HOST:PORT`; `LinkError` where it is not so written."""
    host, colon, port = url.removeprefix("udp:").removeprefix("//").rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) < 65536):
        raise LinkError(
            f"{url!r} is not a UDP address.", "It needs a host and a port.", "Write udp:HOST:PORT."
        )
    return host.strip("[]"), int(port)
