"""Export of a log as CSV, Parquet or NPZ: one file for each topic, units in the headers."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.linear import CalibrationSet
from estimation.file_kinds import ARRAYS, CSV, PARQUET
from estimation.files import check_output
from rig.errors import MissingExtraError, UsageError
from rig.log.reader import LogFile, Topic, read_log
from rig.log.recalibrate import recalibrated
from rig.log.writer import PART_SUFFIX

CSV_ROWS = 10_000
"""Rows of a CSV file that are held in memory at a time."""

Columns = dict[str, NDArray[np.generic]]


class ExportFormat(Enum):
    """File formats a log can be exported to."""

    CSV = "csv"
    PARQUET = "parquet"
    NPZ = "npz"


KINDS = {ExportFormat.CSV: CSV, ExportFormat.PARQUET: PARQUET, ExportFormat.NPZ: ARRAYS}
"""What a file of each format is replaced by with `force`: its own kind."""


class ExportExistsError(UsageError):
    """The file to write is there already."""


def export_log(
    path: Path,
    export_format: ExportFormat,
    out: Path | None = None,
    topic: str | None = None,
    *,
    force: bool = False,
    calibrations: CalibrationSet | None = None,
) -> list[Path]:
    """Export a log, one file for each topic, and return the files.

    Every file has the column `log_time_ns` (ns since the Unix epoch, or since the run's start when
    that is not known) and one column for each field, named with its unit.

    Args:
        path: The log; it must not be damaged.
        export_format: Format to write.
        out: File to write, with one topic; else the folder to write to. Beside the log when None.
        topic: The one topic to export; all when None.
        force: Overwrite files that are there.
        calibrations: Make the SI samples again from the raw counts with these; as recorded if None.

    Raises:
        ExportExistsError: A file is there already and `force` is False; nothing is written then.
        OutputError: A file cannot be written, or one of another kind is there.
        UsageError: The log has no such topic.
        MissingExtraError: Parquet, without pyarrow.
        DamagedLogError: The log is damaged.
    """
    log = read_log(path, None if topic is None or calibrations is not None else [topic])
    if calibrations is not None:
        log = recalibrated(log, calibrations)
    if topic is not None:
        log = replace(log, topics={n: t for n, t in log.topics.items() if n == topic})
    if not log.topics:
        raise UsageError(f"{path} has no topics to export.")
    targets = _targets(log, export_format, out, single=topic is not None)
    taken = [target for target in targets.values() if target.exists()]
    if taken and not force:
        raise ExportExistsError(
            f"There is a file {taken[0]} already.", fix="Overwrite it with --force."
        )
    for target in targets.values():
        check_output(target, KINDS[export_format])
    for name, target in targets.items():
        with part_of(target) as part:
            _WRITERS[export_format](part, log.topics[name])
    return list(targets.values())


def _targets(
    log: LogFile, export_format: ExportFormat, out: Path | None, *, single: bool
) -> dict[str, Path]:
    if out is not None and single and not out.is_dir():
        return {next(iter(log.topics)): out}
    folder = log.path.parent if out is None else out
    if folder.exists() and not folder.is_dir():
        raise UsageError(
            f"{folder} is a file, and the log has {len(log.topics)} topics, one file each.",
            fix="Name a folder, or one topic with --topic.",
        )
    folder.mkdir(parents=True, exist_ok=True)
    stem = log.path.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")
    return {
        name: folder / f"{stem}.{name.strip('/').replace('/', '-')}.{export_format.value}"
        for name in log.topics
    }


@contextmanager
def part_of(target: Path) -> Iterator[Path]:
    """Yield the name to write a file under, in its folder; it is renamed when it is complete."""
    part = target.with_name(f".{target.name}.{os.getpid()}{PART_SUFFIX}")
    try:
        yield part
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


def _columns(topic: Topic) -> Columns:
    fields = {name: np.ascontiguousarray(topic.rows[name]) for name in topic.columns}
    return {"log_time_ns": topic.log_time_ns, **fields}


def _write_csv(path: Path, topic: Topic) -> None:
    columns = _columns(topic)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for first in range(0, topic.log_time_ns.size, CSV_ROWS):
            part = [values[first : first + CSV_ROWS].tolist() for values in columns.values()]
            file.writelines(",".join(map(repr, row)) + "\n" for row in zip(*part, strict=True))


def _write_parquet(path: Path, topic: Topic) -> None:
    """Write an Arrow table whose fields carry unit and description."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise MissingExtraError(
            "Parquet needs pyarrow, which is not installed.", "CSV and NPZ do not.", "parquet"
        ) from error
    notes = {
        "log_time_ns": {"unit": "ns", "description": "log time"},
        **{f.name: {"unit": f.unit, "description": f.description} for f in topic.stream.fields},
    }
    columns = {name: pa.array(values) for name, values in _columns(topic).items()}
    schema = [pa.field(name, values.type, metadata=notes[name]) for name, values in columns.items()]
    table = pa.table(list(columns.values()), schema=pa.schema(schema))
    parquet.write_table(table, path, compression="zstd")


def _write_npz(path: Path, topic: Topic) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **_columns(topic))


_WRITERS: dict[ExportFormat, Callable[[Path, Topic], None]] = {
    ExportFormat.CSV: _write_csv,
    ExportFormat.PARQUET: _write_parquet,
    ExportFormat.NPZ: _write_npz,
}
