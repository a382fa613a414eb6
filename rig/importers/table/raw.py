"""The content of one file of a table, as it is there: columns of samples and single values."""

import difflib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.importers.table.units import BASE

Values = NDArray[np.generic]
"""One column: float64, or text where a cell is not a number."""

Cells = Values | float | str
"""One column or single value."""

Remark = tuple[str, str]
"""File or run, and what was assumed, left out or filled in there, in words."""


IMPOSSIBLE = 1e24
"""Size above which a number is not a reading in any unit; some programs write such for none."""


@dataclass(frozen=True)
class Raw:
    """One file."""

    path: Path
    # Name to column, shape (n,) each. Columns of a file without a head are named by their number,
    # from 1.
    columns: dict[str, Values]
    # name to a value that holds for the whole file
    fields: dict[str, float | str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()  # what was found out about the layout, in words
    first_line: int = 0  # line of the file that holds the first sample; 0 where it has no lines
    # column to what a line of units below the head states of it; nothing where none does
    units: Mapping[str, str] = field(default_factory=dict)
    units_line: int = 0
    decimal: str = ""  # decimal sign of a text table; empty for any other file
    # name that several columns have to how many; the second one is called `NAME.2`
    repeated: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def row(self, index: int) -> str:
        """Return where a sample stands in the file, in words."""
        return f"line {self.first_line + index}" if self.first_line else f"sample {index + 1}"

    def listing(self) -> str:
        """Return the names in the file, in words."""
        columns = ", ".join(repr(name) for name in self.columns) or "none"
        fields = ", ".join(repr(name) for name in self.fields)
        return f"Its columns are {columns}." + (
            f" Its single values are {fields}." if fields else ""
        )

    def nearest(self, name: str) -> str:
        """Return the name of a column or single value nearest to one that is not there, or ''."""
        known = [*self.columns, *self.fields]
        lower = {one.lower(): one for one in known}
        near = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=0.5)
        return lower[near[0]] if near else ""


class NoColumnError(DataError):
    """A file has no such column or single value."""

    def __init__(self, raw: Raw, what: str, why: str, fix: str) -> None:
        self.raw = raw
        super().__init__(what, why, fix)


def find(raw: Raw, where: str, key: str, column: str, stated: str | None = None) -> Cells:
    """Return a column or single value of a file by name, for a key of the mapping and its place.

    The unit that the mapping states of it is kept in the remedy.

    Raises:
        DataError: The file has neither.
    """
    if column in raw.columns:
        return raw.columns[column]
    if column in raw.fields:
        return raw.fields[column]
    name, _, unit = column.rpartition(":")
    if name in raw.columns or name in raw.fields:
        raise DataError(
            f"{where}: {unit!r} is not a unit that is known.",
            "A unit is a product of powers of these with an optional number:"
            f" {', '.join(BASE)}; with a prefix, such as mm or N cm.",
            f"Write {key} = '{name}:UNIT', or the column alone where it is in SI units.",
        )
    near = raw.nearest(column)
    source = repr(f"{near}:{stated}" if stated else near)
    raise NoColumnError(
        raw,
        f"{where}: {raw.path.name} has no column {column!r} for {key}.",
        raw.listing(),
        f"Did you mean {near!r}? Write {key} = {source}." if near else "Correct the name.",
    )


def with_samples(raw: Raw) -> Raw:
    """Return a file's content if it has samples, all columns as many.

    Raises:
        DataError: It has none, or columns differ in length.
    """
    lengths = {name: len(values) for name, values in raw.columns.items()}
    if not lengths or not max(lengths.values()):
        raise DataError(f"{raw.path} has no samples.", fix="Name a file with at least one row.")
    if len(set(lengths.values())) > 1:
        raise DataError(
            f"The columns of {raw.path} differ in length.",
            ", ".join(f"{name} has {count}" for name, count in lengths.items()) + ".",
            "Save the samples of one run as columns of the same length.",
        )
    return raw


def nested(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a tree of tables; one inside another is called `outer.inner`."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from nested(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def is_number(text: str) -> bool:
    """Whether a cell is a number; unlike in `float`, an underscore is not part of one."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def numbers_or_text(cells: list[str], decimal: str = ".") -> Values:
    """Return cells as float64; an empty one is not a number; text, as it is, if any is neither."""
    with suppress(ValueError):
        if not any("_" in cell for cell in cells):
            numbers = cells if decimal == "." else [cell.replace(decimal, ".") for cell in cells]
            return np.array([float(cell) if cell.strip() else np.nan for cell in numbers])
    return np.array([cell.strip() for cell in cells])
