"""Repair: what is readable of a damaged log, in a new file. The original is never touched."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rig.errors import DataError, UsageError
from rig.log.check import LogReport, Verdict, report_on, written_by_rig
from rig.log.container import LIBRARY
from rig.log.reader import LogFile, read_log
from rig.log.run import RunEnd, RunInfo
from rig.log.writer import PART_SUFFIX, LogWriter

REPAIR_RECORD = "rig.repair"


class RepairError(DataError):
    """The log cannot be repaired."""


@dataclass(frozen=True)
class RepairReport:
    """Result of a repair."""

    original: Path
    # the new log, read back and equal to what was recovered; None when there was nothing to repair
    repaired: Path | None
    recovered: dict[str, int]  # topic to the samples recovered
    # topic to the samples known to be lost, from sequence numbers, plan and recorder
    lost: dict[str, int]
    salvaged: dict[str, int]  # topic to those of the recovered samples that no checksum vouches for
    problems: tuple[str, ...]  # faults of the original, in words


def repaired_path(path: Path) -> Path:
    """Return the path of the repaired log: `NAME.repaired.mcap` in the same folder."""
    name = path.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")
    return path.with_name(f"{name}.repaired.mcap")


def repaired_from(log: LogFile) -> Path | None:
    """Return the original of a repaired log in the same folder; None if it is not a repair."""
    originals = [data["original"] for name, data in log.metadata if name == REPAIR_RECORD]
    return log.path.with_name(originals[-1]) if originals else None


def repair_log(path: Path, out: Path | None = None) -> RepairReport:
    """Write what is readable of a log to a new file and read that back.

    A log that is not damaged is left alone; samples that were never recorded cannot be repaired.

    The new file is `out`, or `repaired_path` when that is None.

    Raises:
        RepairError: Nothing is readable, or the log is not one of ours.
        LogExistsError: There is a file at `out` already.
        NotALogError: The file is not MCAP.
    """
    log = read_log(path, tolerant=True)
    report = report_on(log)
    recovered = {name: len(topic) for name, topic in log.topics.items()}
    lost = {topic.topic: topic.expected - topic.received for topic in report.topics}
    result = RepairReport(path, None, recovered, lost, dict(log.salvaged), report.problems)
    if report.verdict is not Verdict.DAMAGED:
        return result
    if not log.topics or (log.unread and not written_by_rig(log)):
        raise RepairError(
            f"{path} contains nothing that can be repaired.",
            f"Its topics are: {', '.join(log.unread) or 'none'}; repair supports messages of fixed"
            f" size as {LIBRARY} writes them.",
        )
    target = out or repaired_path(path)
    if target.resolve() == path.resolve():
        raise UsageError("A repair never overwrites the original.", fix="Name another file.")
    _write(log, report, target)
    _verify(log, target)
    return replace(result, repaired=target)


def _write(log: LogFile, report: LogReport, target: Path) -> None:
    name = repaired_path(log.path).name.removesuffix(".repaired.mcap")
    run = log.run or RunInfo(name, notes="What was known about the run is lost.")
    reason = f"repaired: {report.problems[0]}"
    end = replace(log.end or RunEnd(), clean=False, reason=reason)
    streams = [topic.stream for topic in log.topics.values()]
    writer = LogWriter(target, run, streams, attachments=log.attachments)
    try:
        writer.add(*log.marks, *log.stretches)
        for record_name, data in log.metadata:
            writer.add_metadata(record_name, data)
        writer.add_metadata(
            REPAIR_RECORD, {"original": log.path.name, "problems": "\n".join(report.problems)}
        )
        for topic_name, topic in log.topics.items():
            writer.write(topic_name, topic.rows, topic.log_time_ns)
        writer.close(end)
    except BaseException:
        writer.discard()
        raise


def _verify(log: LogFile, target: Path) -> None:
    """Read the new log and compare it with the recovered data."""
    again = read_log(target)
    for name, topic in log.topics.items():
        copy = again.topics[name]
        same = copy.rows.tobytes() == topic.rows.tobytes()
        if not same or not np.array_equal(copy.log_time_ns, topic.log_time_ns):
            target.unlink()
            raise RepairError(f"{target} did not read back as it was written, and was deleted.")
