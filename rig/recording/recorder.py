"""Recording what the live display shows: one log from one key to the next."""

import time
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

from estimation.recording import Mark
from rig.bench.companions import Beside
from rig.bench.session import Session
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS, SAMPLE
from rig.machines.reading import Reading
from rig.recording.session_log import SessionLog, mean_counts


class LiveRecorder:
    """Writes readings of a session to a log while it is on.

    A log is named after the kind of what is recorded. Readings have the further columns in addition
    to those of the session.
    """

    def __init__(
        self, session: Session, folder: Path, kind: str = "live", further: Sequence[str] = ()
    ) -> None:
        self._session = session
        self._folder = folder
        self._kind = kind
        self._further = tuple(further)
        self._log: SessionLog | None = None
        self.path: Path | None = None
        """The newest log, None before the first."""
        self._samples = 0
        self._marks = 0

    @property
    def is_on(self) -> bool:
        """Whether a log is open."""
        return self._log is not None

    @property
    def said(self) -> str:
        """Message for the user; empty before the first recording."""
        if self.path is None:
            return ""
        words = f"{self.path.name}, {self._samples} samples, {self._marks} marks"
        return words if self.is_on else f"kept {words}"

    def start(self) -> None:
        """Open a new log; its clock begins with the next reading."""
        self._folder.mkdir(parents=True, exist_ok=True)
        name = f"{self._kind}-{datetime.now():%Y-%m-%d-%H%M%S}"
        number = len(list(self._folder.glob(f"{name}*")))
        self.path = self._folder / (f"{name}-{number}.mcap" if number else f"{name}.mcap")
        info = RunInfo(
            name=self.path.stem,
            conditions={"trajectory": self._kind},
            started_at_ns=time.time_ns(),
            zeros_before=mean_counts(self._session.zeros),
        )
        self._log = SessionLog(self._session, self.path, info, further=self._further)
        self._samples = self._marks = 0

    def write(self, reading: Reading, beside: Mapping[str, Beside]) -> None:
        """Write a reading and the samples of further devices by topic, if a log is open."""
        if self._log is None:
            return
        self._log.write_reading(reading)
        self._log.write_beside(beside)
        self._log.write_flight()
        self._samples += len(reading)

    def mark(self) -> None:
        """Mark the newest sample, if a log is open."""
        if self._log is not None:
            self._marks += 1
            self._log.add(Mark(self._log.newest_s, f"mark {self._marks}"))

    def stop(self) -> None:
        """Close the log, if one is open."""
        if self._log is not None:
            log, self._log = self._log, None
            log.close(RunEnd(expected_samples=dict.fromkeys((SAMPLE, COUNTS), self._samples)))
