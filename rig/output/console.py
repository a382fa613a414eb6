"""Output of the command line: results on stdout, progress, remarks and errors on stderr.

With `--json` stdout carries JSON alone, and results for people go to stderr.
"""

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, Task

    from rig.output.table import TextTable

PIPE_WIDTH = 240
"""Columns of a table without a window to limit it."""

IN_MINUTES_S = 90.0
"""From here on a time is stated in minutes."""

JsonFlag = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]
"""The `--json` option every verb has."""

JsonLinesFlag = Annotated[bool, typer.Option("--json", help="JSON objects on stdout, one a line.")]
"""The same of a verb that writes as long as it runs."""


def results(json: bool) -> "Console":
    """Return the console for results: stdout, or stderr where stdout carries JSON.

    A pipe has no width: tables keep their columns there.
    """
    screen = _console(stderr=json)
    if not screen.is_terminal:
        screen.width = PIPE_WIDTH
    return screen


def present(json: bool, data: Any, *shown: "str | TextTable") -> None:
    """Show a result: text and tables to people, and with `json` its data on stdout."""
    show(results(json), *shown)
    if json:
        emit_json(data)


def show(screen: "Console", *shown: "str | TextTable") -> None:
    """Print lines and tables."""
    for one in shown:
        if isinstance(one, str):
            screen.print(one)
        else:
            _show_table(screen, one)


def _show_table(screen: "Console", table: "TextTable") -> None:
    """Print a table; where the terminal is too narrow for it, a paragraph for each row."""
    from rig.output.table import to_rich

    whole = to_rich(table)
    unlimited = screen.options.update(width=10_000)
    if not screen.is_terminal or screen.measure(whole, options=unlimited).maximum <= screen.width:
        screen.print(whole)
        return
    rows = []
    for name, *cells in table.rows:
        said = (f"{c} {cell}" for c, cell in zip(table.columns[1:], cells, strict=True) if cell)
        rows.append(f"{name}: {', '.join(said)}")
    for line in filter(None, (table.title, *rows, table.note)):
        screen.print(line, style="default", soft_wrap=False)


def remarks() -> "Console":
    """Return the console for progress and remarks: stderr."""
    return _console(stderr=True)


def _console(stderr: bool) -> "Console":
    """Return a console that prints text as it is: brackets in a note or a path are no markup."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, soft_wrap=True, markup=False, emoji=False)


def progress() -> "Progress":
    """Return a progress bar on stderr, silent where that is not a terminal.

    Messages during its run go through its `console`, which prints above it.
    """
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    screen = remarks()
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=screen,
        disable=not screen.is_terminal,
    )


def time_left(expected: Mapping[str, tuple[float, float]], stage: str, elapsed_s: float) -> str:
    """Return the time that is left in words; empty where it is not known.

    Expected are the shortest and longest time of each stage, s, in order; one of them is at work.
    """
    if stage not in expected:
        return ""
    if elapsed_s > expected[stage][1]:
        return "longer than before"
    later = list(expected).index(stage) + 1
    ends = [
        max(0.0, expected[stage][k] - elapsed_s)
        + sum(times[k] for times in list(expected.values())[later:])
        for k in (0, 1)
    ]
    size, unit = (1.0, "s") if ends[1] < IN_MINUTES_S else (60.0, "min")
    low, high = (f"{end / size:.0f}" for end in ends)
    return f"about {high} {unit} left" if low == high else f"{low} to {high} {unit} left"


@contextmanager
def counting(what: str, total: float | None = None) -> "Iterator[Callable[..., None]]":
    """Show how much of some work is done; yields what is called after each part of it."""
    with progress() as bar:
        task = bar.add_task(what, total=total)
        yield lambda *_: bar.advance(task)


@contextmanager
def described(what: str) -> Iterator[Callable[[str], None]]:
    """Show what some work does; yields what is called with each step, in words."""
    with progress() as bar:
        task = bar.add_task(what, total=None)
        yield lambda step: bar.update(task, description=step)


@contextmanager
def counted(what: str) -> Iterator[Callable[[float, float], None]]:
    """Show how much of some work is done; yields what is called with that, and the total."""
    with progress() as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def stages(
    expected: Mapping[str, tuple[float, float]] | None = None,
) -> "Iterator[Callable[[str], None]]":
    """Yield what is called with each stage that begins; a terminal shows how long each takes.

    Expected is as in `time_left`, as far as it is known.
    """
    from rich.progress import Progress, ProgressColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.text import Text

    class Left(ProgressColumn):
        def render(self, task: "Task") -> Text:
            if task.finished or task.elapsed is None:
                return Text("")
            return Text(time_left(expected or {}, task.description, task.elapsed))

    screen = remarks()
    if not screen.is_terminal:
        yield lambda what: screen.print(f"{what} ...")
        return
    columns = SpinnerColumn(finished_text="-"), TextColumn("{task.description}", markup=False)
    with Progress(*columns, TimeElapsedColumn(), Left(), console=screen) as shown:

        def begin(what: str) -> None:
            for task in shown.tasks:
                shown.update(task.id, total=1, completed=1)
            shown.add_task(what, total=None)

        yield begin
        for task in shown.tasks:
            shown.update(task.id, total=1, completed=1)


def plain(value: Any) -> Any:
    """Return a value as plain JSON types; a number that is not finite becomes null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # NumPy scalars and arrays, without importing NumPy
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def to_json(value: Any) -> str:
    """Return a value as one line of JSON."""
    return json.dumps(plain(value), allow_nan=False) + "\n"


def emit_json(value: Any) -> None:
    """Write one JSON object and a newline to stdout."""
    sys.stdout.write(to_json(value))
    sys.stdout.flush()
