"""Ctrl-C and SIGTERM while a rig is connected: only the first requests the end."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

LEAVING_S = 3.0
"""Within this time after the first, further ones are not heard: the rig is being made safe."""


@contextmanager
def leaving_safely() -> Iterator[None]:
    """Turn SIGTERM into KeyboardInterrupt, and let no second one break into the way out.

    Making the rig safe takes a fraction of a second; when somebody is still here after
    `LEAVING_S`, they are heard again.
    """
    left_s: float | None = None

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal left_s
        if left_s is not None and monotonic() - left_s < LEAVING_S:
            sys.stderr.write("Making the rig safe first.\n")
            return
        left_s = monotonic()
        raise KeyboardInterrupt

    numbers = (signal.SIGINT, signal.SIGTERM)
    try:
        previous = {number: signal.signal(number, interrupt) for number in numbers}
    except ValueError:  # not in the main thread, where signals never arrive
        yield
        return
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
