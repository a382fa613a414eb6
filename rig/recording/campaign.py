"""Record a campaign: every run of a protocol as one log, zeros before and after, abortable.

A run goes: zero at rest, approach, the run itself (the only part that is logged), release, zero at
rest. Each run's log is complete in itself, so an aborted campaign resumes at the first run that
has no log.
"""

import hashlib
import itertools
import json
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from calibration.zero import Drift, drift_verdicts
from estimation.files import write_text_atomic
from rig.bench.holding import holder, holding
from rig.bench.session import Session
from rig.configuration.config import Config
from rig.errors import SafetyTripError, UsageError
from rig.log.attempts import SET_ASIDE
from rig.log.reader import read_head, read_log
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS, SAMPLE
from rig.log.writer import PART_SUFFIX
from rig.machines.choose import machine_of
from rig.machines.reading import Reading
from rig.protocols.motion import Motion
from rig.protocols.protocol import Plan, Protocol
from rig.recording.session_log import SessionLog, mean_counts

MANIFEST = "campaign.json"

REST_S = 0.5
BYTES_PER_SAMPLE = 400
"""Upper bound of a sample's room on disk, both streams, before compression."""

Progress = Callable[[str, int, int], None]
"""Called with the run's name, the samples recorded of it, and how many it will have."""


@dataclass(frozen=True)
class RunResult:
    """Outcome of one run."""

    name: str
    path: Path
    samples: int
    expected: int  # samples the plan asked for
    lost: int  # samples lost on the way from the logger
    drift: tuple[Drift, ...]  # zero before against zero after, for each judged sensor

    @property
    def complete(self) -> bool:
        """Whether every planned sample is there."""
        return self.samples == self.expected

    @property
    def remark(self) -> str:
        """Message about the run; empty when it went as planned."""
        remarks = []
        if not self.complete:
            remarks.append(f"{self.samples} of {self.expected} samples, {self.lost} lost")
        remarks += [
            f"zero of {d.channel} moved by {d.after - d.before:+.4g} {d.unit}, limit {d.limit:g}"
            for d in self.drift
            if not d.passes
        ]
        return "; ".join(remarks)

    @property
    def drifted(self) -> tuple[str, ...]:
        """Channels whose zero moved beyond its limit."""
        return tuple(d.channel for d in self.drift if not d.passes)


def check_disk_space(folder: Path, plans: Iterable[Plan]) -> None:
    """Refuse to begin what the disk cannot hold (UsageError)."""
    needed = sum(plan.samples for plan in plans) * BYTES_PER_SAMPLE
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise UsageError(
            f"The campaign may need {needed / 1e6:.0f} MB, {free / 1e6:.0f} MB are free.",
            f"It would be written to {folder}.",
            "Free some space, or name another folder with --out.",
        )


def read_manifest(folder: Path) -> tuple[Protocol, Config]:
    """Return protocol and configuration a campaign was begun with; UsageError of no campaign."""
    manifest = folder / MANIFEST
    try:
        described = json.loads(manifest.read_text())
        return (
            Protocol.model_validate(described["protocol"]),
            Config.model_validate(described["config"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(
            f"{folder} holds no campaign that could go on.",
            f"{manifest.name}: {error}",
            "Name the folder that `rig record` made.",
        ) from error


def open_campaign_folder(
    folder: Path, protocol: Protocol, config: Config, resume: bool
) -> list[Plan]:
    """Prepare a campaign's folder and return the runs that are still to be made.

    Raises:
        UsageError: A run is beyond a limit or for another kind of rig, the folder cannot be made,
            another program records into it, it is in use and `resume` was not asked for, or what
            is in it was recorded with another protocol or configuration.
    """
    if holder(str(folder.resolve())) is not None:
        raise _is_recorded_into(folder)
    plans = protocol.any_plans()
    machine_of(config).require_within_limits(config, plans)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{folder} cannot be made a folder for a campaign.",
            error.strerror or "",
            "Name another folder with --out.",
        ) from error
    manifest = folder / MANIFEST
    whole = json.dumps(config.model_dump(), sort_keys=True).encode()
    described = {
        "protocol": protocol.model_dump(),
        "config": config.logged(),
        "config_sha256": hashlib.sha256(whole).hexdigest(),
    }
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
        raise UsageError(
            f"{folder} is not empty and holds no campaign.", fix="Name another folder."
        )
    else:
        write_text_atomic(manifest, json.dumps(described, indent=1) + "\n")
    check_disk_space(folder, plans)
    return [plan for plan in plans if not _is_recorded(_log_path(folder, plan))]


def record_campaign(
    session: Session,
    plans: Iterable[Plan],
    folder: Path,
    notes: str = "",
    on_progress: Progress | None = None,
) -> Iterator[RunResult]:
    """Record runs one after the other; yields each as soon as its log is complete.

    The session is open, the notes are the operator's and stored in every log, and `on_progress` is
    called as the samples come.

    Raises:
        UsageError: Another program records into the folder.
    """
    with holding(str(folder.resolve())) as is_held:
        if not is_held:
            raise _is_recorded_into(folder)
        for _ in session.rest(REST_S):
            pass
        session.settle()
        epoch_ns = _epoch_ns(session, folder)
        for plan in plans:
            path = _log_path(folder, plan)
            if not _is_recorded(path):  # else by a program that ended since the runs were listed
                yield _record_run(session, plan, path, epoch_ns, notes, on_progress)


def _is_recorded_into(folder: Path) -> UsageError:
    number = holder(str(folder.resolve()))
    return UsageError(
        f"{'Another process' if number is None else f'Process {number}'} records into {folder}.",
        "Two recordings into one folder would take each other's logs for aborted ones.",
        "Wait until it has ended, or name another folder with --out.",
    )


def _record_run(
    session: Session,
    plan: Plan,
    path: Path,
    epoch_ns: int,
    notes: str,
    on_progress: Progress | None,
) -> RunResult:
    before = session.take_zeros(REST_S)
    motion = session.machine.motion(plan, session.here)
    expected = motion.last - motion.first
    lost_before = session.counters["lost"]
    samples = 0
    readings = session.play(*motion.setpoints)
    first = next(r for r in readings if len(_of_run(r, motion)))
    run_start_us = int(_of_run(first, motion).tick_us[0])
    info = RunInfo(
        name=plan.name,
        conditions=plan.conditions,
        notes=notes,
        started_at_ns=epoch_ns + run_start_us * 1000,
        duration_s=plan.duration_s,
        zeros_before=mean_counts(before),
        details=_clock_residuals(session),
    )
    _set_aside(path)
    with (
        SessionLog(session, path, info) as log,
        _crossing_in(log, session, run_start_us),
    ):
        for reading in itertools.chain([first], readings):
            run = _of_run(reading, motion)
            beside = session.take_beside()
            if len(run):
                log.write_reading(run)
                log.write_beside(beside)
                samples += len(run)
                if on_progress:
                    on_progress(plan.name, samples, expected)
            log.write_flight()
            log.poll()
        after = session.take_zeros(REST_S)
        drift = drift_verdicts(before, after, session.calibrations, session.config.drift_limits)
        lost = session.counters["lost"] - lost_before
        result = RunResult(plan.name, path, samples, expected, lost, tuple(drift))
        end = RunEnd(
            expected_samples=dict.fromkeys((SAMPLE, COUNTS), expected),
            counters=session.counters,
            zeros_after=mean_counts(after),
            drift={d.channel: d.after - d.before for d in drift},
            drift_verdict=f"drifted: {', '.join(result.drifted)}" if result.drifted else "steady",
        )
        log.close(end)
    return result


@contextmanager
def _crossing_in(log: SessionLog, session: Session, run_start_us: int) -> Iterator[None]:
    """Write the samples in which a limit was crossed, too: they end the run."""
    try:
        yield
    except SafetyTripError:
        newest = session.newest
        if newest is not None and newest.tick_us[0] > run_start_us:
            log.write_reading(newest)
            log.write_beside(session.take_beside())
            log.write_flight()
        raise


def _of_run(reading: Reading, motion: Motion) -> Reading:
    """Return the samples that belong to the run itself, not to its approach or release."""
    return reading.where((reading.setpoint >= motion.first) & (reading.setpoint < motion.last))


def _clock_residuals(session: Session) -> dict[str, str]:
    """Return how well each device's clock is known, as a log keeps it, s."""
    lines = {companion.name: companion.line for companion in session.companions}
    known = {name: line for name, line in lines.items() if line is not None}
    known["logger"] = session.clock.line
    return {f"clock_residual_s_{name}": f"{one.residual_s:.3g}" for name, one in known.items()}


def _log_path(folder: Path, plan: Plan) -> Path:
    return folder / f"{plan.name}.mcap"


def _is_recorded(path: Path) -> bool:
    """Whether a run was completed; an aborted run is repeated."""
    if not path.exists():
        return False
    end = read_head(path).end
    return end is not None and end.clean


def _set_aside(path: Path) -> None:
    """Rename what an aborted attempt left: the run can be made again and nothing is lost."""
    for ending in (".mcap", ".mcap" + PART_SUFFIX):
        left = path.with_name(path.stem + ending)
        attempts = itertools.count(1)
        while left.exists():
            aside = path.with_name(f"{path.stem}{SET_ASIDE}{next(attempts)}{ending}")
            if not aside.exists():
                left.rename(aside)


def _epoch_ns(session: Session, folder: Path) -> int:
    """Return the host's time at the device's tick 0, ns since the Unix epoch.

    A simulated rig is faster than real time, so a resumed campaign could begin before the last run
    ended: it begins a second after what is there instead.
    """
    now_ns = time.time_ns() - session.newest_tick_us * 1000
    return max([now_ns, *(_end_ns(path) + 1_000_000_000 for path in folder.glob("*.mcap"))])


def _end_ns(path: Path) -> int:
    """Return when a recorded run ended, ns since the Unix epoch; 0 when it is not in the log."""
    run = read_log(path, topics=(), checksums=False).run
    if run is None or run.started_at_ns is None or run.duration_s is None:
        return 0
    return run.started_at_ns + round(run.duration_s * 1e9)
