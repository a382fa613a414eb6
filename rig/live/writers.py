"""The three ways to show a stream: drawn on a terminal, as lines for people, as JSON objects."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from typing import Protocol

from rich.console import Console
from rich.control import Control
from rich.live import Live
from rich.segment import Segment

from estimation.channels import unit_of
from rig.live.options import ShowOptions
from rig.live.plain import json_frame, plain_line
from rig.live.state import Reading, Snapshot, Summary
from rig.live.text import summary_lines
from rig.live.view import View
from rig.output.console import emit_json


def _sequence(code: str) -> Control:
    """Return an escape sequence that rich passes on as it is."""
    control = Control()
    control.segment = Segment(code, None, [])
    return control


# synchronised update (DEC private mode 2026): the terminal shows the frame whole, with no moment
# in which the old one is wiped and the new one not yet there; terminals without it ignore it
BEGIN_FRAME = _sequence("\x1b[?2026h")
END_FRAME = _sequence("\x1b[?2026l")


class Writer(Protocol):
    """One way to show a stream."""

    period_s: float
    """Device time from one frame to the next, s."""

    def running(self) -> AbstractContextManager[object]:
        """Hold the output while the stream runs."""

    def frame(self, snapshot: Snapshot) -> None:
        """Show one snapshot."""

    def summary(self, summary: Summary) -> None:
        """Show what the stream came to, when it no longer runs."""


def choose_writer(options: ShowOptions, console: Console, clock: Callable[[], float]) -> Writer:
    """Return the writer that the options ask for and the terminal can do."""
    if options.json:
        return JsonWriter(options)
    can_draw = console.is_terminal and not console.is_dumb_terminal
    if options.plain or not can_draw or not console.encoding.startswith("utf"):
        return PlainWriter(options, console)
    return DisplayWriter(options, console, clock)


class JsonWriter:
    """Writes one JSON object a line on stdout."""

    period_s = 0.1

    def __init__(self, options: ShowOptions) -> None:
        self._options = options

    def running(self) -> AbstractContextManager[object]:
        """Hold nothing."""
        return nullcontext()

    def frame(self, snapshot: Snapshot) -> None:
        """Write an object of kind `frame`."""
        emit_json(json_frame(snapshot, self._options.lever_m, self._options.half_widths))

    def summary(self, summary: Summary) -> None:
        """Write an object of kind `summary`."""
        emit_json({"kind": "summary", "summary": summary})


class PlainWriter:
    """Writes a line for people twice a second."""

    period_s = 0.5

    def __init__(self, options: ShowOptions, console: Console) -> None:
        self._options = options
        self._console = console

    def running(self) -> AbstractContextManager[object]:
        """Hold nothing."""
        return nullcontext()

    def frame(self, snapshot: Snapshot) -> None:
        """Write one line."""
        options = self._options
        _say(self._console, plain_line(snapshot, options.lever_m, options.half_widths))

    def summary(self, summary: Summary) -> None:
        """Write what the stream came to."""
        _say_summary(self._console, summary)


class DisplayWriter:
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

    def summary(self, summary: Summary) -> None:
        """Write what the stream came to, under the last frame."""
        _say_summary(self._console, summary)

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
        options, keys, footer = self._options, self._options.keys, self._options.footer
        if keys is not None:
            snapshot = replace(snapshot, readings=self._chosen(snapshot.readings, keys.chosen))
            footer = options.help if keys.helps else footer
        return View(snapshot, options.title, options.lever_m, footer, options.half_widths)

    def _chosen(self, readings: tuple[Reading, ...], chosen: int) -> tuple[Reading, ...]:
        """Return the chosen channel and the usual ones."""
        main = readings[chosen % len(readings)]
        usual = readings[: len(self._options.channels)]
        return (main, *(reading for reading in usual if reading is not main))


def _say(console: Console, line: str) -> None:
    console.print(line, markup=False, highlight=False, soft_wrap=True)


def _say_summary(console: Console, summary: Summary) -> None:
    for line in summary_lines(summary, unit_of(summary.channel)):
        _say(console, line)
