"""Taps of a faulty transport that tests put on a cable."""

from drivers.transport.faulty import Tap


def once(tap: Tap) -> Tap:
    """Return a tap that acts on the first non-empty bytes only."""
    struck = False

    def strike(data: bytes) -> bytes:
        nonlocal struck
        if struck or not data:
            return data
        struck = True
        return tap(data)

    return strike
