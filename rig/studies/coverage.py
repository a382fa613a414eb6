"""What of a paper each study holds: its tables, figures and experiments, row by row.

The rows are in `coverage.toml`: section of the paper, what it holds, state (one of `STATES`), and
where or why.
"""

import tomllib
from functools import cache
from pathlib import Path

from rig.output.table import TextTable

STATES = ("reproduced", "partial", "different", "missing", "not possible")


@cache
def rows(paper: str) -> tuple[tuple[str, str, str, str], ...]:
    """Return a paper's rows: section, what, state, where or why."""
    held = tomllib.loads(Path(__file__).with_name("coverage.toml").read_text("utf-8"))
    return tuple((row[0], row[1], row[2], row[3]) for row in held[paper]["rows"])


def coverage(paper: str, part: str = "") -> TextTable:
    """Return a paper's rows as a table; the paper is a key of `coverage.toml`.

    Of a paper with two pages, `part` is the command that the last column of a row must name.
    """
    shown = [list(row) for row in rows(paper) if not part or f"rig study {part}" in row[3]]
    counts = ", ".join(f"{sum(row[2] == state for row in shown)} {state}" for state in STATES)
    note = f"{counts}."
    if part:
        note += " The paper's other rows are on its other page."
    return TextTable(
        "The paper, row by row", ["section", "what", "state", "where or why"], shown, note
    )
