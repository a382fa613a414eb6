"""A request to end that was lost in a callback still ends the live display."""

import io
import os
import signal
from collections.abc import Iterator
from contextlib import suppress

from rich.console import Console

from rig.bench.interrupts import leaving_safely
from rig.live.block import SampleBlock
from rig.live.options import ShowOptions
from rig.live.show import show
from tests.rig.blocks import block


def _swallowed() -> Iterator[SampleBlock]:
    """Yield blocks for ever; the signal's exception is lost once, as in a compiled callback."""
    with leaving_safely():
        yield block(0, 1)
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        for k in range(1, 1000):
            yield block(10 * k, 1)


def test_a_request_that_was_lost_in_a_callback_ends_the_display():
    console = Console(file=io.StringIO(), width=100)
    summary = show(_swallowed(), ShowOptions("x", plain=True), console)
    assert summary.ended == "interrupted"
