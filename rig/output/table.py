"""One table, shown in a terminal, in Markdown and in HTML."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table as RichTable

    from rig.output.provenance import Provenance


@dataclass(frozen=True)
class TextTable:
    """A table of text; the first column is text, the others are numbers; a note stands below."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def counted(number: int, noun: str) -> str:
    """Return a number of things in words: `1 day`, `2 days`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def listed(values: Mapping[str, float | str]) -> str:
    """Return names with their values, such as conditions, in a line."""
    return ", ".join(
        f"{name} = {value if isinstance(value, str) else format(value, 'g')}"
        for name, value in values.items()
    )


def to_markdown(table: TextTable) -> str:
    """Return a table as Markdown, with its title as a heading."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    rule = "|" + "|".join(["---"] + ["---:"] * (len(table.columns) - 1)) + "|"
    lines = [f"## {table.title}", "", line(table.columns), rule, *map(line, table.rows)]
    return "\n".join([*lines, "", table.note] if table.note else lines) + "\n"


def to_page(
    paragraphs: Sequence[str],
    tables: Iterable[TextTable],
    provenance: "Provenance",
    figures: Sequence[str] = (),
) -> str:
    """Return a page in Markdown: its title, paragraphs, figures at places from it, and tables."""
    shown = [f"![{name}]({name})" for name in figures]
    shown += [to_markdown(table).rstrip() for table in tables]
    return "\n\n".join([f"# {paragraphs[0]}", *paragraphs[1:], *shown, provenance.line()]) + "\n"


def to_rich(table: TextTable) -> "RichTable":
    """Return a table for the terminal; brackets in a cell are no markup."""
    from rich.table import Table
    from rich.text import Text

    shown = Table(
        title=Text(table.title, "table.title"),
        caption=Text(table.note, "table.caption") if table.note else None,
        title_justify="left",
    )
    for index, column in enumerate(table.columns):
        shown.add_column(Text(column), justify="left" if index == 0 else "right")
    for row in table.rows:
        shown.add_row(*map(Text, row))
    return shown
