"""A log's samples made again from its raw counts, with other calibrations."""

from dataclasses import replace

import numpy as np

from calibration.linear import CalibrationSet
from rig.errors import DataError, UsageError
from rig.log.reader import LogFile
from rig.log.streams import COUNTS, SAMPLE

ATTACHMENT = "calibrations.json"
ZERO_SUFFIX = "_counts"


def carried_calibrations(log: LogFile) -> CalibrationSet:
    """Return the calibrations a log was recorded with.

    Raises:
        UsageError: It carries none.
        CalibrationError: What it carries is not a set.
    """
    carried = log.attached(ATTACHMENT)
    if carried is None:
        raise UsageError(
            f"{log.path} carries no calibrations.",
            "It was not recorded by this rig.",
            "Name a whole set with --calibration.",
        )
    return CalibrationSet.from_json(carried.decode())


def recalibrated(log: LogFile, calibrations: CalibrationSet) -> LogFile:
    """Return a log, read whole, with its SI channels made again from its counts.

    Channels without a line stay as they were. Zeros that were measured before the run are kept:
    they are counts, whatever the line.

    Raises:
        UsageError: The log has no raw counts.
        DataError: Counts and samples are not of the same ticks, or a field is missing.
    """
    if COUNTS not in log.topics or SAMPLE not in log.topics:
        raise UsageError(
            f"{log.path} has no raw counts.",
            "Other calibrations apply to counts; this log has SI samples only.",
        )
    sample, counts = log.topics[SAMPLE], log.topics[COUNTS].rows
    if not np.array_equal(sample.rows["sequence"], counts["sequence"]):
        raise DataError(
            f"{log.path}: samples and counts are not of the same ticks.",
            fix=f"Run `rig log check {log.path}`.",
        )
    lines = {n: line for n, line in calibrations.channels.items() if n in sample.columns}
    fields = counts.dtype.names or ()
    for name, line in lines.items():
        if line.counts not in fields:
            raise DataError(
                f"The line of {name} reads {line.counts!r}, which the log does not have.",
                f"It has: {', '.join(fields)}.",
            )
    zeros = {} if log.run is None else log.run.zeros_before
    measured = {name.removesuffix(ZERO_SUFFIX): value for name, value in zeros.items()}
    again = replace(sample, records=sample.records.copy())
    for name, values in CalibrationSet(calibrations.name, lines).apply(counts, measured).items():
        again.rows[name] = values
    return replace(log, topics={**log.topics, SAMPLE: again})
