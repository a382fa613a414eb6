"""One thing that was looked at, and what came of it."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How a finding is to be taken."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding.

    Attributes:
        subject: What was looked at: a device, a port, the computer.
        check: What was looked for.
        level: Whether it is in order.
        what: What was found, with numbers.
        fix: What to do or to type; empty where nothing is to be done.
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
