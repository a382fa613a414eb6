"""Record a campaign: every run of a protocol as one log, zeros before and after, abortable.

A run goes: zero at rest, approach, the run itself (the only part that is logged), release, zero at
rest. Each run's log is complete in itself, so an aborted campaign resumes at the first run that
has no log.
"""

import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from calibration.zero import Drift, SensorZero, drift_verdicts, measure_zeros
from rig import __version__, trajectory
from rig.config import Config
from rig.errors import UsageError
from rig.files import write_text_atomic
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS, SAMPLE, counts_block, sample_block, sample_stream
from rig.log.writer import LogWriter
from rig.protocol import Protocol, RunPlan
from rig.session import Reading, Session

MANIFEST = "campaign.json"

REST_S = 0.5
APPROACH_SPEED_RAD_S = 0.8
LOAD_RAMP_S = 0.5

BYTES_PER_SAMPLE = 400
"""Upper bound of a sample's room on disk, both streams, before compression."""

Progress = Callable[[str, int, int], None]
"""Told the run's name, the samples recorded of it, and how many it will have."""


@dataclass(frozen=True)
class RunResult:
    """What became of one run.

    Attributes:
        name: Name of the run.
        path: Its log.
        samples: Samples recorded.
        expected: Samples the plan asked for.
        lost: Samples lost on the way from the logger.
        drift: Zero before against zero after, for each judged sensor.
    """

    name: str
    path: Path
    samples: int
    expected: int
    lost: int
    drift: tuple[Drift, ...]

    @property
    def complete(self) -> bool:
        """Whether every planned sample is there."""
        return self.samples == self.expected

    @property
    def drifted(self) -> tuple[str, ...]:
        """Channels whose zero moved beyond its limit."""
        return tuple(d.channel for d in self.drift if not d.passes)


def check_disk_space(folder: Path, plans: Iterable[RunPlan]) -> None:
    """Refuse to begin what the disk cannot hold.

    Raises:
        UsageError: Less is free than the campaign may need.
    """
    needed = sum(plan.target_angle_rad.size for plan in plans) * BYTES_PER_SAMPLE
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise UsageError(
            f"The campaign may need {needed / 1e6:.0f} MB, {free / 1e6:.0f} MB are free.",
            f"It would be written to {folder}.",
            "Free some space, or name another folder with --out.",
        )


def open_campaign_folder(
    folder: Path, protocol: Protocol, config: Config, resume: bool
) -> list[RunPlan]:
    """Prepare a campaign's folder and return the runs that are still to be made.

    Raises:
        UsageError: The folder is in use and `resume` was not asked for, or what is in it was
            recorded with another protocol or configuration.
    """
    folder.mkdir(parents=True, exist_ok=True)
    manifest = folder / MANIFEST
    described = {"protocol": protocol.model_dump(), "config": config.model_dump()}
    if manifest.exists():
        if not resume:
            raise UsageError(
                f"{folder} already holds a campaign.",
                "Nothing recorded is ever overwritten.",
                f"Type `rig record --resume {folder}`, or name another folder with --out.",
            )
        if json.loads(manifest.read_text()) != json.loads(json.dumps(described)):
            raise UsageError(
                f"The campaign in {folder} was begun with another protocol or configuration.",
                "Runs made in two ways are not one campaign.",
                "Record into another folder.",
            )
    elif any(folder.iterdir()):
        raise UsageError(f"{folder} is not empty and holds no campaign.", fix="Name another folder.")
    else:
        write_text_atomic(manifest, json.dumps(described, indent=1) + "\n")
    plans = protocol.plans()
    check_disk_space(folder, plans)
    return [plan for plan in plans if not _log_path(folder, plan).exists()]


def record_campaign(
    session: Session, plans: Iterable[RunPlan], folder: Path, on_progress: Progress | None = None
) -> Iterator[RunResult]:
    """Record runs one after the other; yields each as soon as its log is complete.

    Args:
        session: An open session.
        plans: The runs.
        folder: Where the logs go.
        on_progress: Told of the samples as they come.
    """
    clock = _session_clock(session, folder)
    for plan in plans:
        yield _record_run(session, plan, _log_path(folder, plan), clock, on_progress)


def _record_run(
    session: Session,
    plan: RunPlan,
    path: Path,
    epoch_ns: int,
    notes: str,
    on_progress: Progress | None,
) -> RunResult:
    before = session.take_zeros(REST_S)
    motion = motion_of(plan, session.spindle_angle_rad)
    expected = motion.last - motion.first
    lost_before = session.counters["lost"]
    samples = 0
    with _run_log(session, plan, path, before, notes) as log:
        for reading in session.play(motion.target_angle_rad, motion.load_command_a):
            run = reading.where(
                (reading.setpoint >= motion.first) & (reading.setpoint < motion.last)
            )
            if len(run):
                write_reading(log, run, epoch_ns)
                samples += len(run)
                if on_progress:
                    on_progress(plan.name, samples, expected)
        after = session.take_zeros(REST_S)
        drift = drift_verdicts(
            before, after, session.calibrations, session.config.drift.model_dump()
        )
        lost = session.counters["lost"] - lost_before
        result = RunResult(plan.name, path, samples, expected, lost, tuple(drift))
        log.close(_end_of_run(result, after, session.counters))
    return result


@contextmanager
def _run_log(
    session: Session, plan: RunPlan, path: Path, before: Mapping[str, SensorZero]
) -> Iterator[LogWriter]:
    config, calibrations = session.config, session.calibrations
    info = RunInfo(
        name=plan.name,
        rig=config.name,
        instrument=config.instrument.identity(),
        conditions=plan.conditions,
        duration_s=plan.duration_s,
        calibrations={calibrations.name: calibrations.content_hash},
        zeros_before={name: zero.mean_counts for name, zero in before.items()},
        details={
            "rig_version": __version__,
            "firmware_version": session.identity.firmware_version,
            "logger_serial": session.identity.serial,
        },
    )
    attachments = {
        "config.json": json.dumps(config.model_dump(), indent=1).encode(),
        "calibrations.json": calibrations.to_json().encode(),
    }
    streams = [sample_stream(tuple(calibrations.channels)), COUNTS_STREAM]
    with LogWriter(path, streams, info, attachments) as log:
        yield log
