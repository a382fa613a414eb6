"""Between a log and a recording: every field of a recording survives the way there and back."""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.recording import FloatArray, Recording
from rig.errors import DataError
from rig.log.devices import device_columns
from rig.log.reader import LogFile
from rig.log.run import CONFIG, SIMULATED, RunEnd, RunInfo
from rig.log.streams import SAMPLE, sample_stream
from rig.log.writer import LogWriter

SHARED = (
    *("name", "rig", "instrument", "conditions", "notes", "started_at_ns", "calibrations"),
    *("source", "excluded"),
)
"""What a recording and the metadata of a log hold under the same names."""


def log_times_ns(time_s: FloatArray, started_at_ns: int | None) -> NDArray[np.uint64]:
    """Return the log time of each sample: the start of the run plus the device's time.

    A run whose start is not known counts from its own zero, or from its first sample if that lies
    before it: MCAP has no times before the epoch. Both times are of shape (n,).

    Raises:
        DataError: A time lies before the epoch or too far from it.
    """
    if not time_s.size:
        return np.empty(0, np.uint64)
    if started_at_ns is None:
        time_s = time_s - min(float(time_s[0]), 0.0)
    base = started_at_ns or 0
    low, high = float(time_s.min()) * 1e9 + base, float(time_s.max()) * 1e9 + base
    if low < 0 or high > 9.2e18:
        raise DataError(
            "The run's times cannot be written as nanoseconds since 1970.",
            f"They span {float(time_s.min()):g} s to {float(time_s.max()):g} s from its start.",
            "Repair the clock where the data is imported.",
        )
    return (np.rint(time_s * 1e9).astype(np.int64) + base).astype(np.uint64)


def run_info(recording: Recording) -> RunInfo:
    """Return the metadata of a recording about its run."""
    shared = {name: getattr(recording, name) for name in SHARED}
    return RunInfo(**shared, details={SIMULATED: True} if recording.is_simulated else {})


def write_recording(path: Path, recording: Recording) -> Path:
    """Write a recording as a log; nothing is left behind if that fails.

    Raises:
        LogExistsError: There is a log at the path already.
        UnflaggedSampleError: A sample is not finite and not flagged.
        DataError: Metadata or times cannot be written.
    """
    rate_hz = recording.sample_rate_hz if len(recording) > 1 else None
    stream = sample_stream(tuple(recording.columns), rate_hz)
    log_time_ns = log_times_ns(recording.time_s, recording.started_at_ns)
    rows: dict[str, NDArray[np.generic]] = {
        "time_s": recording.time_s,
        **recording.columns,
        "sequence": np.arange(len(recording), dtype=np.uint32),
        "flags": recording.flags,
    }
    writer = LogWriter(path, run_info(recording), [stream])
    try:
        writer.add(*recording.marks, *recording.stretches)
        writer.write(SAMPLE, rows, log_time_ns)
        return writer.close(RunEnd(expected_samples={SAMPLE: len(recording)}))
    except BaseException:
        writer.discard()
        raise


def recording_from_log(log: LogFile) -> Recording:
    """Return the samples of a log as a recording, with the channels of further devices.

    A device's sample that is flagged flags the run's samples at its time.

    A run that did not end as planned has a remark in its notes. One whose log was not closed, or is
    damaged and was read tolerantly, is excluded from evidence, with the reason.

    Raises:
        DataError: The log has no samples in SI units, what is known about its run is lost, or it
            holds unknown flags.
        RecordingError: The samples' time does not increase.
    """
    if SAMPLE not in log.topics or log.run is None:
        raise DataError(
            f"{log.path} holds no run of the rig.",
            f"It has the topics {', '.join((*log.topics, *log.unread)) or 'none'}"
            f" and {'a' if log.run else 'no'} record of the run.",
            f"Run `rig log check {log.path}`.",
        )
    topic = log.topics[SAMPLE]
    if (topic.rows["flags"] > np.iinfo(np.uint8).max).any():
        raise DataError(
            f"{log.path} has flags that are unknown to this version.",
            "They must not be dropped: a flagged sample would pass for a valid one.",
            "Read the log with the version of rig that wrote it.",
        )
    channels = [f.name for f in topic.stream.fields if f.dtype == "float64" and f.name != "time_s"]
    run = log.run
    shared = {name: getattr(run, name) for name in SHARED} | {
        "notes": _notes(log, run),
        "source": run.source or str(log.path),
        "excluded": exclusion(log),
    }
    further, further_flags = device_columns(log)
    return Recording(
        time_s=topic.rows["time_s"],
        columns={**further, **{name: topic.rows[name] for name in channels}},
        flags=topic.rows["flags"].astype(np.uint8) | further_flags,
        marks=log.marks,
        stretches=log.stretches,
        is_simulated=bool(run.details.get(SIMULATED)) or _has_simulated_logger(log),
        **shared,
    )


def _has_simulated_logger(log: LogFile) -> bool:
    """Whether the configuration that a log carries is that of a simulated rig."""
    with suppress(ValueError, KeyError, TypeError):
        return str(json.loads(log.attached(CONFIG) or b"")["logger"]["url"]).startswith("sim:")
    return False


def exclusion(log: LogFile) -> str | None:
    """Return why the run of a log is left out of evidence, or None when it counts."""
    if log.damage or log.end is None:
        what = log.damage[0].what if log.damage else "the recorder did not close the log"
        return f"{log.path.name}: {what}; run `rig log repair`"
    if log.end.excluded is not None:
        return log.end.excluded
    return log.run.excluded if log.run else None


def _notes(log: LogFile, run: RunInfo) -> str:
    if log.end is None or log.end.clean:
        return run.notes
    return f"{run.notes}\nThe run did not end as planned: {log.end.reason}".lstrip("\n")
