"""A machine file from a few words, typed as options or answered on a terminal."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

from estimation.channels import unit_of
from estimation.plant import Actuator, Axis, Plant, PlantError, Reads, Sensor, Transmission
from estimation.toml_table import value_text
from rig.errors import UsageError


@dataclass(frozen=True)
class Answers:
    """A machine in words, parts separated by colons.

    Attributes:
        axes: NAME:UNIT.
        transmissions: INPUT:OUTPUT or INPUT:OUTPUT:RATIO.
        actuators: AXIS:CHANNEL.
        sensors: AXIS:CHANNEL.
    """

    axes: Sequence[str]
    transmissions: Sequence[str]
    actuators: Sequence[str]
    sensors: Sequence[str]

    @property
    def is_empty(self) -> bool:
        """Whether nothing was stated."""
        return not (self.axes or self.transmissions or self.actuators or self.sensors)


def asked() -> Answers:
    """Ask for a machine on a terminal.

    Raises:
        UsageError: Standard input is not a terminal.
    """
    if not sys.stdin.isatty():
        raise UsageError(
            "Nothing states what the machine is.",
            "There is no terminal to ask on.",
            "Give --axis NAME:rad, --actuator AXIS:CHANNEL and --sensor AXIS:CHANNEL.",
        )
    axes = _each("Axis, NAME:rad or NAME:m (empty: no more)")
    transmissions = _each("Transmission, INPUT:OUTPUT:RATIO (empty: no more)") if axes[1:] else []
    return Answers(
        axes,
        transmissions,
        _each("Actuator, AXIS:CHANNEL, such as motor:motor_current_a (empty: no more)"),
        _each("Sensor, AXIS:CHANNEL, such as motor:motor_angle_rad (empty: no more)"),
    )


def _each(question: str) -> list[str]:
    found = []
    while answer := typer.prompt(question, default="", show_default=False, err=True).strip():
        found.append(answer)
    return found


def plant_of(name: str, answers: Answers) -> Plant:
    """Return the machine that is stated.

    Raises:
        UsageError: A word is not of its form, or the parts do not fit together.
    """
    axes = [_parts(word, "--axis", "NAME:rad or NAME:m", (2,)) for word in answers.axes]
    joints = [
        _parts(word, "--transmission", "INPUT:OUTPUT:RATIO", (2, 3))
        for word in answers.transmissions
    ]
    actuators = [_parts(word, "--actuator", "AXIS:CHANNEL", (2,)) for word in answers.actuators]
    sensors = [_parts(word, "--sensor", "AXIS:CHANNEL", (2,)) for word in answers.sensors]
    try:
        return Plant(
            name=name,
            axes=tuple(Axis(axis, unit) for axis, unit in axes),
            transmissions=tuple(_transmission(parts) for parts in joints),
            actuators=tuple(Actuator(channel, axis) for axis, channel in actuators),
            sensors=tuple(Sensor(c, axis, reads_of(c)) for axis, c in sensors),
        )
    except PlantError as error:
        raise UsageError(error.what, error.why, error.fix) from error


def _parts(word: str, option: str, form: str, counts: tuple[int, ...]) -> list[str]:
    parts = word.split(":")
    if len(parts) not in counts or not all(parts[:2]):
        raise UsageError(f"{option} {word!r} is not {form}.", fix=f"Write {option} {form}.")
    return parts


def _transmission(parts: Sequence[str]) -> Transmission:
    ratio = None
    if len(parts) > 2:
        try:
            ratio = float(parts[2])
        except ValueError:
            raise UsageError(
                f"The ratio {parts[2]!r} is not a number.",
                fix="Write the travel of the input per travel of the output, such as 35.",
            ) from None
    return Transmission(f"{parts[0]}_to_{parts[1]}", parts[0], parts[1], ratio, compliant=True)


def reads_of(channel: str) -> Reads:
    """Return the quantity a sensor reads, by the unit and the name of its channel."""
    unit = unit_of(channel)
    if channel.startswith("target_"):
        return "reference"
    kinds: dict[str, Reads] = {
        "rad": "position",
        "m": "position",
        "rad/s": "speed",
        "m/s": "speed",
        "N m": "effort",
        "N": "effort",
        "K": "temperature",
    }
    return kinds.get(unit, "other")


def data_text(table: Path, plant: Plant) -> str:
    """Return `[data]` for a table: a line for each channel, and the table's columns as remarks.

    Raises:
        UsageError: No such file.
        DataError: The table cannot be read.
    """
    from rig.importers.table.data import Data
    from rig.importers.table.mapping import Mapping
    from rig.importers.table.open import files_at, read_raw

    mapping = Mapping(Data())
    raw = read_raw(files_at(table, mapping)[0], mapping)
    channels = [*(a.name for a in plant.actuators), *(s.name for s in plant.sensors)]
    lines = ["", f"# Columns of {table.name}: {', '.join(raw.columns)}", "[data]", ""]
    lines += ["[data.columns]"]
    for channel in ("time_s", *channels):
        if channel in raw.columns:
            lines.append(f"{channel} = {value_text(channel)}")
        else:
            lines.append(f'# {channel} = "COLUMN:UNIT"')
    return "\n".join(lines) + "\n"
