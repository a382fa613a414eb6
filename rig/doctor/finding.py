"""One thing that was looked at, and what came of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """Severity of a finding."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding.

    Attributes:
        subject: Subject of the check: a device, a port, the computer.
        what: Finding, with numbers.
        fix: Action or next command; empty if none is needed.
    """

    subject: str
    check: str
    level: Level
    what: str
    fix: str = ""


def worst(findings: Iterable[Finding]) -> Level:
    """Return the gravest level of some findings, `OK` for none."""
    order = list(Level)
    return max((finding.level for finding in findings), key=order.index, default=Level.OK)
