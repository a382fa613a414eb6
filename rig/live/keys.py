"""Keys of the live display: read as they are pressed, without waiting, only in a terminal."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

TARE, MARK, RECORD, STOP, LEAVE = "t", "m", "r", "s", "q"
CHANNEL, HELP = "c", "?"
OF_DISPLAY = {
    CHANNEL: ("channel", "shows the next channel of the rig in large digits and as trace"),
    HELP: ("help", "shows or hides this list"),
}
OF_SESSION = {
    TARE: ("tare", "takes the sensors' zeros; at standstill and not while recording"),
    MARK: ("mark", "marks the newest sample of the recording"),
    RECORD: ("record", "starts or stops a recording"),
    STOP: ("stop", "disarms the rig, waits for the board's confirmation, and goes on watching"),
    **OF_DISPLAY,
    LEAVE: ("quits", "ends the display; the rig is disarmed"),
}
"""Key to its word and what it does."""

Keys = Callable[[], str]
"""Gives the keys pressed since it was last asked; empty when there are none."""


def no_keys() -> str:
    """Return that nothing was pressed."""
    return ""


class DisplayKeys:
    """Keys, of which those of the display alone are kept back: the channel shown, and the help."""

    def __init__(self, keys: Keys) -> None:
        self._keys = keys
        self.chosen = 0
        """How often another channel was asked for."""
        self.helps = False
        """Whether the help is shown."""

    def __call__(self) -> str:
        """Return the keys that are not the display's."""
        pressed = self._keys()
        self.chosen += pressed.count(CHANNEL)
        self.helps ^= pressed.count(HELP) % 2 == 1
        return "".join(key for key in pressed if key not in OF_DISPLAY)


@contextmanager
def display_keys() -> Iterator[DisplayKeys | None]:
    """Yield the keys of the terminal, and give the terminal back on the way out.

    Yields None where stdin is not a terminal, or the system has none of this kind: then nothing is
    read, and Ctrl-C quits.
    """
    try:
        import select
        import termios
        import tty

        is_readable = sys.stdin.isatty()
    except ImportError:  # Windows
        is_readable = False
    if not is_readable:
        yield None
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)

    def pressed() -> str:
        keys = b""
        with suppress(OSError):  # the terminal is gone; SIGHUP ends the session
            while select.select([handle], [], [], 0)[0] and (key := os.read(handle, 1)):
                keys += key
        return keys.decode("ascii", "ignore").lower()

    try:
        tty.setcbreak(handle)
        yield DisplayKeys(pressed)
    finally:
        with suppress(termios.error):  # a terminal that is gone needs nothing back
            termios.tcsetattr(handle, termios.TCSADRAIN, before)
