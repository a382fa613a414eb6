"""The way bytes travel to a device."""

from collections.abc import Iterator
from time import monotonic
from typing import Protocol

from drivers.device import Clocked
from drivers.errors import LinkLostError


class Transport(Clocked, Protocol):
    """Bytes to and from one device. Not for use by two threads at once."""

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that are there, waiting at most `timeout_s` for the first.

        Returns no bytes when none came in time.

        Raises:
            LinkLostError: The link is gone; every later call raises it again.
        """

    def write(self, data: bytes) -> None:
        """Send all of `data`.

        Raises:
            LinkLostError: The link is gone.
            LinkTimeoutError: The device does not take the bytes.
        """


def time_left(way: Clocked, timeout_s: float) -> Iterator[float]:
    """Yield the time that is left, s, by the clock of a way, until there is none."""
    give_up_s = way.now_s + timeout_s
    while (remaining_s := give_up_s - way.now_s) > 1e-9:  # less is a sum's rounding
        yield remaining_s


def arriving(transport: Transport, timeout_s: float) -> Iterator[bytes]:
    """Yield all that has come from now on, again after each read, until the time is over."""
    came = b""
    for remaining_s in time_left(transport, timeout_s):
        came += transport.read(remaining_s)
        yield came


class HostLink:
    """What every link of this computer has: its URL, the host's clock, and that it may be lost."""

    def __init__(self, url: str) -> None:
        self.url = url
        self._lost: LinkLostError | None = None
        self._closed = False

    @property
    def now_s(self) -> float:
        """The host's monotonic clock, seconds."""
        return monotonic()

    def _lose(
        self, what: str, why: str, fix: str, kind: type[LinkLostError] = LinkLostError
    ) -> LinkLostError:
        """Take the link for gone: every later call raises this error again."""
        self._lost = kind(what, why, fix)
        return self._lost

    def _closes(self) -> bool:
        """Let every later call raise an error; return whether it was open until now."""
        was_open, self._closed = not self._closed, True
        self._lost = self._lost or LinkLostError(f"{self.url} is closed.")
        return was_open

    def close(self) -> None:
        """Let go of the other end; the time of a fake stands still."""
        self._closes()

    def _require_link(self) -> None:
        if self._lost is not None:
            raise type(self._lost)(self._lost.what, self._lost.why, self._lost.fix)
