"""Show a stream of blocks until it ends or the user quits."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import chain

from rich.console import Console

from rig.bench.interrupts import end_is_requested
from rig.live.block import SampleBlock
from rig.live.options import ShowOptions
from rig.live.state import LiveState, Summary
from rig.live.writers import Writer, choose_writer

MOST_SHOWN = 6
"""Channels shown of a device whose main ones are not known."""


def show(
    blocks: Iterator[SampleBlock],
    options: ShowOptions,
    console: Console,
    clock: Callable[[], float] = time.monotonic,
) -> Summary:
    """Show a stream of blocks and return what it came to.

    Frames are timed by the device's clock. A block that spans several frames gives one, so the
    display is never behind the stream. Ctrl-C ends the stream and is not an error; whatever else
    the stream raises is passed on after the terminal has been given back.

    Args:
        blocks: The stream. A generator is closed on the way out, before anything else is done.
        options: How to show it.
        console: Console of the user.
        clock: Monotonic time, s; only for silence and for frames that cost too much.
    """
    close = getattr(blocks, "close", None)
    if not options.channels:  # whatever the device measures
        first = next(blocks)
        options = replace(options, channels=tuple(first.columns)[:MOST_SHOWN])
        blocks = chain([first], blocks)
    state = LiveState(options.channels, all_columns=options.keys is not None)
    writer = choose_writer(options, console, clock)
    ended = "finished"
    with ExitStack() as stack:
        stack.enter_context(writer.running())
        if close is not None:
            stack.callback(close)
        try:
            _follow(blocks, state, writer, clock)
        except KeyboardInterrupt:
            ended = "interrupted"
    summary = state.summary(ended)
    writer.summary(summary)
    return summary


def _follow(
    blocks: Iterator[SampleBlock], state: LiveState, writer: Writer, clock: Callable[[], float]
) -> None:
    """Feed every block, and give the writer a frame whenever a new period has begun."""
    shown: tuple[str, int] | None = None
    for block in blocks:
        if end_is_requested():
            raise KeyboardInterrupt
        state.feed(block)
        # device time stands still while nothing arrives, and silence must be shown too
        silent = len(block) == 0
        now_s = clock() if silent else float(block.time_s[-1])
        period = ("silent" if silent else "device", math.floor(now_s / writer.period_s))
        if period != shown:
            shown = period
            writer.frame(state.snapshot())
