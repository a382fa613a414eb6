"""Output of the command line: results on stdout, progress, remarks and errors on stderr.

With `--json` stdout carries JSON alone, and results for people go to stderr.
"""

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from rig.output.table import TextTable

PIPE_WIDTH = 240
"""Columns of a table without a window to limit it."""

JsonFlag = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]
"""The `--json` option every verb has."""


def results(json: bool) -> "Console":
    """Return the console for results: stdout, or stderr where stdout carries JSON.

    A pipe has no width: tables keep their columns there.
    """
    screen = _console(stderr=json)
    if not screen.is_terminal:
        screen.width = PIPE_WIDTH
    return screen


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


@contextmanager
def stages() -> "Iterator[Callable[[str], None]]":
    """Yield what is called with each stage that begins; a terminal shows how long each takes."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    screen = remarks()
    if not screen.is_terminal:
        yield lambda what: screen.print(f"{what} ...")
        return
    columns = SpinnerColumn(finished_text="-"), TextColumn("{task.description}", markup=False)
    with Progress(*columns, TimeElapsedColumn(), console=screen) as shown:

        def begin(what: str) -> None:
            for task in shown.tasks:
                shown.update(task.id, total=1, completed=1)
            shown.add_task(what, total=None)

        yield begin
        for task in shown.tasks:
            shown.update(task.id, total=1, completed=1)


def show_result(
    lines: Iterable[str],
    tables: Iterable["TextTable"],
    out: Path | None,
    markdown: Callable[[], str],
    json: bool,
) -> None:
    """Show a result to people, and write it where they asked for a file.

    Args:
        lines: Lines printed first.
        tables: Shown below.
        out: File for the Markdown, or None for none.
        markdown: Returns the file's text.
        json: Whether stdout is to carry JSON.

    Raises:
        OSError: The file cannot be written.
    """
    from estimation.files import write_text_atomic
    from rig.output.table import to_rich

    screen = results(json)
    for line in lines:
        screen.print(line)
    for table in tables:
        screen.print(to_rich(table))
    if out is not None:
        write_text_atomic(out, markdown())
        screen.print(f"Markdown: {out}")


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
