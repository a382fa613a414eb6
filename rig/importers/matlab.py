"""Import MATLAB `.mat` files of versions 5 to 7.

Mapping rules. A *run* is either the file itself, where it has a variable `time_s`, or each scalar
struct with a field `time_s` (a table saved with `table2struct(t, 'ToScalar', true)`); a file may
hold one or the other. In a run,

- a numeric vector as long as `time_s` whose name ends in a unit is a channel (`motor_current_a`),
- a numeric scalar whose name ends in a unit is a condition (`load_command_a`),
- text is a condition, except `notes`, which becomes the notes.

Closing motion and torque are positive, and units are SI: the file's author sees to that, or a
sidecar `<file>.mat.toml` does, which maps other names:

    sample_rate_hz = 1000               # where there is no time variable
    [channels.spindle_angle_rad]
    variable = "enc"
    scale = -7.669904e-4                # default 1; value = scale * raw + offset
    offset = 0.0                        # default 0, in the channel's unit
    [conditions]
    load_command_a = 0.2

With a sidecar, only what it names is imported, and `variable` may be `struct.field`.
"""

import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation.campaign import Campaign, Run
from estimation.channels import CHANNELS, UnknownUnitError, unit_of
from estimation.recording import FloatArray, Recording, RecordingError
from rig.errors import DataError

TIME = "time_s"
MAX_BYTES = 1 << 31
HDF5_VERSION = b"MATLAB 7.3 MAT-file"
CHANNEL_KEYS = {"variable", "scale", "offset"}
SIDECAR_KEYS = {"sample_rate_hz", "channels", "conditions"}

Values = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class MappedChannel:
    """One channel of a sidecar: which variable it is and how it becomes SI."""

    variable: str
    scale: float
    offset: float


@dataclass(frozen=True, slots=True)
class Sidecar:
    """A sidecar: which variable becomes which channel."""

    channels: dict[str, MappedChannel]
    conditions: dict[str, float | str]
    sample_rate_hz: float | None


class MatlabImporter:
    """Importer of MATLAB files."""

    name = "matlab"
    description = (
        "MATLAB .mat (v5 to v7): vectors or structs named as channels, or with a .mat.toml"
    )

    def recognises(self, path: Path) -> bool:
        """Say whether the path is a `.mat` file, or a folder of nothing but these and sidecars.

        A folder that holds other files beside is not claimed: name the format to import it.
        """
        if path.is_dir():
            names = [entry.name.lower() for entry in path.iterdir()]
            if not all(name.endswith((".mat", ".mat.toml")) for name in names):
                return False
        return bool(_files(path))

    def open(self, path: Path) -> Campaign:
        """Open a file, or the files of a folder sorted by name, as a campaign.

        Each file is read once here to find its runs, and again when a run is loaded.

        Raises:
            DataError: A file is damaged, of version 7.3, or holds names that are no channels; lists
                what was found and what was expected.
        """
        files = _files(path)
        if not files:
            raise DataError(f"{path} holds no .mat file.")
        runs = []
        for file in files:
            for part in _parts(file, _variables(file), _sidecar(file)):
                name = f"{file.stem}/{part}" if part else file.stem
                runs.append(Run(name, partial(load_run, file, name, part), file))
        return Campaign(tuple(runs))


IMPORTER = MatlabImporter()


def load_run(path: Path, name: str, part: str | None) -> Recording:
    """Read one run.

    Args:
        path: The file.
        name: Name of the run.
        part: Name of the struct that holds the run, or None for the file's own variables.

    Raises:
        DataError: The file is damaged or its names do not follow the rules of this module.
    """
    variables = _variables(path)
    sidecar = _sidecar(path)
    if sidecar is not None:
        columns, conditions, notes = _mapped(path, variables, sidecar)
    else:
        values = variables[part] if part else variables
        columns, conditions, notes = _named(path, values)
    try:
        return Recording(
            name=name,
            time_s=columns.pop(TIME),
            columns=columns,
            conditions=conditions,
            notes=notes,
            source=f"{path}:{part}" if part else str(path),
        )
    except RecordingError as error:
        raise DataError(f"{path}: {error.what}", error.why, error.fix) from error


def _files(path: Path) -> list[Path]:
    entries = sorted(path.iterdir()) if path.is_dir() else [path]
    return [entry for entry in entries if entry.suffix.lower() == ".mat" and entry.is_file()]


def _variables(path: Path) -> dict[str, Any]:
    """Return the variables of a file; scalar structs become dictionaries."""
    from scipy.io import loadmat

    with path.open("rb") as file:
        if file.read(len(HDF5_VERSION)) == HDF5_VERSION:
            raise DataError(
                f"{path} is a MATLAB file of version 7.3 (HDF5), which is not read.",
                "Versions 5 to 7 are.",
                "Save it again in MATLAB: save(name, '-struct', 'data', '-v7').",
            )
    if path.stat().st_size > MAX_BYTES:
        raise DataError(f"{path} has more than {MAX_BYTES >> 30} GB.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a variable that is there twice, a header that is odd
            loaded = loadmat(path, simplify_cells=True)
    except Exception as error:  # the reader raises many types on damage
        raise DataError(
            f"{path} cannot be read as a MATLAB file: {error}.",
            "Expected version 5 to 7, whole. Nothing of it was imported.",
            "Save it again in MATLAB with '-v7'.",
        ) from error
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _parts(path: Path, variables: Values, sidecar: Sidecar | None) -> list[str | None]:
    """Return which runs a file holds: [None] for its own variables, or names of structs."""
    if sidecar is not None:
        return [None]
    structs = [n for n, value in variables.items() if isinstance(value, dict) and TIME in value]
    if TIME in variables:
        _named(path, variables)
        return [None]
    if not structs or len(structs) < len(variables):
        raise _unknown(path, variables, [n for n in variables if n not in structs])
    for struct in structs:
        _named(path, variables[struct])
    return list(structs)


def _named(path: Path, values: Values) -> tuple[dict[str, FloatArray], dict[str, Any], str]:
    """Sort values into channels, conditions and notes by their names and shapes."""
    columns: dict[str, FloatArray] = {}
    conditions: dict[str, float | str] = {}
    notes = ""
    wrong = []
    length = np.size(values[TIME])
    for name, value in values.items():
        if isinstance(value, str):
            notes, conditions = (
                (value, conditions)
                if name == "notes"
                else (
                    notes,
                    conditions | {name: value},
                )
            )
        elif not _carries_unit(name) or not _is_numeric(value):
            wrong.append(name)
        elif np.ndim(value) == 1 and np.size(value) == length:
            columns[name] = np.asarray(value, np.float64)
        elif np.ndim(value) == 0:
            conditions[name] = float(value)
        else:
            wrong.append(name)
    if wrong or TIME not in columns:
        raise _unknown(path, values, wrong)
    _check_finite(path, columns)
    return columns, conditions, notes


def _mapped(
    path: Path, variables: Values, sidecar: Sidecar
) -> tuple[dict[str, FloatArray], dict[str, Any], str]:
    """Take what a sidecar names, scaled."""
    columns = {}
    for name, channel in sidecar.channels.items():
        value: Any = variables
        for key in channel.variable.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        if not _is_numeric(value) or np.ndim(value) != 1:
            raise DataError(
                f"{path}: {channel.variable!r}, which the sidecar maps to {name}, is no numeric "
                "vector of this file.",
                f"Found: {_listing(variables)}.",
                f"Correct `variable` in {_sidecar_path(path).name}.",
            )
        columns[name] = channel.scale * np.asarray(value, np.float64) + channel.offset
    lengths = {name: values.size for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"{path}: the channels differ in length: {lengths}.")
    if TIME not in columns and sidecar.sample_rate_hz is not None:
        columns[TIME] = np.arange(next(iter(lengths.values()))) / sidecar.sample_rate_hz
    _check_finite(path, columns)
    return columns, dict(sidecar.conditions), ""


def _sidecar_path(path: Path) -> Path:
    return path.with_name(path.name + ".toml")


def _sidecar(path: Path) -> Sidecar | None:
    """Read `<file>.mat.toml` where there is one."""
    file = _sidecar_path(path)
    if not file.is_file():
        return None
    try:
        content = tomllib.loads(file.read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{file} is no TOML: {error}.") from error
    channels = content.get("channels")
    rate = content.get("sample_rate_hz")
    conditions = content.get("conditions", {})
    if (
        set(content) - SIDECAR_KEYS
        or not isinstance(channels, dict)
        or not channels
        or not all(_is_mapping(name, entry) for name, entry in channels.items())
        or not isinstance(conditions, dict)
        or not all(isinstance(value, int | float | str) for value in conditions.values())
        or (TIME in channels) == (rate is not None)
        or not (rate is None or (isinstance(rate, int | float) and rate > 0))
    ):
        raise DataError(
            f"{file} does not map variables to channels.",
            "Expected [channels.<name with unit>] tables of `variable` and, if needed, `scale` and "
            "`offset`; either a channel time_s or a positive sample_rate_hz; [conditions] if "
            "needed; nothing else.",
            "See the docstring of rig.importers.matlab for an example.",
        )
    return Sidecar(
        {
            name: MappedChannel(
                entry["variable"], float(entry.get("scale", 1)), float(entry.get("offset", 0))
            )
            for name, entry in channels.items()
        },
        {name: v if isinstance(v, str) else float(v) for name, v in conditions.items()},
        None if rate is None else float(rate),
    )


def _is_mapping(name: str, entry: object) -> bool:
    return (
        _carries_unit(name)
        and isinstance(entry, dict)
        and set(entry) <= CHANNEL_KEYS
        and isinstance(entry.get("variable"), str)
        and all(isinstance(entry.get(key, 0), int | float) for key in ("scale", "offset"))
    )


def _carries_unit(name: str) -> bool:
    try:
        unit_of(name)
    except UnknownUnitError:
        return False
    return True


def _is_numeric(value: object) -> bool:
    return isinstance(value, int | float | np.number | np.ndarray) and (
        np.asarray(value).dtype.kind in "fiub"
    )


def _check_finite(path: Path, columns: Mapping[str, FloatArray]) -> None:
    for name, values in columns.items():
        if not np.isfinite(values).all():
            index = int(np.argmin(np.isfinite(values)))
            raise DataError(
                f"{path}: {name} is not finite at sample {index + 1}.",
                "A recording has no NaN; a sample that is not there is flagged.",
                "Cut or repair the vector where the file is made.",
            )


def _listing(values: Values) -> str:
    entries = [
        f"{name} (struct of {', '.join(value)})"
        if isinstance(value, dict)
        else f"{name} {type(value).__name__ if np.ndim(value) == 0 else np.shape(value)}"
        for name, value in values.items()
    ]
    return ", ".join(entries) or "nothing"


def _unknown(path: Path, values: Values, wrong: list[str]) -> DataError:
    return DataError(
        f"{path}: no run could be made of its variables"
        + (f"; not understood: {', '.join(wrong)}." if wrong else "."),
        f"Found: {_listing(values)}. Expected time_s and vectors of its length named as channels "
        f"with units ({', '.join(CHANNELS)}), at the top or in scalar structs.",
        f"Rename them, or map them in {_sidecar_path(path).name}.",
    )
