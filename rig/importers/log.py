"""Opens our own logs: a `.mcap` file, the `.part` of a killed recorder, or a folder of both."""

from dataclasses import dataclass, replace
from pathlib import Path

from estimation.campaign import Campaign, Run
from estimation.recording import Recording
from rig.errors import DataError
from rig.log.check import logs_in, looks_like_log
from rig.log.convert import exclusion, recording_from_log
from rig.log.reader import LogFile, damaged, read_log
from rig.log.repair import repaired_path
from rig.log.streams import SAMPLE
from rig.log.writer import PART_SUFFIX


@dataclass(frozen=True)
class LogImporter:
    """Importer of logs written by rig.

    A folder without logs of its own stands for the campaigns in its folders; their runs are then
    named after both, `round-2/003-sine`.

    In a folder the runs stand in the order they were started, those without a recorded start by
    file name before them. A repaired log stands in for its original. A log whose recorder did not
    close it is opened too, excluded from evidence with the reason. Where a run was tried again, its
    earlier attempts are left out: a log that ended as planned stands for all of that run's logs
    that did not, and where none did, the last one stands.
    """

    name: str = "log"
    description: str = "logs of this rig (MCAP): a file or a folder of them"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a log or a folder with at least one."""
        return any(looks_like_log(item) for item in _logs(path))

    def open(self, path: Path) -> Campaign:
        """Open logs as a campaign; samples are read when a run is.

        Raises:
            DataError: No log was found, or one of them is damaged beyond its unfinished end.
        """
        paths = [item for item in _logs(path) if not repaired_path(item).exists()]
        if not paths:
            raise DataError(
                f"There is no log in {path}.",
                "Looked for files named NAME.mcap and NAME.mcap.part.",
            )
        heads = [_head(item) for item in paths]
        heads.sort(key=lambda log: (log.run.started_at_ns or 0) if log.run else 0)
        several = len({log.path.parent for log in heads}) > 1
        return Campaign(tuple(_run(log, several) for log in _last_attempts(heads)))


def _logs(path: Path) -> list[Path]:
    """Return the logs of a folder, else those of the folders in it."""
    own = logs_in(path)
    if own or not path.is_dir():
        return own
    return [
        item for folder in sorted(path.iterdir()) if folder.is_dir() for item in logs_in(folder)
    ]


def _head(path: Path) -> LogFile:
    """Read what is known about a log without its samples."""
    log = read_log(path, topics=(), tolerant=True, checksums=False)
    if log.run is None:
        raise DataError(
            f"{path} does not name its run.",
            "The record of the run is missing: the file is damaged, or not written by rig.",
            f"Run `rig log check {path}`.",
        )
    if log.damage and not _unfinished(log):
        raise damaged(log)
    return log


def _last_attempts(heads: list[LogFile]) -> list[LogFile]:
    """Leave out the logs of runs that were tried again."""
    attempts: dict[tuple[Path, str], list[LogFile]] = {}
    for log in heads:
        attempts.setdefault((log.path.parent, _name(log)), []).append(log)
    kept = []
    for same in attempts.values():
        planned = [log for log in same if not _unfinished(log) and log.end and log.end.clean]
        kept += planned or same[-1:]
    return [log for log in heads if log in kept]


def _name(log: LogFile) -> str:
    return log.run.name if log.run else log.path.stem


def _unfinished(log: LogFile) -> bool:
    """Whether its recorder did not finish the log."""
    return log.end is None or log.path.suffix == PART_SUFFIX


def _run(head: LogFile, several: bool) -> Run:
    path = head.path
    unfinished = _unfinished(head)
    name = f"{path.parent.name}/{_name(head)}" if several else _name(head)

    def load() -> Recording:
        topics = None if unfinished else (SAMPLE,)
        recording = recording_from_log(read_log(path, topics, tolerant=unfinished))
        return replace(recording, name=name) if several else recording

    return Run(name, load=load, source=path, excluded=exclusion(head))


IMPORTER = LogImporter()
