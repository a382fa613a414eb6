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
    """One finding."""

    subject: str  # subject of the check: a device, a port, the computer
    check: str
    level: Level
    what: str  # finding, with numbers
    fix: str = ""  # action or next command; empty if none is needed


def worst(findings: Iterable[Finding]) -> Level:
    """Return the gravest level of some findings, `OK` for none."""
    order = list(Level)
    return max((finding.level for finding in findings), key=order.index, default=Level.OK)
