"""Ctrl-C, SIGTERM and a lost terminal while a rig is connected: the first of them requests the end.

No further one stops that. A terminal is lost with its window or its connection; what is still
written to it then goes nowhere, so that no failed write breaks into the way out.
"""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from types import FrameType

LEAVING_S = 3.0
"""Within this time after the first, further ones are not heard: the rig is being made safe."""

STANDARD_STREAMS = (0, 1, 2)
"""File descriptors of stdin, stdout and stderr."""


_asked = False
"""Whether a signal has requested the end of the session that is under way."""


def end_is_requested() -> bool:
    """Whether a signal has requested the end of the session.

    An exception that a signal raises inside a callback from compiled code goes nowhere. A loop
    that must end asks here as well.
    """
    return _asked


@contextmanager
def leaving_safely() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into KeyboardInterrupt; no second one breaks into the way out.

    Making the rig safe takes a fraction of a second; when somebody is still here after
    `LEAVING_S`, they are heard again. A SIGHUP that the program is to ignore (`nohup`) stays
    ignored.
    """
    left_s: float | None = None

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal left_s
        global _asked
        _asked = True
        if number == HANG_UP:
            _leave_lost_terminal()
        if left_s is not None and monotonic() - left_s < LEAVING_S:
            with suppress(OSError):
                sys.stderr.write("Making the rig safe first.\n")
            return
        left_s = monotonic()
        raise KeyboardInterrupt

    numbers = [signal.SIGINT, signal.SIGTERM]
    if HANG_UP is not None and signal.getsignal(HANG_UP) is not signal.SIG_IGN:
        numbers.append(HANG_UP)
    global _asked
    _asked = False
    try:
        previous = {number: signal.signal(number, interrupt) for number in numbers}
    except ValueError:  # not in the main thread, where signals never arrive
        yield
        return
    try:
        yield
    finally:
        _asked = False
        for number, handler in previous.items():
            signal.signal(number, handler)


HANG_UP: signal.Signals | None = getattr(signal, "SIGHUP", None)
"""What a lost terminal sends; None on a system without it."""


def _leave_lost_terminal() -> None:
    """Point the standard streams that can no longer be written at the null device."""
    for stream in STANDARD_STREAMS:
        try:
            os.write(stream, b"")
        except OSError:
            with suppress(OSError):
                null = os.open(os.devnull, os.O_RDWR)
                os.dup2(null, stream)
                os.close(null)
