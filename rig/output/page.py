"""A result as people read it: sentences, tables and figures, in a terminal and as Markdown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path

from estimation.files import write_text_atomic
from rig.output.console import present, results, show
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page


@dataclass(frozen=True)
class Page:
    """A page of a result."""

    title: str
    paragraphs: Sequence[str]  # the result in a few sentences, then remarks for a comparison
    tables: Sequence[TextTable]
    provenance: Provenance
    figures: Callable[[], Mapping[str, str]] = dict  # draws the figures, by the name of their file

    def markdown(self, places: Sequence[str] = ()) -> str:
        """Return the page as Markdown, with its figures at places relative to it."""
        return to_page([self.title, *self.paragraphs], self.tables, self.provenance, places)

    def show(self, data: object, out: Path | None, json: bool, figures: Path | None = None) -> None:
        """Print the page, and write its figures and its Markdown where they are asked for.

        With `json` the data goes to stdout. A file that cannot be written is an OutputError.
        """
        drawn: list[Path] = []
        if figures is not None:
            from rig.output.figures import write_svgs

            drawn = write_svgs(figures, self.figures())
        screen = results(json)
        show(screen, *self.paragraphs, *self.tables)
        if out is not None:
            places = [relpath(path, out.parent) for path in drawn]
            write_text_atomic(out, self.markdown(places))
            screen.print(f"Markdown: {out}")
        present(json, data)
