"""What a file itself states of a column's unit, against what the mapping states.

A unit is stated at the end of a column's name, or in a line of units below the head.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from estimation.channels import unit_of, unit_or_none
from rig.errors import DataError
from rig.importers.table.data import DATE, Source
from rig.importers.table.raw import IMPOSSIBLE, Raw
from rig.importers.table.units import (
    agree,
    as_unit,
    contradicted_by_name,
    conversion,
    stated_in_name,
)
from rig.output.table import counted


def check_name(where: str, name: str, column: str) -> None:
    """Refuse a column whose name states another unit than the channel's, where none is stated."""
    stated = stated_in_name(column, name)
    if not stated:
        return
    raise DataError(
        f"{where}: the name of the column {column!r} states {stated}, and the"
        f" mapping states no unit for {name}.",
        "Without one, values are taken as SI units.",
        f"Write {name} = '{column}:{stated}'; if they are in SI units, that unit in its place."
        if conversion(stated, name)
        else f"Correct the name {name}; if they are in SI units, write {name} ="
        f" '{column}:{unit_of(name)}'.",
    )


def check_row_of_units(raw: Raw, where: str, name: str, column: str) -> None:
    """Refuse a column of which the line below the head states another unit, where none is stated.

    A text there that is not a unit is asked about instead.
    """
    stated, own = as_unit(raw.units.get(column, "")), unit_or_none(name)
    if not stated or own is None or agree(stated, "", 1.0, name) is not False:
        return
    fits = conversion(stated, name) is not None
    raise DataError(
        f"{where}: line {raw.units_line} of {raw.path.name} states {stated} for the column"
        f" {column!r}, and the mapping states no unit for {name}.",
        "Without one, values are taken as SI units.",
        f"Write {name} = '{column}:{stated}'; if they are in SI units, {name} = '{column}:{own}'."
        if fits
        else f"Write a gain, {name} = {{ column = '{column}', gain = SIZE }}; if they are in SI"
        f" units, {name} = '{column}:{own}'.",
    )


def unit_doubts(raw: Raw, name: str, source: Source) -> Iterator[str]:
    """Yield impossible numbers of a column, and another unit in its name or below the head.

    Another column of its name is one more doubt.
    """
    if source.column in raw.repeated:
        yield (
            f"{name}: {raw.repeated[source.column]} columns are called {source.column!r}, and the"
            f" first one is read; is it the right one? If so, rename the others; the second is"
            f" {f'{source.column}.2'!r}"
        )
    cells = raw.columns.get(source.column)
    if cells is not None and cells.dtype.kind == "f":
        huge = np.flatnonzero(np.isfinite(cells) & (np.abs(cells) > IMPOSSIBLE))
        if huge.size:
            first = f"{cells[huge[0]]:.3g} in {raw.row(int(huge[0]))}"
            yield (
                f"{name}: the column {source.column!r} holds {counted(huge.size, 'number')} beyond"
                f" any reading, first {first}, taken as an empty cell; does the instrument write"
                " that for no value?"
            )
    stated, own = raw.units.get(source.column, ""), unit_or_none(name)
    if own is None or source.unit == DATE or isinstance(source.gain, str):
        return
    agreed = agree(stated, source.unit, source.gain, name) if stated else True
    row = f"{name}: line {raw.units_line} of the file states {stated} for the column"
    gain = "" if source.gain == 1.0 else f" times {source.gain:g}"
    used = f"{source.unit or own}{gain}"
    if in_name := contradicted_by_name(source.column, source.unit, source.gain, name):
        yield (
            f"{name}: the name of the column {source.column!r} states {in_name}, and the mapping"
            f" {used}; which one is right?"
        )
    if agreed is False:
        yield f"{row} {source.column!r}, and the mapping {used}; which one is right?"
    elif agreed is None and not source.unit and source.gain == 1.0:
        yield f"{row} {source.column!r}, which is not a unit that is known; is it in {own}?"


def mapped_twice(columns: Mapping[str, Source]) -> Iterator[str]:
    """Yield the columns that several channels are read from, as questions.

    A gain makes another quantity of a column, such as a torque of a current.
    """
    channels: dict[str, list[str]] = {}
    for name, source in columns.items():
        if source.gain == 1.0:
            channels.setdefault(source.column, []).append(name)
    for column, names in channels.items():
        if len(names) > 1:
            yield f"{' and '.join(names)} are one column, {column!r}; is this meant?"
