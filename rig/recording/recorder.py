"""Recording what the live display shows: one log from one key to the next."""

import json
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from estimation.recording import Mark
from rig import __version__
from rig.bench.session import Session
from rig.log.container import Attached
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS, FLIGHT_STREAM, SAMPLE, sample_stream
from rig.log.writer import LogWriter
from rig.machines.reading import Reading
from rig.recording.flight import FlightStream


class LiveRecorder:
    """Writes readings of a session to a log while it is on.

    Args:
        session: The session.
        folder: Folder of the logs.
        kind: What is recorded; a log is named after it.
        further: Columns that readings have in addition to those of the session.
    """

    def __init__(
        self, session: Session, folder: Path, kind: str = "live", further: Sequence[str] = ()
    ) -> None:
        self._session = session
        self._folder = folder
        self._kind = kind
        self._further = tuple(further)
        self._log: LogWriter | None = None
        self._path: Path | None = None
        self._raw = session.raw
        self._start_us = 0
        self._start_ns = 0
        self._samples = 0
        self._marks = 0
        self._flight = FlightStream(session)
        self._newest_s = 0.0

    @property
    def is_on(self) -> bool:
        """Whether a log is open."""
        return self._log is not None

    @property
    def path(self) -> Path | None:
        """The newest log, None before the first."""
        return self._path

    @property
    def said(self) -> str:
        """Message for the user; empty before the first recording."""
        if self._path is None:
            return ""
        words = f"{self._path.name}, {self._samples} samples, {self._marks} marks"
        return words if self.is_on else f"kept {words}"

    def start(self) -> None:
        """Open a new log; its clock begins with the next reading."""
        session = self._session
        self._folder.mkdir(parents=True, exist_ok=True)
        name = f"{self._kind}-{datetime.now():%Y-%m-%d-%H%M%S}"
        number = len(list(self._folder.glob(f"{name}*")))
        self._path = self._folder / (f"{name}-{number}.mcap" if number else f"{name}.mcap")
        self._start_ns = time.time_ns()
        info = RunInfo(
            name=self._path.stem,
            rig=session.config.name,
            instrument=session.config.instrument.identity(),
            conditions={"trajectory": self._kind},
            started_at_ns=self._start_ns,
            calibrations={session.calibrations.name: session.calibrations.content_hash},
            zeros_before={f"{name}_counts": zero for name, zero in session.zeros.items()},
            details={"rig_version": __version__, **session.board},
        )
        settings = json.dumps(session.config.logged(), indent=1).encode()
        lines = session.calibrations.to_json().encode()
        attached = [
            Attached("config.json", "application/json", settings),
            Attached("calibrations.json", "application/json", lines),
        ]
        lines_of = (*session.calibrations.channels, *self._further)
        streams = [sample_stream(lines_of, self._raw.rate_hz), self._raw]
        streams += [FLIGHT_STREAM] if session.flight else []
        self._log = LogWriter(self._path, info, streams, attachments=attached)
        self._samples = self._marks = 0
        self._flight = FlightStream(session)

    def write(self, reading: Reading) -> None:
        """Write a reading, if a log is open."""
        if self._log is None:
            return
        if self._samples == 0:
            self._start_us = int(reading.tick_us[0])
        since_us = reading.tick_us - self._start_us
        log_time_ns = self._start_ns + since_us * 1000
        sequence = reading.counts["sequence"]
        time_s = since_us * 1e-6
        rows = {**reading.columns, "time_s": time_s, "sequence": sequence, "flags": reading.flags}
        self._log.write(SAMPLE, rows, log_time_ns)
        counts = {field.name: reading.counts[field.name] for field in self._raw.fields}
        self._log.write(COUNTS, counts, log_time_ns)
        self._flight.write(self._log, int(log_time_ns[0]))
        self._samples += len(reading)
        self._newest_s = float(time_s[-1])

    def mark(self) -> None:
        """Mark the newest sample, if a log is open."""
        if self._log is not None:
            self._marks += 1
            self._log.add(Mark(self._newest_s, f"mark {self._marks}"))

    def stop(self) -> None:
        """Close the log, if one is open."""
        if self._log is not None:
            log, self._log = self._log, None
            log.close(RunEnd(expected_samples=dict.fromkeys((SAMPLE, COUNTS), self._samples)))
