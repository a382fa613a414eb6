"""Rules for the use of a calibration record: stale, foreign, changed, out of range."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from calibration.errors import CalibrationError
from calibration.record import LINE, CalibrationRecord, RawFile

STALE_FACTOR = 2.0
"""A record is a warning past its days, and an error past this many times its days."""

CLOCK_TOLERANCE = timedelta(minutes=5)
"""How far two computers' clocks may differ before a record counts as made in the future."""


class UnfitCalibrationError(CalibrationError):
    """A record must not be used as it was about to be."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of one rule for a record.

    Attributes:
        rule: `stale`, `future`, `foreign_serial`, `unknown_serial`, `raw_missing`, `raw_changed`
            or `out_of_range`.
        is_error: Whether it must not be used; otherwise it is a warning.
        record: Hash of the record.
    """

    rule: str
    is_error: bool
    message: str
    record: str
    channel: str


def judge(
    record: CalibrationRecord, now: datetime, serials: Mapping[str, str] | None = None
) -> list[Verdict]:
    """Return the objections to using a record now, with its offset from UTC, on these devices.

    Stale is a warning, and an error past twice the days. A serial number that differs is an error,
    one that the configuration (device to serial number) does not state is a warning.
    """
    said = _age(record, now)
    for device, serial in sorted(record.serials.items()):
        here = (serials or {}).get(device)
        if here is None:
            said.append(("unknown_serial", False, f"made on {device} {serial}, here unknown"))
        elif here != serial:
            said.append(("foreign_serial", True, f"made on {device} {serial}, here is {here}"))
    return _verdicts(record, said)


def judge_raw(record: CalibrationRecord) -> list[Verdict]:
    """Return whether the files a record was made from are still there and the same."""
    said = []
    for file in record.raw:
        if not Path(file.path).is_file():
            said.append(("raw_missing", False, f"{file.path} is not there any more"))
        elif RawFile.of(Path(file.path)).sha256 != file.sha256:
            said.append(("raw_changed", True, f"{file.path} has changed since"))
    return _verdicts(record, said)


def judge_range(record: CalibrationRecord, values: ArrayLike) -> list[Verdict]:
    """Return whether inputs, any shape, lie outside the calibrated range.

    Beyond it a line is a warning, since it goes on as it was; any other form is an error.
    """
    inputs = np.asarray(values, dtype=np.float64)
    low = -np.inf if record.validity.low is None else record.validity.low
    high = np.inf if record.validity.high is None else record.validity.high
    outside = ~((inputs >= low) & (inputs <= high))  # not a number is outside, too
    if not outside.any():
        return []
    message = (
        f"{int(outside.sum())} of {inputs.size} values of {record.input} are outside "
        f"{low:g} .. {high:g}; they go from {inputs.min():g} to {inputs.max():g}"
    )
    return _verdicts(record, [("out_of_range", record.fit.form != LINE, message)])


def refuse_errors(verdicts: list[Verdict]) -> list[Verdict]:
    """Return the warnings.

    Raises:
        UnfitCalibrationError: There is an error among the verdicts.
    """
    errors = [verdict for verdict in verdicts if verdict.is_error]
    if errors:
        raise UnfitCalibrationError(
            f"The active calibration of {errors[0].channel} must not be used.",
            "; ".join(f"{e.record}: {e.message}" for e in errors) + ".",
            "Calibrate again, or choose another record with `rig calibrate use`.",
        )
    return verdicts


def _age(record: CalibrationRecord, now: datetime) -> list[tuple[str, bool, str]]:
    age = now - record.made
    if age < -CLOCK_TOLERANCE:
        return [("future", True, f"made at {record.made_at}, which is still to come")]
    days, limit = age / timedelta(days=1), record.validity.days
    if limit is None or days <= limit:
        return []
    return [("stale", days > STALE_FACTOR * limit, f"{days:.0f} days old, good for {limit:g}")]


def _verdicts(record: CalibrationRecord, said: list[tuple[str, bool, str]]) -> list[Verdict]:
    return [Verdict(*one, record.content_hash, record.channel) for one in said]
