"""A campaign as one tidy table: a row a sample, with its run and conditions, in Parquet or CSV."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import unit_or_none
from estimation.files import OutputError, check_output, write_text_atomic
from estimation.recording import Recording
from rig.errors import DataError
from rig.log.export import KINDS, ExportFormat, part_of

RUN, FLAGS, TIME = "run", "flags", "time_s"
CONDITION = "condition_"
"""What the name of a condition's column begins with, so that no channel's name is taken twice."""


def write_tidy(campaign: Campaign, path: Path, format_: ExportFormat, force: bool) -> Path:
    """Write all runs of a campaign that count into one table; one run is held in memory at a time.

    Columns: `run`, one for each condition, `time_s`, `flags`, one for each channel that any run has
    (NaN where a run lacks it). Parquet holds the unit of each column in its field's metadata, and
    each run's rig, instrument, conditions, calibrations, notes and start in the table's metadata
    under `rig.runs`, as JSON. Beside a CSV both stand in `NAME.csv.json`.

    Excluded runs are left out. With `force` a file that is there is replaced.

    Raises:
        DataError: No run counts, or one is damaged.
        OutputError: The file is there already, or cannot be written.
    """
    if not len(campaign.evidence):
        raise DataError("No run counts, so there is nothing to export.")
    if path.exists() and not force:
        raise OutputError(f"There is a file {path} already.", fix="Overwrite it with --force.")
    check_output(path, KINDS[format_])
    schema = _schema(campaign.evidence)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part_of(path) as part, _writer(part, schema, format_) as writer:
            for table in _tables(campaign.evidence, schema):
                writer.write_table(table)
    except OSError as error:
        raise OutputError(f"{path} cannot be written.", str(error)) from error
    if format_ is ExportFormat.CSV:
        units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in schema}
        about = {"units": units, "runs": json.loads(schema.metadata[b"rig.runs"])}
        write_text_atomic(path.with_name(f"{path.name}.json"), json.dumps(about, indent=1) + "\n")
    return path


def _schema(campaign: Campaign) -> Any:
    """Return the Arrow schema of all runs: conditions and channels in order of appearance."""
    import pyarrow as pa

    runs: dict[str, Any] = {}
    conditions: dict[str, bool] = {}
    channels: dict[str, None] = {}
    for recording in campaign:
        runs[recording.name] = _about(recording)
        channels |= dict.fromkeys(recording.columns)
        for name, value in recording.conditions.items():
            conditions[name] = conditions.get(name, True) and not isinstance(value, str)
    fields = [pa.field(RUN, pa.string())]
    fields += [
        pa.field(
            f"{CONDITION}{name}", pa.float64() if number else pa.string(), metadata=_unit(name)
        )
        for name, number in conditions.items()
    ]
    fields += [pa.field(TIME, pa.float64(), metadata=_unit(TIME)), pa.field(FLAGS, pa.uint8())]
    fields += [pa.field(name, pa.float64(), metadata=_unit(name)) for name in channels]
    return pa.schema(fields, metadata={"rig.runs": json.dumps(runs)})


def _unit(name: str) -> dict[str, str]:
    unit = unit_or_none(name)
    return {} if unit is None else {"unit": unit}


def _about(recording: Recording) -> dict[str, Any]:
    """Return the metadata of a run as plain JSON types."""
    own = recording.instrument
    return {
        "rig": recording.rig,
        "instrument": {"model": own.model, "serial": own.serial},
        "conditions": dict(recording.conditions),
        "calibrations": dict(recording.calibrations),
        "notes": recording.notes,
        "started_at_ns": recording.started_at_ns,
    }


def _tables(campaign: Campaign, schema: Any) -> Iterator[Any]:
    import pyarrow as pa

    for recording in campaign:
        count = len(recording)
        columns = {
            RUN: [recording.name] * count,
            TIME: recording.time_s,
            FLAGS: recording.flags.astype(np.uint8),
            **recording.columns,
        }
        for field in schema:
            if field.name.startswith(CONDITION):
                value = recording.conditions.get(field.name.removeprefix(CONDITION))
                as_text = value is not None and field.type == pa.string()
                columns[field.name] = [str(value) if as_text else value] * count
            elif field.name not in columns:
                columns[field.name] = np.full(count, np.nan)
        yield pa.table({name: columns[name] for name in schema.names}, schema=schema)


def _writer(path: Path, schema: Any, format_: ExportFormat) -> Any:
    if format_ is ExportFormat.PARQUET:
        from pyarrow import parquet

        return parquet.ParquetWriter(path, schema, compression="zstd")
    from pyarrow import csv

    return csv.CSVWriter(path, schema)
