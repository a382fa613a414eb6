"""Reads a campaign's table back that `rig log export FOLDER` wrote (`rig.importers.tidy`)."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation.campaign import Campaign, Run
from estimation.recording import Instrument, Recording
from rig.errors import DataError, MissingExtraError
from rig.importers.tidy import CONDITION, FLAGS, RUN, TIME

RUNS = b"rig.runs"


class TidyImporter:
    """Importer of the project's own tables, by what stands with them about their runs."""

    name = "tidy"
    description = "a table that `rig log export FOLDER` wrote: Parquet, or CSV with its .json"

    def recognises(self, path: Path) -> bool:
        """Whether a file is such a table."""
        if path.suffix == ".csv":
            beside = _beside(path)
            return beside.is_file() and '"runs"' in beside.read_text()
        if path.suffix != ".parquet" or not path.is_file():
            return False
        with path.open("rb") as file:  # the metadata stand at the end
            file.seek(max(0, path.stat().st_size - (1 << 20)))
            return RUNS in file.read()

    def open(self, path: Path) -> Campaign:
        """Open a table as a campaign; the rows of a run are read when it is.

        Raises:
            MissingExtraError: pyarrow is not installed.
            DataError: What the table states of its runs cannot be read.
        """
        try:
            about = _about(path)
        except ImportError as error:
            why = "The table's own library."
            raise MissingExtraError(f"{path} needs pyarrow.", why, "parquet") from error
        except (OSError, ValueError, KeyError) as error:
            raise DataError(f"{path} cannot be read.", str(error), "Export it again.") from error
        return Campaign(
            tuple(Run(n, partial(_read, path, n, own), path) for n, own in about.items())
        )


IMPORTER = TidyImporter()


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}.json")


def _about(path: Path) -> dict[str, Any]:
    """Return the statements of each run, by its name."""
    from pyarrow import parquet

    if path.suffix == ".csv":
        return dict(json.loads(_beside(path).read_text())["runs"])
    return dict(json.loads(parquet.read_schema(path).metadata[RUNS]))


def _read(path: Path, name: str, about: dict[str, Any]) -> Recording:
    from pyarrow import compute, csv, parquet

    if path.suffix == ".csv":
        table = csv.read_csv(path)
        table = table.filter(compute.equal(table[RUN].cast("string"), name))
    else:
        table = parquet.read_table(path, filters=[(RUN, "=", name)])
    columns = {
        column: table[column].to_numpy().astype(np.float64)
        for column in table.column_names
        if column not in (RUN, FLAGS, TIME) and not column.startswith(CONDITION)
    }
    return Recording(
        name=name,
        time_s=table[TIME].to_numpy(),
        columns={n: values for n, values in columns.items() if not np.isnan(values).all()},
        flags=table[FLAGS].to_numpy().astype(np.uint8),
        conditions=about["conditions"],
        rig=about["rig"],
        instrument=Instrument(**about["instrument"]),
        notes=about["notes"],
        started_at_ns=about["started_at_ns"],
        calibrations=about["calibrations"],
        source=str(path),
    )
