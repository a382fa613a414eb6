"""From the columns of a file to channels and conditions in SI units."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime

import numpy as np

from estimation.channels import UnknownUnitError, unit_of, unit_or_none
from estimation.recording import FloatArray
from rig.errors import DataError, UsageError
from rig.importers.table.cuts import edges_of
from rig.importers.table.data import DATE, TIME, Source
from rig.importers.table.delimited import after_samples, bad_cell, has_thousands
from rig.importers.table.formula import names_in
from rig.importers.table.mapping import ColumnMapping, worked_out
from rig.importers.table.raw import IMPOSSIBLE, Raw, Values, find, is_number
from rig.importers.table.stated import check_name, check_row_of_units, mapped_twice, unit_doubts
from rig.importers.table.units import conversion

DAY_S, NO_DATE = 86_400.0, date(1970, 1, 1)


class NotMappedError(DataError):
    """Nothing states which column of a table is which channel."""

    def __init__(self, raw: Raw) -> None:
        self.raw = raw
        super().__init__(
            f"Nothing states which column of {raw.path} is which channel.",
            raw.listing(),
            "Map them: --column motor_angle_rad=COLUMN:deg, or [data.columns] in --machine FILE."
            f" `rig import {raw.path} --preview` lists them with their first values.",
        )


@dataclass(frozen=True)
class Samples:
    """One file in SI units."""

    raw: Raw
    mapping: ColumnMapping
    time_s: FloatArray  # shape (n,), as it is there
    edges: list[int]  # first sample of each run, and the end of the last one
    # name to values, shape (n,) each; not finite where a cell is empty
    channels: dict[str, FloatArray]
    # name to one value, or to values that must be constant in each run
    conditions: dict[str, float | str | Values]
    # date at which `time_s` is 0, ns since 1970; 0 where its clock has no date, and None where no
    # column holds the time
    zero_ns: int | None = None
    doubts: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()  # what was assumed about its clock, in words


def to_samples(raw: Raw, mapping: ColumnMapping) -> Samples:
    """Convert a file.

    Raises:
        DataError: A mapped column is not there, holds text, or is empty.
        UsageError: A formula reads a name that is neither a channel nor a condition.
    """
    data = mapping.data
    sources = data.columns or _by_name(raw, mapping)
    time_s, zero_ns, remarks = _clock(raw, mapping, sources.get(TIME))
    edges = edges_of(raw, mapping, time_s)
    channels = {
        name: _channel(raw, mapping.where("columns", name), name, source, edges)
        for name, source in sources.items()
        if name != TIME
    }
    conditions = {
        name: _condition(raw, mapping.where("conditions", name), name, source)
        for name, source in data.conditions.items()
    }
    for name, formula in _in_order(mapping):
        known = {**conditions, **channels, TIME: time_s}
        where = mapping.where("formulas", name)
        channels[name] = worked_out(where, formula, known, time_s.shape, np.float64).copy()
    mapped = {**sources, **data.conditions}.items()
    doubts = (
        *(text for name, source in mapped for text in unit_doubts(raw, name, source)),
        *mapped_twice(sources),
    )
    return Samples(raw, mapping, time_s, edges, channels, conditions, zero_ns, doubts, remarks)


def _clock(
    raw: Raw, mapping: ColumnMapping, source: Source | None
) -> tuple[FloatArray, int | None, tuple[str, ...]]:
    """Return the time of each sample, s, when that is 0, ns since 1970 if known, and remarks."""
    where, rate_hz = mapping.where("columns", TIME), mapping.data.sample_rate_hz
    if source is not None and source.unit == DATE:
        return _dates(raw, where, source)
    if source is not None:
        time_s = _channel(raw, where, TIME, source, [])
        of_day = np.nanmin(time_s) >= 0.0 and np.nanmax(time_s) <= DAY_S
        if of_day and not mapping.data.runs.resets:
            time_s, remarks = _past_midnight(raw, time_s)
            return time_s, 0, remarks
        return time_s, 0, ()
    if rate_hz is not None:
        return np.arange(len(raw)) / rate_hz, None, ()
    raise DataError(
        f"{raw.path} has no time: no column is called time_s, and no sample rate is stated.",
        raw.listing(),
        "Map one, --column time_s=COLUMN:ms, or state --rate HZ.",
    )


def _past_midnight(raw: Raw, time_s: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return a time of the day that goes on where it falls by about a day, and a remark on it."""
    steps = np.diff(time_s, prepend=time_s[0])
    falls = steps < -0.5 * DAY_S
    if not falls.any() or (steps > 0.5 * DAY_S).any():  # the clock does not come back
        return time_s, ()
    place = raw.row(int(np.argmax(falls)))
    remark = f"the time falls by a day in {place}, at midnight, and is continued there"
    return time_s + DAY_S * np.cumsum(falls), (remark,)


def _by_name(raw: Raw, mapping: ColumnMapping) -> dict[str, Source]:
    """Return the columns that are named as channels, where no column is mapped at all."""
    found = {
        name: Source(column=name) for name in raw.columns if unit_or_none(name) and name.islower()
    }
    used = {one for formula in mapping.data.formulas.values() for one in names_in(formula)}
    if not set(found) - {TIME} and not used:
        raise NotMappedError(raw)
    return found


def _channel(raw: Raw, where: str, name: str, source: Source, edges: Sequence[int]) -> FloatArray:
    """Return a column in SI units; a counter that starts again does so in each run for itself."""
    found = find(raw, where, name, source.column, source.unit)
    if not isinstance(found, np.ndarray):
        found = np.full(len(raw), found)
    if found.dtype.kind not in "fiub":
        raise _not_numbers(raw, where, name, source, str(found[0]))
    numbers = found.astype(np.float64)
    possible = np.where(np.abs(numbers) > IMPOSSIBLE, np.nan, numbers)
    values = _in_si(raw, where, name, source, possible, edges)
    if not np.isfinite(values).any():
        raise DataError(
            f"{where}: column {source.column!r} of {raw.path.name} is empty.",
            fix="Map another column, or delete this line.",
        )
    return values


def _not_numbers(raw: Raw, where: str, name: str, source: Source, cell: str) -> DataError:
    what, fix = cell, "Correct the file, or map another column."
    if source.column in raw.columns:
        what, fix = bad_cell(raw, source.column)
    if name == TIME and date_of(cell) is not None:
        fix = f"Write {TIME} = '{source.column}:{DATE}'."
    return DataError(
        f"{where}: column {source.column!r} of {raw.path.name} is not numbers: {what}.", fix=fix
    )


def _in_si(
    raw: Raw,
    where: str,
    name: str,
    source: Source,
    values: FloatArray,
    edges: Sequence[int] = (),
) -> FloatArray:
    gain = source.gain
    if isinstance(gain, str):
        gain_found = find(raw, where, name, gain)
        if not isinstance(gain_found, float | int):
            raise DataError(
                f"{where}: the gain {gain!r} is not a single number of {raw.path.name}.",
                fix="Write a number, or the name of a single value.",
            )
        gain = float(gain_found)
    if source.wraps_at is not None:
        values = np.concatenate(
            [_unwrapped(part, source.wraps_at) for part in np.split(values, edges)]
        )
    if source.sign_bit is not None:
        values = np.where(values >= source.sign_bit, source.sign_bit - values, values)
    unit = conversion(source.unit, name) if source.unit else None
    if unit is None and gain == 1.0:
        check_name(where, name, source.column)
        check_row_of_units(raw, where, name, source.column)
    if unit is None:
        return np.asarray(gain * (values - source.zero))
    return np.asarray(unit.factor * gain * (values - source.zero) + unit.shift)


def _unwrapped(values: FloatArray, period: float) -> FloatArray:
    """Return the values of a counter, of one run, that goes on where it starts again."""
    found, is_there = values.copy(), np.isfinite(values)
    found[is_there] = np.unwrap(values[is_there], period=period)
    return found


def _condition(raw: Raw, where: str, name: str, source: Source) -> float | str | Values:
    if source.value is not None:
        return source.value
    found = find(raw, where, name, source.column, source.unit)
    many = found if isinstance(found, np.ndarray) else np.array([found])
    if many.dtype.kind in "US" and unit_or_none(name):
        if raw.decimal == "," and any(has_thousands(str(cell), ",") for cell in many):
            raise _not_numbers(raw, where, name, source, str(many[0]))
        try:
            many = many.astype(np.float64)
        except ValueError as error:
            cell = str(many[0])
            point = cell.replace(",", ".")
            raise DataError(
                f"{where}: {source.column!r} of {raw.path.name} is not a number: {cell!r}.",
                f"{name} ends in a unit, so it is one.",
                f"Write it with a point, {point}, or state decimal = ',' under [data]."
                if is_number(point)
                else "Rename the condition without a unit, or map something else.",
            ) from error
    if many.dtype.kind in "fiub":
        many = _in_si(raw, where, name, source, many.astype(np.float64))
    if isinstance(found, np.ndarray):
        return many
    return str(many[0]) if many.dtype.kind in "US" else float(many[0])


def _dates(raw: Raw, where: str, source: Source) -> tuple[FloatArray, int | None, tuple[str, ...]]:
    cells = find(raw, where, TIME, source.column)
    assert isinstance(cells, np.ndarray)  # noqa: S101  a single value has no clock
    read = [date_of(str(cell)) for cell in cells]
    at = [one for one in read if one is not None]
    if len(at) < len(read):
        index = read.index(None)
        raise DataError(
            f"{raw.path}, {raw.row(index)}: {str(cells[index])!r} is not a date.",
            "The time is mapped with the unit iso8601, such as 2024-05-01T12:00:00.25.",
            after_samples(raw, [one is not None for one in read], index)
            or "Correct the file, or map another column.",
        )
    since, remarks = np.array([(one - at[0]).total_seconds() for one in at]), tuple[str, ...]()
    if at[0].date() == NO_DATE:  # a time of the day alone: a run may go past midnight
        since, remarks = _past_midnight(raw, since)
    return since, round(at[0].timestamp() * 1e6) * 1000, remarks


def date_of(cell: str) -> datetime | None:
    """Return a date, or a time of the day on the date of none; None for anything else."""
    for text in (cell, f"{NO_DATE}T{cell}"):
        try:
            found = datetime.fromisoformat(text)
        except ValueError:
            continue
        return found if found.tzinfo else found.replace(tzinfo=UTC)
    return None


def _in_order(mapping: ColumnMapping) -> list[tuple[str, str]]:
    """Return the formulas so that each comes after those that it reads."""
    left = dict(mapping.data.formulas)
    ordered: list[tuple[str, str]] = []
    while left:
        ready = [n for n, text in left.items() if not set(names_in(text)) & set(left)]
        if not ready:
            raise UsageError(
                f"{mapping.where('formulas', next(iter(left)))}: formulas read one another in a"
                f" circle: {', '.join(left)}."
            )
        ordered += [(name, left.pop(name)) for name in ready]
    for name, _ in ordered:
        try:
            unit_of(name)
        except UnknownUnitError as error:
            where = mapping.where("formulas", name)
            raise UsageError(f"{where}: {error.what}", error.why, error.fix) from error
    return ordered
