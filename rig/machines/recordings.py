"""Recordings of a machine that a file describes, and which of them have it in motion."""

import csv
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from estimation.campaign import Campaign
from estimation.derived import measured_channels
from estimation.model import Model
from estimation.plant import Plant
from estimation.plant_equations import integrals
from estimation.recording import Recording
from rig.importers.log import IMPORTER as LOGS
from rig.importers.registry import format_of, open_campaign
from rig.importers.table.data import TIME, Data
from rig.importers.table.mapping import ColumnMapping, read_mapping
from rig.importers.table.open import open_table
from rig.machines.shipped import place_of, read_machine


def open_recordings(
    path: Path,
    machine: Path | None = None,
    format_name: str | None = None,
    skip_bad: bool = False,
) -> Campaign:
    """Open recordings as `open_campaign` does, those of a foreign table by the file's `[data]`.

    Without `[data]`, CSV files are read whose columns have the names of the machine's channels.

    The machine is a file or the name of a shipped one; None is the reference rig.

    Raises:
        NoPlantError: No such machine.
    """
    if machine is None:
        return open_campaign(path, format_name, skip_bad)
    file = place_of(machine)
    foreign = format_name is None and not LOGS.recognises(path)
    if foreign and (mapping := mapping_of(path, file)) is not None:
        campaign = open_table(path, mapping, skip_bad)
    else:
        campaign = open_campaign(path, format_name, skip_bad)
    return with_positions(campaign, read_machine(file))


def mapping_of(path: Path, file: Path) -> ColumnMapping | None:
    """Return how tables are read: by `[data]` of a machine file, or by the names of its channels.

    Without `[data]`, None where a CSV file lacks a channel or the time in seconds: its columns have
    to be stated. And None where an importer recognises the files, such as a table that rig wrote.
    """
    if has_data(file):
        return read_mapping(file, ())
    plant = read_machine(file)
    of_loads = [load.name for load in plant.loads]
    drives, sensors = ([part.name for part in of] for of in (plant.actuators, plant.sensors))
    columns = {name: name for name in (TIME, *drives, *sensors, *of_loads)}
    tables = sorted(path.glob("*.csv")) if path.is_dir() else [path] * path.is_file()
    if not tables or not all(columns.keys() <= _head(table) for table in tables):
        return None
    if format_of(path) is not None:
        return None
    data = Data.model_validate({"files": "*.csv", "columns": columns})
    return ColumnMapping(data, file)


def _head(table: Path) -> set[str]:
    """Return the cells of a table's first line."""
    with table.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
        return {cell.strip() for cell in next(csv.reader(stream), [])}


def with_positions(campaign: Campaign, plant: Plant) -> Campaign:
    """Return a campaign with the integrals of speeds that stand for positions, 0 at the start."""
    if not (integrated := integrals(plant)):
        return campaign
    return Campaign(
        tuple(replace(r, load=partial(_positioned, r.load, integrated)) for r in campaign.runs)
    )


def _positioned(load: Callable[[], Recording], integrals: Mapping[str, str]) -> Recording:
    recording = load()
    columns = {}
    for position, speed in integrals.items():
        if speed in recording and position not in recording:
            known = np.isfinite(recording[speed])
            values = np.interp(recording.time_s, recording.time_s[known], recording[speed][known])
            columns[position] = cumulative_trapezoid(values, recording.time_s, initial=0)
    return recording.with_columns(**columns)


def recorded_channels(machine: Path) -> list[str]:
    """Return the channels that recordings have by the `[data]` of a machine file; none without.

    Raises:
        UsageError: The file cannot be read.
        NoPlantError: No such machine.
    """
    file = place_of(machine)
    if not has_data(file):
        return []
    data = read_mapping(file, ()).data
    stated = [*data.columns, *data.formulas]
    return [*stated, *(p for p, s in integrals(read_machine(file)).items() if s in stated)]


def formulas_of(machine: Path) -> dict[str, str]:
    """Return the channels of a machine file that are formulas of others, as `recorded_channels`."""
    file = place_of(machine)
    return dict(read_mapping(file, ()).data.formulas) if has_data(file) else {}


def has_data(file: Path) -> bool:
    """Whether a machine file states how a foreign table is read."""
    return "data" in tomllib.loads(file.read_text("utf-8"))


def with_motion(campaign: Campaign, models: Sequence[Model]) -> Campaign:
    """Return a campaign with the runs excluded that have too few samples in motion.

    A declared equation whose channels were not recorded decides nothing.
    """
    kept = Campaign.of(_checked(recording, models) for recording in campaign.evidence)
    checked = {run.name: run for run in kept.runs}
    return Campaign(tuple(checked.get(run.name, run) for run in campaign.runs))


def _checked(recording: Recording, models: Sequence[Model]) -> Recording:
    from estimation.causes.run_signals import LEAST, samples_in_motion  # a view needs none of it

    if recording.excluded is not None:
        return recording
    for model in models:
        needed = measured_channels([*model.channels, model.target], model.signals)
        there = all(name in recording for name in needed)
        if there and samples_in_motion(model, recording) < LEAST:
            return recording.exclude(f"too few samples in motion for {model.balance}")
    return recording
