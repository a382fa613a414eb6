"""Raw logs of a calibration: one log a step, in a folder that is there whole or not at all."""

import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.linear import CalibrationSet
from calibration.procedure import Measurement
from rig import __version__
from rig.errors import UsageError
from rig.log.check import logs_in
from rig.log.container import Attached
from rig.log.convert import log_times_ns, recording_from_log, run_info
from rig.log.reader import read_log
from rig.log.recalibrate import ATTACHMENT, carried_calibrations
from rig.log.run import RunEnd
from rig.log.streams import COUNTS, COUNTS_STREAM, SAMPLE, sample_stream
from rig.log.writer import PART_SUFFIX, LogWriter

KIND = "calibration"


def require_absent(folder: Path) -> None:
    """Refuse a folder that exists (UsageError)."""
    if folder.exists():
        raise UsageError(
            f"{folder} is there already.", "Nothing recorded is ever overwritten.", "Name another."
        )


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder to write to that gets its name when the block ends well, and is gone if not.

    Raises:
        UsageError: There is something of that name already.
    """
    require_absent(folder)
    part = folder.with_name(f".{folder.name}{PART_SUFFIX}")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        yield part
        part.rename(folder)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def write_raw(
    folder: Path, kind: str, measurements: Sequence[Measurement], lines: CalibrationSet
) -> list[Path]:
    """Write one log a measurement, in their order; returns the files."""
    return [
        _write(folder / f"{number:03d}-{measurement.recording.name}.mcap", kind, measurement, lines)
        for number, measurement in enumerate(measurements)
    ]


def read_raw(folder: Path) -> tuple[str, list[Measurement], CalibrationSet]:
    """Return the kind, the measurements and the calibrations of raw logs.

    Raises:
        UsageError: The folder holds no raw logs of one calibration.
        DataError: One of them is damaged.
    """
    paths = logs_in(folder)
    kinds, measurements, lines = set(), [], None
    for path in paths:
        log = read_log(path)
        if log.run is None or KIND not in log.run.details:
            raise UsageError(f"{path} is not a raw log of a calibration.")
        kinds.add(str(log.run.details[KIND]))
        counts = log.topics[COUNTS].rows if COUNTS in log.topics else None
        said = dict(log.run.details["devices"])
        measurements.append(Measurement(recording_from_log(log), counts, said))
        lines = carried_calibrations(log)
    if len(kinds) != 1 or lines is None:
        raise UsageError(
            f"{folder} holds {len(kinds) or 'no'} kinds of calibration.",
            fix="Name the folder that `rig calibrate` made.",
        )
    return kinds.pop(), measurements, lines


def _write(path: Path, kind: str, measurement: Measurement, lines: CalibrationSet) -> Path:
    recording, counts = measurement.recording, measurement.counts
    rate_hz = recording.sample_rate_hz
    info = replace(
        run_info(recording),
        started_at_ns=time.time_ns() - round(recording.duration_s * 1e9),
        details={KIND: kind, "rig_version": __version__, "devices": dict(measurement.details)},
    )
    streams = [sample_stream(tuple(recording.columns), round(rate_hz))]
    attached = [Attached(ATTACHMENT, "application/json", lines.to_json().encode())]
    expected = {SAMPLE: len(recording)}
    if counts is not None:
        streams.append(COUNTS_STREAM)
        expected[COUNTS] = len(recording)
    log_time_ns = log_times_ns(recording.time_s, info.started_at_ns)
    sequence = np.arange(len(recording), dtype=np.uint32) if counts is None else counts["sequence"]
    samples = {"time_s": recording.time_s, **recording.columns}
    with LogWriter(path, info, streams, attachments=attached) as log:
        log.write(SAMPLE, {**samples, "sequence": sequence, "flags": recording.flags}, log_time_ns)
        if counts is not None:
            fields = {field.name: counts[field.name] for field in COUNTS_STREAM.fields}
            log.write(COUNTS, fields, log_time_ns)
        log.close(RunEnd(expected_samples=expected))
    return path
