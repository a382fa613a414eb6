"""Import MATLAB `.mat` files of versions 5 to 7.3.

Mapping rules. A *run* is either the file itself, where it has a variable `time_s`, or each scalar
struct with a field `time_s` (a table saved with `table2struct(t, 'ToScalar', true)`); a file may
hold one or the other. In a run,

- a numeric vector as long as `time_s` whose name ends in a unit is a channel (`motor_current_a`),
- a numeric scalar whose name ends in a unit is a condition (`load_command_a`),
- text is a condition, except `notes`, which becomes the notes.

Anything else is refused, with the list of what was found; `rig import` maps other names and units.
Closing motion and torque are positive, and units are SI.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign, Run
from estimation.channels import CHANNELS, unit_or_none
from estimation.recording import FloatArray, Recording, RecordingError
from rig.errors import DataError
from rig.importers.mat5 import Mat5Error, Unread, Value, read_mat5
from rig.importers.registry import files_ending

TIME = "time_s"
MAX_BYTES = 1 << 31
HDF5_VERSION = b"MATLAB 7.3 MAT-file"
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"  # after the 512 bytes MATLAB puts before it

Values = Mapping[str, Value]


class MatlabImporter:
    """Importer of MATLAB files."""

    name = "matlab"
    description = "MATLAB .mat (v5 to v7.3): vectors or structs named as channels"

    def recognises(self, path: Path) -> bool:
        """Whether the path is a `.mat` file, or a folder of nothing but these.

        A folder with other files is not recognised: name the format to import it.
        """
        if path.is_dir():
            names = [entry.name.lower() for entry in path.iterdir()]
            if not all(name.endswith(".mat") for name in names):
                return False
        return bool(files_ending(path, ".mat"))

    def open(self, path: Path) -> Campaign:
        """Open a file, or the files of a folder sorted by name, as a campaign.

        Each file is read and checked once here to find its runs, and again when a run is loaded.

        Raises:
            DataError: A file is damaged, or contains names that are not channels.
                The message lists the found and the expected names.
        """
        files = files_ending(path, ".mat")
        if not files:
            raise DataError(f"{path} holds no .mat file.")
        runs = []
        for file in files:
            for part in _contents(file):
                name = f"{file.stem}/{part}" if part else file.stem
                runs.append(Run(name, partial(load_run, file, name, part), file))
        return Campaign(tuple(runs))


IMPORTER = MatlabImporter()


def load_run(path: Path, name: str, part: str = "") -> Recording:
    """Read one run: that of the struct `part`, or "" for the file's own variables.

    Raises:
        DataError: The file is damaged or its names do not follow the rules of this module.
    """
    contents = _contents(path)
    if part not in contents:
        raise DataError(f"{path} no longer holds the run {part or path.stem!r}.")
    try:
        return Recording(name, **contents[part], source=f"{path}:{part}" if part else str(path))
    except RecordingError as error:
        raise DataError(f"{path}: {error.what}", error.why, error.fix) from error


def _contents(path: Path) -> dict[str, dict[str, Any]]:
    """Return the fields of each run's recording, by the name of its struct; "" is the file."""
    variables = read_variables(path)
    if TIME in variables:
        return {"": _named(path, variables)}
    structs = {name: v for name, v in variables.items() if isinstance(v, dict) and TIME in v}
    if not structs or len(structs) < len(variables):
        raise _unknown(path, variables, [name for name in variables if name not in structs])
    return {name: _named(path, fields) for name, fields in structs.items()}


def read_variables(path: Path) -> dict[str, Value]:
    """Return the variables of a MATLAB file by name.

    Raises:
        DataError: It cannot be read, or is damaged.
        MissingExtraError: It is of version 7.3, and the library h5py is not installed.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise DataError(f"{path} has more than {MAX_BYTES >> 30} GB.")
        with path.open("rb") as file:
            head = file.read(512 + len(HDF5_SIGNATURE))
            is_hdf5 = head.startswith(HDF5_VERSION) or head[512:] == HDF5_SIGNATURE
            content = b"" if is_hdf5 else head + file.read()
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}.") from error
    if is_hdf5:
        from rig.importers.mat73 import read_mat73

        return read_mat73(path)
    try:
        return read_mat5(content)
    except Mat5Error as error:
        raise DataError(
            f"{path} cannot be read as a MATLAB file: {error}.",
            "Expected version 5 to 7, whole. Nothing of it was imported.",
            "Save it again in MATLAB with '-v7'.",
        ) from error


def _named(path: Path, values: Values) -> dict[str, Any]:
    """Sort values into time, channels, conditions and notes by their names and shapes."""
    time = values[TIME]
    shape = time.shape if isinstance(time, np.ndarray) and time.ndim == 1 else None
    columns: dict[str, FloatArray] = {}
    conditions: dict[str, float | str] = {}
    wrong = []
    for name, value in values.items():
        if isinstance(value, str):
            if name != "notes":
                conditions[name] = value
        elif not isinstance(value, np.ndarray) or unit_or_none(name) is None:
            wrong.append(name)
        elif value.shape == shape:
            columns[name] = _finite(path, name, value)
        elif value.ndim == 0 and name != TIME:
            conditions[name] = float(_finite(path, name, value))
        else:
            wrong.append(name)
    if wrong:
        raise _unknown(path, values, wrong)
    notes = str(values.get("notes", ""))
    time_s = columns.pop(TIME)
    return {"time_s": time_s, "columns": columns, "conditions": conditions, "notes": notes}


def _finite(path: Path, name: str, values: NDArray[np.generic]) -> FloatArray:
    array = values.astype(np.float64)
    if not np.isfinite(array).all():
        sample = int(np.argmin(np.isfinite(array))) + 1
        raise DataError(
            f"{path}: {name} is not finite at sample {sample}.",
            "A recording has no NaN; a sample that is not there is flagged.",
            "Cut or repair the vector where the file is made.",
        )
    return array


def _kind(value: Value) -> str:
    if isinstance(value, dict):
        return f"(struct of {', '.join(value)})"
    if isinstance(value, Unread):
        return f"({value.kind})"
    if isinstance(value, str):
        return "(text)"
    return str(value.shape) if value.ndim else "(scalar)"


def _unknown(path: Path, values: Values, wrong: list[str]) -> DataError:
    found = ", ".join(f"{name} {_kind(value)}" for name, value in values.items()) or "nothing"
    return DataError(
        f"{path}: no run could be made of its variables"
        + (f"; not understood: {', '.join(wrong)}." if wrong else "."),
        f"Found: {found}. Expected time_s and vectors of its length named as channels "
        f"with units ({', '.join(CHANNELS)}), at the top or in scalar structs.",
        "Rename them, or map them: rig import FILE --column motor_angle_rad=NAME:deg.",
    )
