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
from estimation.files import write_text_atomic
from estimation.plant import (
    Actuator,
    Axis,
    Load,
    Part,
    Plant,
    PlantError,
    Reads,
    Sensor,
    Transmission,
    Written,
)
from estimation.plant_equations import equations
from estimation.signals import Samples, combination_lines, read_combinations
from estimation.toml_table import Lines, Table, value_text

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
    except (OSError, UnicodeDecodeError) as error:
        raise PlantFileError(f"The machine file {path} cannot be read.", str(error)) from error
    return parse(text, str(path))


def parse(text: str, where: str = "machine") -> Plant:
    """Read a machine from TOML text.

    Args:
        text: TOML.
        where: Name of the file for messages.

    Raises:
        PlantFileError: As for `read`.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PlantFileError(f"{where} is not TOML.", str(error)) from error
    lines = Lines(text)
    top = Table(content, where, PlantFileError, lines)
    if top.take("schema", str) != SCHEMA:
        raise PlantFileError(f'{top.at("schema")}: the schema is not "{SCHEMA}".')
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
    name, description = machine.take("name", str), machine.take("description", str, "")
    cutoff_hz, order = machine.number("cutoff_hz", 50.0), machine.take("order", int, 3)
    run_offsets = machine.take("run_offsets", bool, True)
    machine.finish()
    top.ignore("data")
    parts: dict[str, tuple[Any, ...]] = {
        "axes": tuple(_axis(t) for t in top.tables("axis", [])),
        "transmissions": tuple(_transmission(t) for t in top.tables("transmission", [])),
        "actuators": tuple(_actuator(t) for t in top.tables("actuator", [])),
        "sensors": tuple(_sensor(t) for t in top.tables("sensor", [])),
        "loads": tuple(_load(t) for t in top.tables("load", [])),
        "equations": tuple(_equation(t) for t in top.tables("equation", [])),
        "derived": read_combinations(top.tables("derived", [])),
    }
    top.finish()
    return Plant(
        name=name,
        description=description,
        cutoff_hz=cutoff_hz,
        order=order,
        run_offsets=run_offsets,
        **parts,
    )


def _axis(table: Table) -> Axis:
    made = Axis(
        table.take("name", str),
        table.take("unit", str),
        table.optional("rest_speed"),
        table.take("description", str, ""),
    )
    table.finish()
    return made


def _transmission(table: Table) -> Transmission:
    made = Transmission(
        name=table.take("name", str),
        input=table.take("input", str),
        output=table.take("output", str),
        ratio=table.optional("ratio"),
        compliant=table.take("compliant", bool, False),
        damped=table.take("damped", bool, False),
        deflection=table.take("deflection", str, ""),
        description=table.take("description", str, ""),
    )
    table.finish()
    return made


def _actuator(table: Table) -> Actuator:
    made = Actuator(
        table.take("name", str), table.take("axis", str), table.take("description", str, "")
    )
    _check_unit(table, made.name)
    table.finish()
    return made


def _sensor(table: Table) -> Sensor:
    made = Sensor(
        name=table.take("name", str),
        axis=table.take("axis", str, ""),
        reads=cast(Reads, table.choice("reads", get_args(Reads))),
        counts=table.optional("counts"),
        rate_hz=table.optional("rate_hz"),
        noise=table.optional("noise"),
        delay_s=table.optional("delay_s"),
        description=table.take("description", str, ""),
    )
    _check_unit(table, made.name)
    table.finish()
    return made


def _check_unit(table: Table, channel: str) -> None:
    """Raise where a stated unit is not the one that the channel's name ends in."""
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


def _load(table: Table) -> Load:
    made = Load(
        table.take("name", str),
        table.take("axis", str),
        table.take("description", str, ""),
    )
    _check_unit(table, made.name)
    table.finish()
    return made


def _equation(table: Table) -> Written:
    parts = []
    for effect in table.tables("effects"):
        channels = effect.table("channels")
        named = {role: channels.take(role, str) for role in channels.content}
        parts.append(Part(effect.take("id", str), effect.take("sign", int, 1), named))
        effect.finish()
    made = Written(
        table.take("name", str),
        table.take("target", str),
        tuple(parts),
        table.take("description", str, ""),
        cast(Samples | None, table.choice("samples", ("", *get_args(Samples))) or None),
    )
    table.finish()
    return made


def write(plant: Plant, path: Path, more: str = "") -> None:
    """Write a machine file; an existing one is replaced in one step.

    Args:
        plant: The machine.
        path: The file.
        more: TOML that follows, such as `[data]`.

    Raises:
        OutputError: The file cannot be written.
    """
    write_text_atomic(path, to_toml(plant) + more)


def to_toml(plant: Plant) -> str:
    """Return a machine as TOML text; `parse` gives it back."""
    lines = [f"schema = {value_text(SCHEMA)}", "", "[machine]"]
    machine = {key: getattr(plant, key) for key in ("name", "description", "cutoff_hz", "order")}
    lines += _entries(machine | {"run_offsets": plant.run_offsets})
    for header, parts in (
        ("axis", plant.axes),
        ("transmission", plant.transmissions),
        ("actuator", plant.actuators),
        ("sensor", plant.sensors),
        ("load", plant.loads),
    ):
        for part in cast(tuple[Any, ...], parts):
            lines += ["", f"[[{header}]]", *_entries(asdict(part))]
    lines += combination_lines(plant.derived, "derived")
    for equation in plant.equations:
        keys = ("name", "target", "samples", "description")
        about = {key: getattr(equation, key) for key in keys}
        lines += ["", "[[equation]]", *_entries(about)]
        for part in equation.parts:
            lines += ["", "[[equation.effects]]", f"id = {value_text(part.id)}"]
            lines.append(f"sign = {part.sign}")
            lines += [f"channels.{role} = {value_text(c)}" for role, c in part.channels.items()]
    return "\n".join(lines) + "\n"


def _entries(content: Mapping[str, Any]) -> list[str]:
    return [
        f"{key} = {value_text(value)}"
        for key, value in content.items()
        if value is not None and value != "" and (value is not False or key == "run_offsets")
    ]
