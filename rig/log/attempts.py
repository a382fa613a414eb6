"""Which logs of a folder stand for its runs, where runs were tried again and logs repaired."""

from collections.abc import Sequence
from pathlib import Path

from rig.log.reader import LogFile
from rig.log.repair import repaired_from
from rig.log.writer import PART_SUFFIX

SET_ASIDE = ".aborted-"
"""Stands before the number of an attempt that was set aside, in the name of its log."""


def standing(heads: Sequence[LogFile]) -> list[LogFile]:
    """Return the logs that stand for their runs, in the order given.

    A repaired log stands in for the file it was made from. Of the attempts at a run those that
    ended as planned stand, else the last one; one that was set aside stands only where no other
    ended as planned. A log that does not name its run stands for itself.
    """
    repaired = {original for log in heads if (original := repaired_from(log)) is not None}
    attempts: dict[tuple[Path, str], list[LogFile]] = {}
    for log in heads:
        if log.path not in repaired:
            attempts.setdefault((log.path.parent, run_name(log)), []).append(log)
    kept: set[Path] = set()
    for same in attempts.values():
        planned = [log for log in same if not is_unfinished(log) and log.end and log.end.clean]
        current = [log for log in planned if SET_ASIDE not in log.path.name]
        last = sorted(planned or same, key=started_ns)[-1:]
        kept.update(log.path for log in current or last)
    return [log for log in heads if log.path in kept]


def started_ns(log: LogFile) -> int:
    """Return when a log's run was started, ns; 0 where that is not recorded."""
    return (log.run.started_at_ns or 0) if log.run else 0


def run_name(log: LogFile) -> str:
    """Return the name of a log's run, of the file where that is lost."""
    return log.run.name if log.run else log.path.name


def is_unfinished(log: LogFile) -> bool:
    """Whether its recorder did not finish the log."""
    return log.end is None or log.path.suffix == PART_SUFFIX
