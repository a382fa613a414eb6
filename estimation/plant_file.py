"""The machine file: one TOML file that says what a machine is.

schema = "rig.machine/1"

[machine]
name = "slide"
description = "What it is, and where its data come from."

[[axis]]
name = "carriage"
unit = "m"

[[actuator]]
name = "drive_force_n"
axis = "carriage"

[[sensor]]
name = "carriage_position_m"
axis = "carriage"
reads = "position"

`[[transmission]]`, `[[load]]`, `[[derived]]` and `[[equation]]` are optional. `[data]`, how a table
of somebody else's becomes these channels, is left to the importer of tables.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, cast, get_args

from estimation.channels import unit_of
from estimation.errors import EstimationError, UnknownNameError
from estimation.files import not_utf8, write_text_atomic
from estimation.plant import (
    Actuator,
    Axis,
    Load,
    Part,
    Plant,
    PlantError,
    Sensor,
    Transmission,
    Written,
)
from estimation.plant_equations import equations
from estimation.signals import Samples, combination_lines, read_combinations
from estimation.toml_table import Lines, Table, entries, value_text

SCHEMA = "rig.machine/1"


class PlantFileError(EstimationError):
    """A machine file cannot be read; the message names the file, the line and the key."""


class NoPlantError(PlantFileError, UnknownNameError):
    """There is no machine of that name, and no such file."""


def shipped() -> dict[str, Path]:
    """Return the machine files that come with the project, by name."""
    folder = Path(str(files("estimation"))) / "machines"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def shipped_plant(name: str) -> Plant:
    """Return a machine that comes with the project."""
    return read(shipped()[name])


def read(path: Path) -> Plant:
    """Read a machine file.

    Raises:
        NoPlantError: No such file; it is a PlantFileError, too.
        PlantFileError: It is not TOML, a key is unknown, missing or wrong, or parts do not fit.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise NoPlantError(f"There is no machine file {path}.", fix="Check the path.") from error
    except UnicodeDecodeError as error:
        raise PlantFileError(f"{path} is not a machine file.", *not_utf8(error)) from error
    except OSError as error:
        raise PlantFileError(f"The machine file {path} cannot be read.", str(error)) from error
    return parse(text, str(path))


def parse(text: str, where: str = "machine") -> Plant:
    """Read a machine from TOML text; `where` names the file in messages. Errors as of `read`."""
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PlantFileError(f"{where} is not TOML.", str(error)) from error
    lines = Lines(text)
    top = Table(content, where, PlantFileError, lines)
    if top.take("schema", str) != SCHEMA:
        raise PlantFileError(
            f'{top.at("schema")}: the schema is not "{SCHEMA}".',
            "It is that of another version of rig, or of another kind of file.",
            f'Write schema = "{SCHEMA}"; `rig machine new` writes a file of this version.',
        )
    try:
        plant = _plant(top)
        equations(plant)  # names must be unique
    except PlantError as error:
        line = lines.of(error.place)
        at = where if line is None else f"{where}, line {line}"
        raise PlantFileError(f"{at}: {error.what}", error.why, error.fix) from error
    return plant


def _plant(top: Table) -> Plant:
    machine = top.table("machine")
    top.ignore("data")
    parts: dict[str, tuple[Any, ...]] = {
        "axes": tuple(t.made(Axis) for t in top.tables("axis", [])),
        "transmissions": tuple(t.made(Transmission) for t in top.tables("transmission", [])),
        "actuators": tuple(_channel(t).made(Actuator) for t in top.tables("actuator", [])),
        "sensors": tuple(_channel(t).made(Sensor) for t in top.tables("sensor", [])),
        "loads": tuple(_channel(t).made(Load) for t in top.tables("load", [])),
        "equations": tuple(_equation(t) for t in top.tables("equation", [])),
        "derived": read_combinations(top.tables("derived", [])),
    }
    top.finish()
    return machine.made(Plant, **parts)


def _channel(table: Table) -> Table:
    """Return the table of a channel; a unit that it states is the one that its name ends in."""
    channel = table.take("name", str)
    try:
        unit = unit_of(channel)
    except EstimationError as error:
        raise PlantFileError(f"{table.at('name')}: {error.what}", error.why, error.fix) from error
    stated = table.take("unit", str, unit)
    if stated != unit:
        raise PlantFileError(
            f"{table.at('unit')}: the unit of {channel!r} is stated as {stated!r}.",
            f"Channels are in SI and the name ends in the unit: {channel} is in {unit}.",
            "Rename the channel; how recorded values are converted is stated under [data].",
        )
    return table


def _equation(table: Table) -> Written:
    parts = []
    for effect in table.tables("effects"):
        channels = effect.table("channels")
        named = {role: channels.take(role, str) for role in channels.content}
        parts.append(effect.made(Part, channels=named))
    samples = cast(Samples | None, table.choice("samples", ("", *get_args(Samples))) or None)
    return table.made(Written, parts=tuple(parts), samples=samples)


def write(plant: Plant, path: Path, more: str = "") -> None:
    """Write a machine file, and TOML that follows, such as `[data]`; it is replaced in one step.

    Raises:
        OutputError: The file cannot be written.
    """
    write_text_atomic(path, to_toml(plant) + more)


def to_toml(plant: Plant) -> str:
    """Return a machine as TOML text; `parse` gives it back."""
    lines = [f"schema = {value_text(SCHEMA)}", "", "[machine]"]
    machine = {key: getattr(plant, key) for key in ("name", "description", "cutoff_hz", "order")}
    lines += _stated(machine | {"run_offsets": plant.run_offsets})
    for header, parts in (
        ("axis", plant.axes),
        ("transmission", plant.transmissions),
        ("actuator", plant.actuators),
        ("sensor", plant.sensors),
        ("load", plant.loads),
    ):
        for part in cast(tuple[Any, ...], parts):
            lines += ["", f"[[{header}]]", *_stated(asdict(part))]
    lines += combination_lines(plant.derived, "derived")
    for equation in plant.equations:
        keys = ("name", "target", "samples", "description")
        about = {key: getattr(equation, key) for key in keys}
        lines += ["", "[[equation]]", *_stated(about)]
        for part in equation.parts:
            lines += ["", "[[equation.effects]]", *entries({"id": part.id, "sign": part.sign})]
            lines += entries(part.channels, "channels.")
    return "\n".join(lines) + "\n"


def _stated(content: Mapping[str, Any]) -> list[str]:
    """Return the lines of keys that are not as they are where they are left out."""
    kept = {k: v for k, v in content.items() if v != "" and (v is not False or k == "run_offsets")}
    return entries(kept)
