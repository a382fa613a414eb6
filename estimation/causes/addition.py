"""What a cause adds to one equation when the equation is refitted with it."""

from collections.abc import Callable
from dataclasses import dataclass

from estimation.model import Term
from estimation.recording import FloatArray

Unwritten = Callable[[str, FloatArray], FloatArray]
"""Name of a run and times in it to the columns of a cause that no model file holds, (n, k)."""


@dataclass(frozen=True)
class Addition:
    """What one cause adds to an equation: a term of its model, or columns that no file can hold.

    Attributes:
        term: The term, or None.
        acts: Names of the runs in which the term acts; in all when None.
        unwritten: The columns if the term is None.
        precision: Prior precision of an amplitude of these, in units of the inverse squared column.
        is_change: Whether the term is a declared one whose factor differs, to either side.
    """

    term: Term | None = None
    acts: frozenset[str] | None = None
    unwritten: Unwritten | None = None
    precision: float = 0.0
    is_change: bool = False

    @property
    def is_written(self) -> bool:
        """Whether a model file holds it."""
        return self.term is not None and self.acts is None
