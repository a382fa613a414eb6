"""Opens our own logs: a `.mcap` file, the `.part` of a killed recorder, or a folder of both."""

from dataclasses import replace
from pathlib import Path

from estimation.campaign import Campaign, Run
from estimation.recording import Recording
from rig.errors import DataError
from rig.importers.registry import unreadable
from rig.log.attempts import is_unfinished, run_name, standing, started_ns
from rig.log.check import logs_in, looks_like_log
from rig.log.convert import exclusion, recording_from_log
from rig.log.devices import device_topics
from rig.log.reader import LogFile, damaged, read_head, read_log
from rig.log.streams import SAMPLE


class LogImporter:
    """Importer of logs written by rig.

    A folder without logs of its own stands for the campaigns in its folders; their runs are then
    named after both, `round-2/003-sine`.

    In a folder the runs stand in the order they were started, those without a recorded start by
    file name before them; of several attempts at a run, and of a log and its repair, only the one
    that is `standing`. A log whose recorder did not close it is opened too, excluded from evidence
    with the reason.
    """

    name = "log"
    description = "logs of this rig (MCAP): a file or a folder of them"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a log or a folder with at least one."""
        return any(looks_like_log(item) for item in _logs(path))

    def open(self, path: Path) -> Campaign:
        """Open logs as a campaign; samples are read when a run is.

        Of several logs, one that is damaged beyond its unfinished end is a run that cannot be read.

        Raises:
            DataError: No log was found, or none of them can be read.
        """
        paths = _logs(path)
        if not paths:
            raise DataError(
                f"There is no log in {path}.",
                "Looked for files named NAME.mcap and NAME.mcap.part.",
            )
        read, bad = [], []
        for item in paths:
            try:
                read.append(_sound(read_head(item)))
            except DataError as error:
                bad.append(unreadable(f"{item.parent.name}/{item.name}", error, item))
        if not read:
            bad[0].recording()  # raises
        heads = sorted(standing(read), key=started_ns)
        several = len({log.path.parent for log in heads}) > 1
        return Campaign((*(_run(log, several) for log in heads), *bad))


def _logs(path: Path) -> list[Path]:
    """Return the logs of a folder, else those of the folders in it."""
    own = logs_in(path)
    if own or not path.is_dir():
        return own
    return [
        item for folder in sorted(path.iterdir()) if folder.is_dir() for item in logs_in(folder)
    ]


def _sound(log: LogFile) -> LogFile:
    """Return the head of a log, or refuse one that is damaged beyond its unfinished end."""
    if log.run is None:
        raise DataError(
            f"{log.path} does not name its run.",
            "The record of the run is missing: the file is damaged, or not written by rig.",
            f"Run `rig log check {log.path}`.",
        )
    if log.damage and not is_unfinished(log):
        raise damaged(log)
    return log


def _run(head: LogFile, several: bool) -> Run:
    path = head.path
    unfinished = is_unfinished(head)
    name = f"{path.parent.name}/{run_name(head)}" if several else run_name(head)

    def load() -> Recording:
        topics = None if unfinished else (SAMPLE, *device_topics(head))
        recording = recording_from_log(read_log(path, topics, tolerant=unfinished))
        return replace(recording, name=name) if several else recording

    return Run(name, load=load, source=path, excluded=exclusion(head))


IMPORTER = LogImporter()
