"""A machine file from a few words, typed as options or answered on a terminal."""

import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from estimation.channels import UnknownUnitError, unit_of
from estimation.plant import Actuator, Axis, Plant, PlantError, Reads, Sensor, Transmission
from estimation.toml_table import value_text
from rig.errors import DataError, UsageError

if TYPE_CHECKING:
    from rig.importers.table.raw import Raw, Values

MOST_REMARK = 100
"""Characters of a remark on a column."""

PARTS = {
    "axis": ("NAME:rad or NAME:m", ""),
    "transmission": ("INPUT:OUTPUT:RATIO", ""),
    "actuator": ("AXIS:CHANNEL", ", such as motor:motor_current_a"),
    "sensor": ("AXIS:CHANNEL", ", such as motor:motor_angle_rad, or CHANNEL of no axis"),
}
"""Kind of a part of a machine to the form of the words that state one, and an example."""

READS: Mapping[str, Reads] = {
    "rad": "position",
    "m": "position",
    "rad/s": "speed",
    "m/s": "speed",
    "N m": "effort",
    "N": "effort",
    "K": "temperature",
}
"""Unit of a channel to the quantity that its sensor reads."""

MOTIONS = ("position", "speed")
"""What a sensor reads of an axis in any case; any other may be of none, such as a thrust."""


def asked(table: Path | None) -> dict[str, list[str]]:
    """Ask for the parts of a machine, which has a table of data or none, on a terminal."""
    if not sys.stdin.isatty():
        raise UsageError(
            "Nothing states what the machine is.",
            "There is no terminal to ask on.",
            "Give --axis NAME:rad, --actuator AXIS:CHANNEL and --sensor AXIS:CHANNEL."
            + (f" `rig import {table} --preview` lists the columns." if table else ""),
        )
    found: dict[str, list[str]] = {kind: [] for kind in PARTS}
    for kind, (form, example) in PARTS.items():
        if kind == "transmission" and len(found["axis"]) < 2:
            continue
        question = f"{kind.capitalize()}, {form}{example} (empty: no more)"
        while word := typer.prompt(question, default="", show_default=False, err=True).strip():
            found[kind].append(word)
    return found


def plant_of(name: str, words: Mapping[str, Sequence[str]]) -> Plant:
    """Return the machine that words for its kinds of parts state; a wrong one is a UsageError."""
    try:
        parts = {kind: [_parts(kind, word) for word in words[kind]] for kind in PARTS}
        read = {a for a, channel in parts["sensor"] if reads_of(channel) in ("position", "speed")}
        return Plant(
            name=name,
            axes=tuple(Axis(axis, unit) for axis, unit in parts["axis"]),
            transmissions=tuple(_transmission(one, read) for one in parts["transmission"]),
            actuators=tuple(Actuator(channel, axis) for axis, channel in parts["actuator"]),
            sensors=tuple(_sensor(axis, channel) for axis, channel in parts["sensor"]),
        )
    except (PlantError, UnknownUnitError) as error:
        raise UsageError(error.what, error.why, error.fix) from error


def _parts(kind: str, word: str) -> list[str]:
    parts, (form, _) = word.split(":"), PARTS[kind]
    if kind == "sensor" and len(parts) == 1 and reads_of(word) not in MOTIONS:
        return ["", word]
    most = 3 if kind == "transmission" else 2
    if not 2 <= len(parts) <= most or not all(parts[:2]):
        fix = f"Write --{kind} {form}."
        raise UsageError(f"--{kind} {word!r} is not {form}.", fix=fix)
    return parts


def _transmission(parts: Sequence[str], read: Collection[str]) -> Transmission:
    """Return a transmission; it bends measurably where the travel of both its axes is read."""
    ratio = None
    if len(parts) > 2:
        try:
            ratio = float(parts[2])
        except ValueError:
            raise UsageError(
                f"The ratio {parts[2]!r} is not a number.",
                fix="Write the travel of the input per travel of the output, such as 35.",
            ) from None
    compliant = {*parts[:2]} <= {*read}
    return Transmission(f"{parts[0]}_to_{parts[1]}", parts[0], parts[1], ratio, compliant)


def _sensor(axis: str, channel: str) -> Sensor:
    """Return a sensor; an effort that no axis passes on is of nothing else that is known."""
    reads = reads_of(channel)
    return Sensor(channel, axis, "other" if reads == "effort" and not axis else reads)


def reads_of(channel: str) -> Reads:
    """Return the quantity a sensor reads, by the unit and the name of its channel."""
    return "reference" if channel.startswith("target_") else READS.get(unit_of(channel), "other")


UNMAPPED = "COLUMN:UNIT"
"""Source of a channel that is yet to be stated."""

FILE_NAME = r"# file_name = 'run_(?P<load>\d+)g'  # each named group is a condition's value"
SIDE_FILE = '# side_file = "about.csv"  # columns: file, and one for each single value'
CONDITIONS = ("# [data.conditions]  # constant in a run", '# load_mass_kg = "load:g"')


def example_of(table: Path) -> tuple["Raw", str]:
    """Return the first file of a table that has the columns of its largest, and its side file."""
    from rig.importers.table.data import Data
    from rig.importers.table.mapping import ColumnMapping
    from rig.importers.table.open import files_at, read_largest, read_raw, side_file_of

    plain = ColumnMapping(Data())
    raw = read_largest(table, plain)
    for file in files_at(table, plain):
        if file == raw.path:
            break
        with suppress(DataError):  # of another kind, such as a side table without a head
            if [*(first := read_raw(file, plain)).columns] == [*raw.columns]:
                raw = first
                break
    if side := side_file_of(raw.path):
        raw = read_raw(raw.path, ColumnMapping(Data(side_file=side)))
    return raw, side


def filtered(plant: Plant, raw: "Raw") -> Plant:
    """Return a machine with a cutoff that its filter can have at the sample rate of a table."""
    from estimation.filters import LowPass
    from rig.importers.table.rate import likely_rate_hz

    rate_hz = likely_rate_hz(raw)
    if rate_hz is None:
        return plant
    cutoff_hz = LowPass(plant.cutoff_hz, plant.order).for_rate(rate_hz).cutoff_hz
    return replace(plant, cutoff_hz=float(f"{cutoff_hz:.2g}"))


def data_text(raw: "Raw", side: str, plant: Plant) -> str:
    """Return `[data]` for a file of a table: a line for each channel, its columns as remarks."""
    channels = [*(a.name for a in plant.actuators), *(s.name for s in plant.sensors)]
    lines = ["", f"# Columns of {raw.path.name}, with the first sample:"]
    lines += [f"#   {_line(name, x[0])}" for name, x in raw.columns.items() if len(x)]
    lines += [f"# Single value {_line(name, value)}" for name, value in raw.fields.items()]
    lines += [f"# Remark: {remark}." for remark in raw.remarks]
    lines += [
        "[data]",
        f'# files = "*{raw.path.suffix}"  # of a folder',
        FILE_NAME,
        f"side_file = {value_text(side)}" if side else SIDE_FILE,
        "",
        "[data.columns]",
    ]
    for channel in ("time_s", *channels):
        if channel in raw.columns:
            lines.append(f"{channel} = {value_text(channel)}")
        else:
            lines.append(f'# {channel} = "{UNMAPPED}"')
    trials = next((name for name, x in raw.columns.items() if _is_of_trials(x)), "trial")
    runs = (
        "# [data.runs]  # where a file holds several runs",
        f"# changes = [{value_text(trials)}]  # a new value begins a run; or gap_s, resets, lap_s",
    )
    return "\n".join([*lines, "", *CONDITIONS, "", *runs]) + "\n"


def _is_of_trials(column: "Values", longest: int = 50) -> bool:
    """Whether a column may number runs: each of its values stands in one long block."""
    if not len(column) or (column.dtype.kind == "f" and (column != np.rint(column)).any()):
        return False
    starts = 1 + np.count_nonzero(column[1:] != column[:-1])
    return bool(1 < starts == len(set(column.tolist())) <= len(column) / longest)


def _line(name: str, value: object) -> str:
    """Return a name and a value as one line of a remark."""
    return " ".join(f"{name}: {value}".split())[:MOST_REMARK]
