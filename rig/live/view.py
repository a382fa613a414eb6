"""The text of the display: lines made from one snapshot, for any terminal size."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from estimation.recording import FloatArray
from rig.live import text as words
from rig.live.block import DeviceStatus, LimitStatus
from rig.live.options import ShowOptions
from rig.live.state import TRACE_S, Reading, Snapshot

# The palette of Okabe and Ito (2008), distinguishable by every kind of colour vision; each
# style also has a word or a symbol.
STYLES = {
    "title": "bold",
    "quiet": "dim",
    "estimate": "#56B4E9",
    "sensor": "#E69F00",
    "good": "#009E73",
    "warning": "bold #E69F00",
    "bad": "bold #D55E00",
}

# digits three lines high, to be read from the other side of the bench
GLYPHS = {
    "0": ("█▀█", "█ █", "▀▀▀"),
    "1": ("▀█ ", " █ ", "▀▀▀"),
    "2": ("▀▀█", "█▀▀", "▀▀▀"),
    "3": ("▀▀█", " ▀█", "▀▀▀"),
    "4": ("█ █", "▀▀█", "  ▀"),
    "5": ("█▀▀", "▀▀█", "▀▀▀"),
    "6": ("█▀▀", "█▀█", "▀▀▀"),
    "7": ("▀▀█", "  █", "  ▀"),
    "8": ("█▀█", "█▀█", "▀▀▀"),
    "9": ("█▀█", "▀▀█", "▀▀▀"),
    "-": ("  ", "▀▀", "  "),
    ".": (" ", " ", "▀"),
}

WIDE = 64
"""From this many columns on, the numbers are next to the digits and not below them."""

LEAST_TRACES = 5
"""Lines reserved for the traces."""

LEAST_LIMITS = 2
"""Lines reserved for the limits: the nearest, and how many there are besides."""

MARGIN = 18
"""Columns left of a trace, for its name and the edges of its scale."""

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bit of each dot of a braille character, (row, column), Unicode block U+2800."""


@dataclass(frozen=True)
class View:
    """A snapshot as rich renders it. Fits the width; the traces take what height is left."""

    snapshot: Snapshot
    options: ShowOptions

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield one line of text after the other, none wider than the terminal."""
        # the last column and line stay free: some terminals wrap or scroll there
        width, height = max(options.max_width - 1, 20), console.height - 1
        for line in self.lines(width, height):
            line.truncate(width, overflow="ellipsis")
            yield line

    def lines(self, width: int, height: int) -> list[Text]:
        """Return the display's lines, at most `height` of them if the terminal is not tiny."""
        snapshot, main = self.snapshot, self.snapshot.readings[0]
        above = [
            _header(snapshot, self.options.title, width),
            *_headline(main, self.options, width),
        ]
        above += [_other(reading, self.options) for reading in snapshot.readings[1:]]
        if snapshot.flagged:
            seen = words.flagged(snapshot.flagged)
            above.append(_styled(f"▲ flagged in {TRACE_S:g} s: {seen}", "warning"))
        below = [_device(device) for device in snapshot.devices]
        footer = [_styled(line, "quiet") for line in self.options.footer.splitlines()]
        room = max(height - len(above) - len(below) - len(footer) - LEAST_TRACES, LEAST_LIMITS)
        below += list(_limits(snapshot.limits, width, room))
        below += footer
        free = height - len(above) - len(below)
        return [*above, *_traces(main, width, free), *below]


def _styled(content: str, style: str = "") -> Text:
    return Text(content, style=STYLES.get(style, style), no_wrap=True)


def _header(snapshot: Snapshot, title: str, width: int) -> Text:
    """Title on the left; time, rate and losses on the right. The right part is never cut."""
    time = "no samples yet" if snapshot.time_s is None else f"{snapshot.time_s:.1f} s"
    right = f"{time}  {words.rate(snapshot)}  "
    lost = words.lost(snapshot.lost, snapshot.samples)
    room = width - len(right) - len(lost) - 1
    line = _styled(title, "title")
    line.truncate(max(room, 0), overflow="ellipsis", pad=True)
    line.append(" " + right)
    line.append(lost, style=STYLES["bad"] if snapshot.lost else "")
    return line


def _headline(reading: Reading, options: ShowOptions, width: int) -> Iterator[Text]:
    """Yield the main number in large digits, and what belongs to it."""
    source, size = reading.source, words.size_of(reading)
    digits = words.digits(reading.main, reading.unit, size)
    name = _styled(f"{words.name_of(reading.channel)}, {source}  ", "title")
    number = _styled(words.main_words(reading, options), "warning" if digits is None else source)
    if name.cell_len + number.cell_len <= width:
        yield name.append_text(number)
    else:
        yield from (name, number)
    large = ["", "  ▀▀▀ ▀▀▀ ▀▀▀", ""] if digits is None else big(digits)
    notes = list(words.notes(reading, options))
    if width < WIDE:
        yield from (_styled(line, source) for line in large)
        yield from (_styled(line) for line in notes if line)
        return
    for line, note in zip(large, notes, strict=True):
        # the column is wide enough for -999.9, so that the notes stand still
        yield _styled(f"{line:<24}", source).append(note, style="default")


def big(number: str) -> list[str]:
    """Return three lines that spell a number of digits, a minus and a point."""
    glyphs = [GLYPHS[character] for character in number]
    return [" ".join(glyph[line] for glyph in glyphs) for line in range(3)]


def _other(reading: Reading, options: ShowOptions) -> Text:
    """Return one line on a quantity that is not the main one."""
    line = _styled(f"{words.name_of(reading.channel)}, {reading.source} ")
    line.append(words.main_words(reading, options), style=STYLES[reading.source])
    if reading.has_estimator:
        sensor = words.with_unit(reading.sensor, reading.unit, words.size_of(reading))
        line.append(f", sensor {sensor}")
    return line


def _traces(reading: Reading, width: int, free: int) -> Iterator[Text]:
    """Yield the recent traces, one under the other on one scale, in at most `free` lines."""
    factor, unit, _ = words.in_shown_unit(reading.unit, words.size_of(reading))
    traces = {"estimate": reading.estimate_trace * factor, "sensor": reading.sensor_trace * factor}
    shown = {name: trace for name, trace in traces.items() if not np.all(np.isnan(trace))}
    height = (free - 1) // max(len(shown), 1)
    if not shown or height < 1:
        return
    scale = round_scale(
        min(float(np.nanmin(trace)) for trace in shown.values()),
        max(float(np.nanmax(trace)) for trace in shown.values()),
    )
    for name, trace in shown.items():
        yield from _trace(name, trace, scale, width, height)
    yield _styled(f"{'':<{MARGIN}}{unit}, last {TRACE_S:g} s", "quiet")


def _trace(
    name: str, trace: FloatArray, scale: tuple[float, float], width: int, height: int
) -> Iterator[Text]:
    """Yield the lines of one trace, its name and the edges of its scale on the left."""
    low, high = f"{scale[0]:g}", f"{scale[1]:g}"
    labels = [high, *[""] * (height - 2), low] if height > 1 else [f"{low}..{high}"]
    names = [name, *[""] * (height - 1)]
    drawn = sparkline(trace[0], trace[1], width - MARGIN, height, scale)
    for title, label, line in zip(names, labels, drawn, strict=True):
        edge = "┤" if label else "│"
        yield _styled(f"{title:<8} {label:>7} {edge}").append(line, style=STYLES[name])


def sparkline(
    low: FloatArray, high: FloatArray, width: int, height: int, scale: tuple[float, float]
) -> list[str]:
    """Return `height` lines of `width` braille characters: the range of a signal over time.

    Least and greatest value of each segment have shape (n,), oldest first; NaN makes a gap. The
    scale is the values at the lower and the upper edge.
    """
    edges = np.linspace(0, low.size, 2 * width + 1)
    first = np.minimum(edges[:-1].astype(int), low.size - 1)
    low, high = np.fmin.reduceat(low, first), np.fmax.reduceat(high, first)
    # reach out to the neighbour, so that a steep rise is one line and not two dots
    low, high = (
        np.fmin(low, np.where(np.isnan(low), np.nan, np.append(np.nan, high[:-1]))),
        np.fmax(high, np.where(np.isnan(high), np.nan, np.append(np.nan, low[:-1]))),
    )
    rows = 4 * height
    per_row = (scale[1] - scale[0]) / (rows - 1)
    level = scale[1] - per_row * np.arange(rows)[:, None]
    dots = (level >= low - per_row / 2) & (level <= high + per_row / 2)
    cells = dots.reshape(height, 4, width, 2) * DOTS[None, :, None, :]
    return ["".join(chr(0x2800 + int(c)) for c in row) for row in cells.sum(axis=(1, 3))]


def round_scale(low: float, high: float) -> tuple[float, float]:
    """Return round edges around a range and zero, so that the scale seldom changes."""
    low, high = min(low, 0.0), max(high, 0.0)
    if high - low < 1e-9:
        return 0.0, 1.0
    power = 10.0 ** math.floor(math.log10(high - low))
    step = next(power * s for s in (0.2, 0.5, 1.0, 2.0) if power * s * 5 >= high - low)
    return step * math.floor(low / step), step * math.ceil(high / step)


def _device(device: DeviceStatus) -> Text:
    symbol, style = words.STATES.get(device.state, ("◆", "warning"))
    line = _styled(f"{symbol} {device.name} ", style).append(device.state)
    return line.append(f"  {device.detail}" if device.detail else "", style="default")


def _limits(limits: Sequence[LimitStatus], width: int, room: int) -> Iterator[Text]:
    """Yield the limits, or the nearest of them if the room is too small for all."""
    if len(limits) <= room:
        yield from (_limit(limit, width) for limit in limits)
        return
    nearest = sorted(limits, key=_share, reverse=True)[: room - 1]
    yield from (_limit(limit, width) for limit in limits if limit in nearest)
    yield _styled(f"{len(limits) - len(nearest)} more limits, none nearer", "quiet")


def _share(limit: LimitStatus) -> float:
    """Return a rank: a limit with an unknown share comes first."""
    share = words.limit_share(limit)
    return np.inf if share is None else share


def _limit(limit: LimitStatus, width: int) -> Text:
    """Return a limit as a bar and in numbers; the bar gives way in a narrow terminal."""
    text, style = words.limit_words(limit)
    line = _styled(f"{limit.name} ")
    if width >= WIDE:
        filled = round(20 * min(words.limit_share(limit) or 0.0, 1.0))
        line.truncate(20, overflow="ellipsis", pad=True)
        line.append("█" * filled + "░" * (20 - filled), style=STYLES[style]).append(" ")
    return line.append(text, style=STYLES[style] if style != "good" else "")
