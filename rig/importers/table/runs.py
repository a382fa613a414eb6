"""Cutting a file's samples into runs: by gaps, laps, trials or marks, as the mapping states."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.recording import Flag, FloatArray, Recording, RecordingError, Stretch
from rig.errors import DataError
from rig.importers.table.channels import Samples
from rig.importers.table.cuts import labels_of, torn
from rig.importers.table.mapping import ColumnMapping, worked_out
from rig.importers.table.raw import Remark, Values
from rig.output.table import counted

SPARSE = 0.1
"""Share of samples with an empty cell from which the rate of a channel may be the reason."""

KEPT_OF_A_LAP = 0.5
"""A last lap that is shorter is left out where no shortest run is stated."""


def recordings(samples: Samples, remarks: list[Remark], asks: bool = False) -> Iterator[Recording]:
    """Yield the runs of a file, each on a clock that begins at 0.

    `remarks` gets a sentence on everything that is left out or filled in. A file that is cut into
    many tiny parts is a doubt of each run if `asks`, else an error.

    Raises:
        DataError: Time goes back inside a run, a condition changes inside one, or it is cut so.
    """
    if wrong := torn(samples.raw, samples.mapping, samples.time_s, samples.edges):
        if not asks and samples.mapping.data.runs.least_s is None:
            raise DataError(*wrong)
        samples = replace(samples, doubts=(*samples.doubts, " ".join(wrong)))
    parts = [slice(a, b) for a, b in itertools.pairwise(samples.edges)]
    kept = [part for part in parts if _is_long_enough(samples, part)]
    stem, short = samples.raw.path.stem.lower(), len(parts) - len(kept)
    if short:
        few = "1 part" if short == 1 else f"{short} parts"
        remarks.append((samples.raw.path.name, f"{few} too short for a run left out"))
    width = max(2, len(str(len(kept))))
    labels = labels_of(samples.raw, samples.mapping, [part.start for part in kept]) or [
        f"{number:0{width}d}" for number in range(len(kept))
    ]
    for label, part in zip(labels, kept, strict=True):
        yield _run(samples, part, f"{stem}-{label}" if len(kept) > 1 else stem, remarks)


def _is_long_enough(samples: Samples, part: slice) -> bool:
    rules = samples.mapping.data.runs
    least_s = rules.least_s
    if least_s is None:
        least_s = KEPT_OF_A_LAP * rules.lap_s if rules.lap_s else 0.0
    time_s = samples.time_s[part]
    if len(time_s) < 2:
        return False
    # a time that is empty or goes back is refused later, not passed over as short
    return not abs(float(time_s[-1] - time_s[0])) < least_s


def _run(samples: Samples, part: slice, name: str, remarks: list[Remark]) -> Recording:
    mapping = samples.mapping
    time_s = samples.time_s[part]
    channels = {key: values[part] for key, values in samples.channels.items()}
    twice = _is_twice(time_s, channels)
    interpolated = mapping.data.even_rate_hz is not None  # each channel from its own samples
    _check_clock(samples, part, time_s, twice, interpolated)
    if twice.any():
        remarks.append((name, f"{counted(int(twice.sum()), 'sample')} there twice left out"))
        time_s = time_s[~twice]
        channels = {key: values[~twice] for key, values in channels.items()}
    again = np.diff(time_s, prepend=-np.inf) == 0
    if again.any():
        count = counted(int(again.sum()), "sample")
        remarks.append((name, f"{count} with the time of the one before it left out"))
        channels = {key: _first_of_each(values, again) for key, values in channels.items()}
        time_s = time_s[~again]
    conditions = {
        key: _constant(mapping, key, value, part, name) for key, value in samples.conditions.items()
    }
    empty = ~np.all([np.isfinite(values) for values in channels.values()], axis=0)
    start_ns = samples.zero_ns
    if start_ns is not None:
        start_ns += round(float(time_s[0]) * 1e9)
    try:
        run = Recording(
            name=name,
            time_s=time_s - time_s[0],
            columns=channels,
            flags=np.where(empty, np.uint8(0 if interpolated else Flag.MISSING), np.uint8(0)),
            conditions=conditions,
            rig=mapping.name,
            started_at_ns=start_ns,
            source=str(samples.raw.path),
            doubts=samples.doubts,
        )
    except RecordingError as error:
        raise DataError(f"{samples.raw.path}: {error.what}", error.why, error.fix) from error
    if empty.any():
        remarks.append((name, _emptiness(time_s, channels, empty, interpolated)))
    run = _without_invalid(run, mapping)
    return _even(run, mapping)


def _emptiness(
    time_s: FloatArray, channels: dict[str, FloatArray], empty: NDArray[np.bool_], filled: bool
) -> str:
    samples = f"{counted(int(empty.sum()), 'sample')} with a cell that is empty, NaN or inf"
    if filled:
        return f"{samples}; each channel is interpolated"
    remark = f"{samples} flagged"
    fewest = min(int(np.isfinite(values).sum()) for values in channels.values())
    if empty.mean() < SPARSE or fewest < 2:
        return remark
    rate_hz = fewest / float(time_s[-1] - time_s[0])
    return f"{remark}; where a channel has a lower rate, even_rate_hz = {rate_hz:.3g} interpolates"


def _is_twice(time_s: FloatArray, channels: dict[str, FloatArray]) -> NDArray[np.bool_]:
    """Return which samples are those before them again, with the same time."""
    columns = np.column_stack([time_s, *channels.values()])
    same = (columns[1:] == columns[:-1]) | (np.isnan(columns[1:]) & np.isnan(columns[:-1]))
    same[:, 0] &= np.isfinite(time_s[1:])  # a time that is empty is refused
    return np.concatenate([[False], same.all(axis=1)])


def _first_of_each(values: FloatArray, again: NDArray[np.bool_]) -> FloatArray:
    """Return the first value at each time; a table may have a row for each channel's reading."""
    known = np.flatnonzero(np.isfinite(values))
    places, first = np.unique(np.cumsum(~again)[known] - 1, return_index=True)
    kept = np.full(int((~again).sum()), np.nan)
    kept[places] = values[known[first]]
    return kept


def _check_clock(
    samples: Samples, part: slice, time_s: FloatArray, twice: NDArray[np.bool_], repeats: bool
) -> None:
    """Refuse a time that is empty, goes back or, unless repeats may be there, stands still."""
    where, is_there = part.start or 0, np.isfinite(time_s)
    if not is_there.all():
        raise DataError(
            f"{samples.raw.path}, {samples.raw.row(where + int(np.argmin(is_there)))}: the time is"
            " empty.",
            fix="Correct the file, or state a sample rate in place of the time column.",
        )
    steps = np.diff(time_s)
    is_back, is_again = steps < 0, (steps == 0) & ~twice[1:]
    wrong = is_back if repeats else is_back | is_again
    if not wrong.any():
        return
    at = int(np.argmax(wrong)) + 1
    what = (
        f"{samples.raw.path}, {samples.raw.row(where + at)}: time goes from"
        f" {float(time_s[at - 1]):.6g} s to {float(time_s[at]):.6g} s."
    )
    count = int(is_back.sum() or is_again.sum())
    if not is_back.any():
        even = ""
        if (steps > 0).any():
            rate_hz = float(f"{1 / np.median(steps[steps > 0]):.3g}")
            even = (
                f"Write even_rate_hz = {rate_hz:g} under [data]: the first sample of each time"
                " counts, and an even clock is interpolated. "
            )
        raise DataError(
            what,
            f"{counted(count, 'sample')} {'has' if count == 1 else 'have'} the time of the one"
            " before it.",
            f"{even}If the column is not a clock, state --rate HZ.",
        )
    raise DataError(
        what,
        f"{counted(count, 'sample')} {'comes' if count == 1 else 'come'} before the one above.",
        "If the clock starts again with each trial, write resets = true under [data.runs]"
        " (--runs resets=true); if the column is not a clock, state --rate HZ.",
    )


def _constant(
    mapping: ColumnMapping, key: str, value: float | str | Values, part: slice, run: str
) -> float | str:
    if not isinstance(value, np.ndarray):
        return value
    inside = value[part]
    if np.any(inside != inside[0]):
        raise DataError(
            f"{mapping.where('conditions', key)}: {key} is not constant in run {run}: it goes from"
            f" {inside.min()} to {inside.max()}.",
            "A condition holds for a whole run.",
            "Cut runs where it changes, changes = [COLUMN] under [data.runs], or map it as a"
            " channel.",
        )
    return str(inside[0]) if inside.dtype.kind in "US" else float(inside[0])


def _without_invalid(run: Recording, mapping: ColumnMapping) -> Recording:
    """Flag the samples for which a formula of the mapping is true."""
    known = {**run.conditions, **run.columns, "time_s": run.time_s}
    for number, invalid in enumerate(mapping.data.invalid):
        where = mapping.where("invalid", number, "when")
        found = worked_out(where, invalid.when, known, run.time_s.shape, np.bool_)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], found, [False]])))
        for first, end in edges.reshape(-1, 2):
            start_s, stop_s = float(run.time_s[first]), float(run.time_s[end - 1])
            flag = Flag.MISSING if invalid.missing else Flag.SUSPECT
            run = run.with_stretch(Stretch(start_s, stop_s, flag, invalid.reason))
        if invalid.missing:
            columns = {n: np.where(found, np.nan, values) for n, values in run.columns.items()}
            run = replace(run, columns=columns)
    return run


def _even(run: Recording, mapping: ColumnMapping) -> Recording:
    """Interpolate a run onto an even clock, each channel from the samples that it has.

    A sample next to a flagged one, or in a gap of three usual steps of a channel, is flagged.
    """
    rate_hz = mapping.data.even_rate_hz
    if rate_hz is None:
        return run
    count = int(np.floor(run.duration_s * rate_hz * (1 + 1e-12))) + 1
    time_s = np.arange(count) / rate_hz
    after = np.clip(np.searchsorted(run.time_s, time_s), 0, len(run) - 1)
    flags = run.flags[after] | run.flags[np.clip(after - 1, 0, None)]
    columns = {}
    for name, values in run.columns.items():
        known = np.isfinite(values)
        if known.sum() < 2:
            columns[name] = np.full(count, np.nan)
            flags |= np.uint8(Flag.MISSING)
            continue
        at_s = run.time_s[known]
        columns[name] = np.interp(time_s, at_s, values[known])
        place = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
        apart = at_s[place] - at_s[place - 1]
        beyond = np.maximum(at_s[0] - time_s, time_s - at_s[-1])
        usual = max(1 / rate_hz, float(np.median(np.diff(at_s))))
        flags |= np.where((apart > 3.0 * usual) | (beyond > usual), np.uint8(Flag.MISSING), 0)
    return replace(run, time_s=time_s, columns=columns, flags=flags.astype(np.uint8))
