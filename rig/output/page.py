"""A result as people read it: sentences, tables and figures, in a terminal and as Markdown."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page


@dataclass(frozen=True)
class Page:
    """A page of a study.

    Attributes:
        title: Title of the Markdown.
        paragraphs: The result in a few sentences, then remarks for a comparison.
        tables: The tables, in order.
        provenance: When and from what the study was made.
        figures: Draws the figures, by the name of their file.
    """

    title: str
    paragraphs: Sequence[str]
    tables: Sequence[TextTable]
    provenance: Provenance
    figures: Callable[[], Mapping[str, Markup]] = dict

    def markdown(self, places: Sequence[str] = ()) -> str:
        """Return the page as Markdown, with its figures at places relative to it."""
        return to_page([self.title, *self.paragraphs], self.tables, self.provenance, places)
