"""Errors of the `estimation` package."""

import difflib
from collections.abc import Sequence


class ExplainedError(Exception):
    """An error that is raised on purpose; the rooms above derive theirs from it, too.

    Attributes:
        what: What happened, in one sentence.
        why: The cause as far as it is known; may be empty.
        fix: Action or next command; may be empty.
    """

    def __init__(self, what: str, why: str = "", fix: str = "") -> None:
        self.what = what
        self.why = why
        self.fix = fix
        super().__init__(" ".join(part for part in (what, why, fix) if part))


class EstimationError(ExplainedError):
    """Base of every error this room raises on purpose."""


class NeedsExtraError(ExplainedError):
    """A library that is needed here is not installed.

    Attributes:
        extra: The project's extra that holds it, a key of `optional-dependencies`.
    """

    def __init__(self, what: str, why: str, extra: str) -> None:
        self.extra = extra
        super().__init__(what, why, f"Install the project's extra {extra!r}.")


class MissingExtraError(NeedsExtraError, EstimationError):
    """A library that this room needs here is not installed."""


class UnknownNameError(EstimationError):
    """What was named does not exist: a slip of whoever typed it."""


def nearest(name: str, allowed: Sequence[str]) -> str:
    """Return a suggestion of the probable name; all names when none is near."""
    near = difflib.get_close_matches(name, allowed, n=1)
    return f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(allowed)}."
