"""A log of what a session reads: samples, raw counts, further devices, commands to the board."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import rising
from rig import __version__
from rig.bench.companions import Beside
from rig.bench.session import Session
from rig.log.container import Attached
from rig.log.devices import topic_of
from rig.log.recalibrate import ATTACHMENT, ZERO_SUFFIX
from rig.log.run import CONFIG, RunInfo
from rig.log.streams import COUNTS, FLIGHT, FLIGHT_STREAM, SAMPLE, sample_stream
from rig.log.writer import LogWriter
from rig.machines.reading import Reading


class SessionLog(LogWriter):
    """A log of readings; its clock `time_s` begins with the first one that is written.

    The log carries the session's configuration and calibrations. The run states what is known
    beyond the session, its start too; readings have the further columns in addition to those of
    the session.
    """

    def __init__(
        self,
        session: Session,
        path: Path,
        run: RunInfo,
        *,
        further: Sequence[str] = (),
    ) -> None:
        config, calibrations = session.config, session.calibrations
        settings = json.dumps(config.logged(), indent=1).encode()
        streams = [
            sample_stream((*calibrations.channels, *further), session.raw.rate_hz),
            session.raw,
            *(companion.stream() for companion in session.companions),
            *([FLIGHT_STREAM] if session.flight else []),
        ]
        super().__init__(
            path,
            replace(
                run,
                rig=config.name,
                instrument=config.instrument.identity(),
                calibrations={calibrations.name: calibrations.content_hash},
                details={"rig_version": __version__, **session.board, **run.details},
            ),
            streams,
            attachments=[
                Attached(CONFIG, "application/json", settings),
                Attached(ATTACHMENT, "application/json", calibrations.to_json().encode()),
            ],
        )
        self._session = session
        self._start_us: int | None = None
        self._newest_ns = self._start_ns = run.started_at_ns or 0
        self.newest_s = 0.0
        """Time of the newest sample, s, on the run's clock."""
        self._flown = 0
        self._least_s = {topic_of(c.name): 0.5 / c.rate_hz for c in session.companions}
        self._beside_s: dict[str, float] = {}

    def write_reading(self, reading: Reading) -> None:
        """Write a reading to both streams, with the run's own clock in `time_s`."""
        if self._start_us is None:
            self._start_us = int(reading.tick_us[0])
        since_us = reading.tick_us - self._start_us
        log_time_ns = self._start_ns + since_us * 1000
        own = {
            "time_s": since_us * 1e-6,
            "sequence": reading.counts["sequence"],
            "flags": reading.flags,
        }
        self.write(SAMPLE, {**reading.columns, **own}, log_time_ns)
        counts = {field.name: reading.counts[field.name] for field in self._session.raw.fields}
        self.write(COUNTS, counts, log_time_ns)
        self._newest_ns, self.newest_s = int(log_time_ns[-1]), float(since_us[-1]) * 1e-6

    def write_beside(self, blocks: Mapping[str, Beside]) -> None:
        """Write what further devices measured since the run began, on the logger's clock.

        The blocks are samples of each by the topic of its stream. Both clocks' lines are fitted
        again all the time; times increase all the same.
        """
        start_us = self._start_us or 0
        for topic, block in blocks.items():
            if not block.host_s.size:
                continue
            tick_s = self._session.clock.line.to_device(block.host_s)
            tick_s = rising(tick_s, self._beside_s.get(topic, -np.inf), self._least_s[topic])
            self._beside_s[topic] = float(tick_s[-1])
            time_s = tick_s - start_us * 1e-6
            of_run = time_s >= 0  # what came before the run began is not of it
            rows: dict[str, NDArray[Any]] = {**block.columns, "sequence": block.sequence}
            rows |= {"flags": block.flags, "time_s": time_s}
            kept = {name: values[of_run] for name, values in rows.items()}
            log_time_ns = self._start_ns - start_us * 1000 + np.round(tick_s * 1e9).astype(np.int64)
            self.write(topic, kept, log_time_ns[of_run])

    def write_flight(self) -> None:
        """Write what was sent to the board since the session began and is not in the log yet."""
        if self._session.flight is None:
            return
        rows, self._flown = self._session.flight.rows(self._flown)
        if len(rows):
            self.write(FLIGHT, rows, np.full(len(rows), self._newest_ns))


def mean_counts(zeros: Mapping[str, float]) -> dict[str, float]:
    """Return measured zeros as a log keeps them."""
    return {f"{name}{ZERO_SUFFIX}": zero for name, zero in zeros.items()}
