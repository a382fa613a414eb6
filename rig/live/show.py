"""Show a stream of blocks until it ends or the user quits: drawn, as lines, or as JSON objects."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain

from rich.console import Console
from rich.control import Control
from rich.live import Live
from rich.segment import Segment

from estimation.channels import unit_of
from rig.bench.interrupts import end_is_requested
from rig.live.block import SampleBlock
from rig.live.options import ShowOptions
from rig.live.state import LiveState, Snapshot, Summary
from rig.live.text import json_frame, plain_line, summary_lines
from rig.live.view import View
from rig.log.devices import channel_of
from rig.output.console import emit_json

MOST_SHOWN = 6
"""Channels shown of a device whose main ones are not known."""


def _sequence(code: str) -> Control:
    """Return an escape sequence that rich passes on as it is."""
    control = Control()
    control.segment = Segment(code, None, [])
    return control


# synchronised update (DEC private mode 2026): the terminal shows the frame whole, with no moment
# in which the old one is wiped and the new one not yet there; terminals without it ignore it
BEGIN_FRAME = _sequence("\x1b[?2026h")
END_FRAME = _sequence("\x1b[?2026l")


def show(
    blocks: Iterator[SampleBlock],
    options: ShowOptions,
    console: Console,
    clock: Callable[[], float] = time.monotonic,
) -> Summary:
    """Show a stream of blocks and return what it came to.

    Frames are timed by the device's clock. A block that spans several frames gives one, so the
    display is never behind the stream. Ctrl-C ends the stream and is not an error; whatever else
    the stream raises is passed on after the terminal has been given back. A generator is closed on
    the way out, before anything else is done. The clock, monotonic, s, is for silence and for
    frames that cost too much.
    """
    close = getattr(blocks, "close", None)
    if not options.channels or options.devices:  # which channels they have, they know alone
        first = next(blocks)
        options = replace(options, channels=_shown(options, first))
        blocks = chain([first], blocks)
    state = LiveState(options.channels, all_columns=options.keys is not None)
    writer = _writer(options, console, clock)
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


def _shown(options: ShowOptions, first: SampleBlock) -> tuple[str, ...]:
    """Return the stated channels with those of further devices; of a device alone, all it has."""
    if not options.channels:
        return tuple(first.columns)[:MOST_SHOWN]
    prefixes = tuple(channel_of(device, "") for device in options.devices)
    further = [name for name in first.columns if name.startswith(prefixes)]
    return tuple(dict.fromkeys([*options.channels, *further[:MOST_SHOWN]]))


@dataclass(frozen=True)
class Writer:
    """One way to show a stream: a frame each period of device time, and its summary at the end.

    `running` holds the output while the stream runs.
    """

    period_s: float
    frame: Callable[[Snapshot], None]
    summary: Callable[[Summary], None]
    running: Callable[[], AbstractContextManager[object]] = nullcontext


def _writer(options: ShowOptions, console: Console, clock: Callable[[], float]) -> Writer:
    """Return the writer that the options ask for and the terminal can do."""

    def say(*lines: str) -> None:
        for line in lines:
            console.print(line, markup=False, highlight=False, soft_wrap=True)

    def sum_up(summary: Summary) -> None:
        say(*summary_lines(summary, unit_of(summary.channel)))

    if options.json:
        return Writer(
            0.1,
            lambda snapshot: emit_json(json_frame(snapshot, options)),
            lambda summary: emit_json({"kind": "summary", "summary": summary}),
        )
    can_draw = console.is_terminal and not console.is_dumb_terminal
    if options.plain or not can_draw or not console.encoding.startswith("utf"):
        return Writer(0.5, lambda snapshot: say(plain_line(snapshot, options)), sum_up)
    display = Display(options, console, clock)
    return Writer(display.period_s, display.frame, sum_up, display.running)


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


class Display:
    """Draws on the terminal; lines written meanwhile appear above the drawing."""

    period_s = 0.1

    def __init__(self, options: ShowOptions, console: Console, clock: Callable[[], float]) -> None:
        self._options = options
        self._console = console
        self._clock = clock
        # no thread of its own: nothing else draws while the stream is being read
        self._live = Live(console=console, auto_refresh=False, vertical_overflow="crop")
        self._size = console.size
        self._free_s = float("-inf")
        self._skipped: Snapshot | None = None

    @contextmanager
    def running(self) -> Iterator[None]:
        """Hold the lower part of the terminal; keep the newest frame on it at the end."""
        with self._live:
            yield
            if self._skipped is not None:
                self._live.update(self._view(self._skipped))  # drawn as the live part ends

    def frame(self, snapshot: Snapshot) -> None:
        """Draw a snapshot, or skip it when drawing would take more than half of the time."""
        started_s = self._clock()
        if started_s < self._free_s:
            self._skipped = snapshot
            return
        self._skipped = None
        self._draw(snapshot)
        cost_s = self._clock() - started_s
        self._free_s = started_s + max(2 * cost_s, 0.75 * self.period_s)

    def _draw(self, snapshot: Snapshot) -> None:
        if self._console.size != self._size:
            # lines of another width have wrapped and cannot be drawn over
            self._size = self._console.size
            self._console.clear()
        with self._console:  # one write a frame
            self._console.control(BEGIN_FRAME)
            try:
                self._live.update(self._view(snapshot), refresh=True)
            finally:
                self._console.control(END_FRAME)

    def _view(self, snapshot: Snapshot) -> View:
        options, keys = self._options, self._options.keys
        if keys is None:
            return View(snapshot, options)
        readings = snapshot.readings
        main = readings[keys.chosen % len(readings)]
        usual = readings[: len(options.channels)]
        shown = (main, *(reading for reading in usual if reading is not main))
        snapshot = replace(snapshot, readings=shown)
        return View(snapshot, replace(options, footer=options.help) if keys.helps else options)
