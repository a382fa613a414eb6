"""Read MATLAB files of version 7.3, which are HDF5: numbers, text, structs and cells.

Arrays are stored there with their dimensions in reverse. A cell, and a field of an array of
structs, holds references to what is stored in the group `#refs#`. Values of other kinds (sparse
matrices, objects, function handles) are named, not read.
"""

from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import DataError, MissingExtraError
from rig.importers.mat5 import MAX_DEPTH, MAX_INFLATED_BYTES, Unread, Value


def read_mat73(path: Path) -> dict[str, Value]:
    """Return the variables of a file by name.

    Raises:
        DataError: It is damaged.
        MissingExtraError: The library h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError(
            f"{path} is a MATLAB file of version 7.3 (HDF5).",
            "h5py, which reads it, is not installed; files of versions 5 to 7 need no library:"
            " save(name, '-struct', 'data', '-v7').",
            "hdf5",
        ) from error
    try:
        with h5py.File(path, "r") as file:
            return _fields(file)
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise DataError(
            f"{path} cannot be read as a MATLAB file of version 7.3: {error}.",
            "Nothing of it was imported.",
            "Save it again in MATLAB.",
        ) from error


def _fields(group: Any, depth: int = 0) -> dict[str, Value]:
    if depth > MAX_DEPTH:
        raise ValueError(f"structs are nested more than {MAX_DEPTH} deep")
    return {name: _value(group[name], depth) for name in group if not name.startswith("#")}


def _value(item: Any, depth: int) -> Value:
    kind = _kind(item)
    if "MATLAB_sparse" in item.attrs:
        return Unread("sparse")
    if hasattr(item, "keys"):
        return _several(item, depth) if _is_array(item) else _fields(item, depth + 1)
    if item.dtype.kind in "cV":
        return Unread("complex")
    if kind in ("function_handle", "object"):
        return Unread(kind)
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.empty(0)
    if item.size * item.dtype.itemsize > MAX_INFLATED_BYTES:
        raise ValueError(f"{item.name} has more than {MAX_INFLATED_BYTES >> 30} GB")
    values = item[()]
    if item.dtype.kind == "O":  # references
        cells = enumerate(np.ravel(values), start=1)
        return {str(k): _value(item.file[reference], depth + 1) for k, reference in cells}
    if kind == "char":
        if values.shape[-1:] != (1,) and values.ndim > 1:
            return Unread("text of several rows")
        return str(values.astype("<u2").tobytes(), "utf-16-le")
    return np.asarray(values.T.squeeze())


def _kind(item: Any) -> str:
    """Return the MATLAB class of a value; that of numbers where a file states none."""
    kind = item.attrs.get("MATLAB_class", b"double")
    return kind.decode("ascii") if isinstance(kind, bytes) else str(kind)


def _is_array(group: Any) -> bool:
    """Whether a group is an array of structs: each field a table of references, of no class."""
    members = [group[name] for name in group]
    return bool(members) and all(
        not hasattr(m, "keys") and m.dtype.kind == "O" and "MATLAB_class" not in m.attrs
        for m in members
    )


def _several(group: Any, depth: int) -> dict[str, Value]:
    """Return the structs of an array, by their numbers from 1."""
    fields = {name: _value(group[name], depth + 1) for name in group}
    count = min(len(values) for values in fields.values() if isinstance(values, dict))
    return {
        str(k): {name: v[str(k)] for name, v in fields.items() if isinstance(v, dict)}
        for k in range(1, count + 1)
    }
