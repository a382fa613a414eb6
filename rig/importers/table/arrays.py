"""Tables in files of arrays: Parquet, `.mat`, `.npz` and `.npy`.

Every reader raises DataError where a file is damaged or holds objects, and MissingExtraError where
the library for its format is not installed.
"""

import fnmatch
import io
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import DataError, MissingExtraError
from rig.importers.matlab import read_variables
from rig.importers.table.data import Layout
from rig.importers.table.raw import Raw, Values, nested
from rig.log.order import by_number

NUMBERED = re.compile(r"(?P<stem>[^.]*?\.?)(?P<number>\d+)\.(?P<rest>.+)")
"""Name of a field of one of several structs: `trial3.q`, `trial.3.q`."""

TRIAL = "trial"
"""Column with the number of the trial, from 1."""


def read_parquet(path: Path, layout: Layout) -> Raw:
    """Read a Parquet file; a column of lists becomes one column an entry."""
    del layout
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise MissingExtraError(
            f"{path} is a Parquet file.", "The library that reads it is not installed.", "parquet"
        ) from error
    try:
        table = parquet.read_table(path)
    except (ArrowException, OSError) as error:
        raise _damaged(path, "Parquet", error) from error
    columns: dict[str, Values] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        columns |= _spread(name, _arrow_values(column))
    return Raw(path, columns)


def _arrow_values(column: Any) -> Values:
    from pyarrow import types

    kind = column.type
    if types.is_timestamp(kind):
        return np.array([value.isoformat() if value else "" for value in column.to_pylist()])
    if types.is_list(kind) or types.is_fixed_size_list(kind):
        return np.array(column.to_pylist(), dtype=np.float64)
    if types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind):
        cells = column.to_numpy(zero_copy_only=False)
        return np.array([np.nan if v is None else v for v in cells], dtype=np.float64)
    return np.array([str(value) for value in column.to_pylist()])


def read_npz(path: Path, layout: Layout) -> Raw:
    """Read arrays of a NumPy archive, which holds no objects."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as archive:
            values = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, KeyError) as error:
        raise _damaged(path, "NumPy", error) from error
    return _of_trials(path, values, layout.trials)


def read_npy(path: Path, layout: Layout) -> Raw:
    """Read one array of NumPy, which holds no objects; its columns have numbers, or field names."""
    try:
        array = np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise _damaged(path, "NumPy", error) from error
    if array.dtype.names:
        return _of_arrays(path, {name: array[name] for name in array.dtype.names})
    columns = _of_arrays(path, {"": array if array.ndim > 1 else array[:, None]}).columns
    return Raw(path, {name.lstrip("."): values for name, values in columns.items()})


def read_mat(path: Path, layout: Layout) -> Raw:
    """Read variables of a MATLAB file; a field of a struct is called `struct.field`."""
    values = nested(read_variables(path))
    arrays = {n: v for n, v in values if isinstance(v, np.ndarray | str)}
    return _of_trials(path, arrays, layout.trials)


def _of_trials(path: Path, values: Mapping[str, Any], pattern: str) -> Raw:
    """Put the columns of all trials one after the other, with their number in the column `trial`.

    The pattern, such as `test*` or `trial.*`, is that of the names that hold one trial each; it is
    empty for a file that is one table.

    Raises:
        DataError: No name fits the pattern, or no column is in all trials.
    """
    if not pattern:
        raw = _of_arrays(path, values)
        return replace(raw, remarks=(*raw.remarks, *_likely_trials(values)))
    depth = pattern.count(".") + 1
    trials: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        words = name.split(".")
        owner = ".".join(words[:depth])
        if len(words) >= depth and fnmatch.fnmatchcase(owner, pattern):
            trials.setdefault(owner, {})[".".join(words[depth:])] = value
    if not trials:
        known = ", ".join(values) or "none"
        raise DataError(
            f"{path} has no variable {pattern!r}.", f"Its variables are {known}.",
            "Correct trials under [data].",
        )  # fmt: skip
    tables = [_with_fields(_of_arrays(path, trials[n])) for n in sorted(trials, key=by_number)]
    shared = [n for n in tables[0] if all(n in table for table in tables)]
    if not shared:
        raise DataError(
            f"The trials {pattern!r} of {path} have no column in common.",
            fix="Correct trials under [data].",
        )
    columns = {n.lstrip("."): np.concatenate([table[n] for table in tables]) for n in shared}
    numbers = [np.full(len(table[shared[0]]), k + 1.0) for k, table in enumerate(tables)]
    return Raw(path, {**columns, TRIAL: np.concatenate(numbers)})


def _likely_trials(names: Iterable[str]) -> Iterator[str]:
    """Yield the pattern of structs that differ in their number alone and hold the same names."""
    found: dict[str, dict[str, list[str]]] = {}
    for match in filter(None, map(NUMBERED.match, names)):
        trials = found.setdefault(match["stem"], {})
        trials.setdefault(match["number"], []).append(match["rest"])
    for stem, trials in found.items():
        first, *others = trials.values()
        if others and all(one == first for one in others):
            yield (
                f"{len(trials)} variables such as {stem}{next(iter(trials))} hold the same names;"
                f' where each is a run, state trials = "{stem}*" under [data], and the columns are'
                f" {', '.join(first)}"
            )


def _with_fields(raw: Raw) -> dict[str, Values]:
    """Return the columns of a trial, its single values among them."""
    fields = {name: np.full(len(raw), value) for name, value in raw.fields.items()}
    return {**raw.columns, **fields}


def _of_arrays(path: Path, values: Mapping[str, Any]) -> Raw:
    """Sort arrays into columns, as long as the longest axis of any, and single values."""
    fields: dict[str, float | str] = {}
    columns: dict[str, Values] = {}
    for name, value in values.items():
        array = np.asarray(value)
        if array.dtype.kind in "US" and array.size == 1:
            fields[name] = str(array.reshape(-1)[0])
        elif array.dtype.kind not in "fiubUS":  # complex numbers
            continue
        elif array.size == 1:
            fields[name] = float(array.reshape(-1)[0])
        elif array.size:
            columns |= _spread(name, array if array.dtype.kind in "US" else array.astype(float))
    return _longest(Raw(path, columns, fields))


def _longest(raw: Raw) -> Raw:
    """Return the columns of the most common length; the others are remarked on."""
    lengths = [len(values) for values in raw.columns.values()]
    if not lengths:
        return raw
    common = max(set(lengths), key=lambda n: (lengths.count(n), n))
    others = [name for name, values in raw.columns.items() if len(values) != common]
    if not others:
        return raw
    remark = f"{', '.join(others)} have another length than {common} and are not columns;"
    remark += " where each is a run, state trials = PATTERN under [data]"
    kept = {name: values for name, values in raw.columns.items() if name not in others}
    return Raw(raw.path, kept, raw.fields, (*raw.remarks, remark))


def _spread(name: str, values: Values) -> dict[str, Values]:
    """Return a matrix as its columns, `q.1`, `q.2` and so on; a vector as it is."""
    if values.ndim == 1:
        return {name: values}
    flat = values.reshape(values.shape[0], -1)
    if flat.shape[0] < flat.shape[1]:  # one row a channel
        flat = flat.T
    return {f"{name}.{k + 1}": flat[:, k] for k in range(flat.shape[1])}


def _damaged(path: Path, kind: str, error: Exception) -> DataError:
    why = str(error).splitlines()[0].partition(". ")[0].removesuffix(".")
    return DataError(
        f"{path} cannot be read as a {kind} file: {why}.",
        "It is damaged, cut off, or of another kind. Nothing of it was imported.",
        "Copy or save it again.",
    )
