"""Keys of the live display: read as they are pressed, without waiting, only in a terminal."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

TARE, MARK, RECORD, STOP, LEAVE = "t", "m", "r", "s", "q"
HELP = "t tare  m mark  r record  s stop  q quits"

Keys = Callable[[], str]
"""Gives the keys pressed since it was last asked; empty when there are none."""


def no_keys() -> str:
    """Return that nothing was pressed."""
    return ""


@contextmanager
def pressed_keys() -> Iterator[Keys | None]:
    """Yield the keys of the terminal, and give the terminal back on the way out.

    Yields None where stdin is not a terminal, or the system has none of this kind: then nothing is
    read, and Ctrl-C quits.
    """
    try:
        import select
        import termios
        import tty
    except ImportError:  # Windows
        yield None
        return
    if not sys.stdin.isatty():
        yield None
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)

    def pressed() -> str:
        keys = ""
        while select.select([handle], [], [], 0)[0]:
            try:
                key = os.read(handle, 1)
            except OSError:  # the terminal is gone; SIGHUP ends the session
                break
            if not key:
                break
            keys += key.decode("ascii", "ignore").lower()
        return keys

    try:
        tty.setcbreak(handle)
        yield pressed
    finally:
        with suppress(termios.error):  # a terminal that is gone needs nothing back
            termios.tcsetattr(handle, termios.TCSADRAIN, before)
