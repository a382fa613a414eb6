"""From columns to MCAP message records, a block at a time, and what is refused on the way."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.channels import ESTIMATED
from rig.errors import DataError
from rig.log.schema import CDR_HEADER, MESSAGE_OPCODE, Stream

Rows = NDArray[np.void] | Mapping[str, ArrayLike]
"""Messages as a structured array of the stream's dtype, or as one array for each field."""


class UnflaggedSampleError(DataError):
    """A sample is not finite and has no flag."""


def packed_rows(stream: Stream, rows: Rows) -> NDArray[np.void]:
    """Return rows as a structured array of the stream's dtype, shape (n,).

    Raises:
        DataError: The rows do not fit the stream, or would change in the conversion.
        UnflaggedSampleError: A value is not finite and the row's flags are 0 or not there.
    """
    payload = _from_columns(stream, rows) if isinstance(rows, Mapping) else rows
    if payload.dtype != stream.dtype or payload.ndim != 1:
        raise DataError(
            f"Rows for {stream.topic} have dtype {payload.dtype}, shape {payload.shape}.",
            f"The stream has dtype {stream.dtype} and rows are one-dimensional.",
        )
    _refuse_unflagged(stream, payload)
    return payload


def _from_columns(stream: Stream, rows: Mapping[str, ArrayLike]) -> NDArray[np.void]:
    names = [field.name for field in stream.fields]
    if set(rows) != set(names):
        raise DataError(
            f"The fields for {stream.topic} do not fit.",
            f"Missing: {sorted(set(names) - set(rows))},"
            f" unknown: {sorted(set(rows) - set(names))}.",
        )
    columns = {name: np.asarray(rows[name]) for name in names}
    shapes = {column.shape for column in columns.values()}
    if len(shapes) > 1 or len(next(iter(shapes))) != 1:
        raise DataError(f"The fields for {stream.topic} differ in shape: {sorted(shapes)}.")
    payload = np.empty(columns[names[0]].size, stream.dtype)
    for name, column in columns.items():
        _refuse_out_of_range(stream, name, column)
        payload[name] = column
    return payload


def _refuse_out_of_range(stream: Stream, name: str, column: NDArray[np.generic]) -> None:
    kind = stream.dtype[name]
    if kind.kind == "f" and column.dtype.kind in "fiu":
        return
    if column.dtype.kind not in "iu":
        raise DataError(f"{name} of {stream.topic} is {column.dtype}, not a whole number.")
    limits = np.iinfo(kind)
    if column.size and not (limits.min <= column.min() and column.max() <= limits.max):
        raise DataError(f"{name} of {stream.topic} does not fit in {kind}.")


def not_finite(stream: Stream, payload: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return which messages hold a measurement that is not finite, shape (n,).

    An estimate is none of them: it is not a number where its estimator has no answer.
    """
    bad = np.zeros(payload.size, bool)
    for field in stream.fields:
        if field.dtype.startswith("float") and not field.name.startswith(ESTIMATED):
            bad |= ~np.isfinite(payload[field.name])
    return bad


def _refuse_unflagged(stream: Stream, payload: NDArray[np.void]) -> None:
    names = [field.name for field in stream.fields]
    bad = not_finite(stream, payload)
    if "flags" in names:
        bad &= payload["flags"] == 0
    if bad.any():
        row = int(np.argmax(bad))
        wrong = [name for name in names if not np.isfinite(payload[name][row])]
        raise UnflaggedSampleError(
            f"{', '.join(wrong)} of {stream.topic} is not finite in row {row} of {payload.size},"
            " and has no flag.",
            "A value that is not a number must never pass for a measurement.",
            "Set the row's flags (saturated, stale, missing or suspect).",
        )


def message_records(
    stream: Stream, payload: NDArray[np.void], log_time_ns: ArrayLike, channel: int, already: int
) -> NDArray[np.void]:
    """Return MCAP message records of the stream's `record_dtype`, shape (n,), n >= 1.

    The payload are rows of the stream's dtype, the log times ns since the Unix epoch, shape (n,).
    `already` is how many messages of the stream there were; it numbers those of a stream without
    `sequence`.

    Raises:
        DataError: The log times do not fit.
    """
    log_time = np.asarray(log_time_ns)
    if log_time.shape != payload.shape or log_time.dtype.kind not in "iu":
        raise DataError(
            f"Log times for {stream.topic} have shape {log_time.shape} and type {log_time.dtype}.",
            f"Whole nanoseconds of shape {payload.shape} are needed.",
        )
    if log_time.min() < 0:
        raise DataError(f"A log time of {stream.topic} lies before the epoch.")
    messages = np.empty(payload.size, stream.record_dtype)
    messages["opcode"] = MESSAGE_OPCODE
    messages["length"] = stream.record_length
    messages["channel"] = channel
    if any(field.name == "sequence" for field in stream.fields):
        messages["sequence"] = payload["sequence"]
    else:
        messages["sequence"] = (already + np.arange(payload.size)) & 0xFFFFFFFF
    messages["log_time"] = log_time
    messages["publish_time"] = log_time
    messages["cdr"] = CDR_HEADER
    messages["payload"] = np.ascontiguousarray(payload).view(f"V{stream.dtype.itemsize}")
    return messages
