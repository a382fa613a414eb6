"""`rig machine`: what a machine is, in one file, and what can be identified of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from rig.cli.options import (
    FormatOption,
    complete_machine,
    group,
    machine_names,
    require_new,
    say_left_out,
)
from rig.errors import ExitCode
from rig.output.console import JsonFlag, present

if TYPE_CHECKING:
    from estimation.model import Model
    from estimation.plant import Plant
    from estimation.plant_check import CheckedEquation, CheckedPlant

machine_app = group(
    "machine", "Describe a machine of one's own in a file, and check what can be identified of it."
)

FileArgument = Annotated[
    Path,
    Argument(
        metavar="FILE",
        help=f"Machine file, or one of {', '.join(machine_names())}.",
        autocompletion=complete_machine,
    ),
]


@machine_app.command()
def show(file: FileArgument, json_: JsonFlag = False) -> None:
    """Show a machine: its parts and its equations."""
    from estimation.plant_equations import signals
    from estimation.plant_file import to_toml
    from estimation.plant_models import declared
    from rig.machines.shipped import read_machine

    plant = read_machine(file)
    models = declared(plant)
    equations = [_equation(model) for model in models]
    data = {"machine": plant, "signals": signals(plant), "equations": equations}
    lines = (f"{model.balance}: {model.description}" for model in models)
    present(json_, data, to_toml(plant), *lines)


def _equation(model: "Model") -> dict[str, Any]:
    """Return a declared equation as plain types: its effects by id, with their parameters."""
    effects = [
        {"id": term.effect.id, "sign": term.sign, "channels": term.channels}
        | {"parameters": {p.name: term.unit(p, model.target) for p in term.parameters}}
        for term in model.terms
    ]
    about = {key: getattr(model, key) for key in ("name", "balance", "target", "unit")}
    return {**about, "description": model.description, "effects": effects}


@machine_app.command()
def check(
    file: FileArgument,
    data: Annotated[Path | None, Argument(help="Recordings of the machine.")] = None,
    format_: FormatOption = None,
    json_: JsonFlag = False,
) -> int:
    """Check what can be identified of a machine, and what would be needed.

    With DATA each equation is also fitted. Exit code 1 where one cannot be, where recordings
    contradict the file, or where nothing can be identified.
    """
    from rig.machines.shipped import read_machine

    plant = read_machine(file)  # a slip of the pen is named before the libraries are loaded

    from estimation.plant_check import check as check_plant
    from rig.importers.questions import questions
    from rig.machines.recordings import open_recordings, recorded_channels

    campaign = None if data is None else open_recordings(data, file, format_)
    found = check_plant(plant, campaign, file, recorded_channels(file))
    if data is not None and campaign is not None:
        say_left_out(data, campaign)
    runs = [] if campaign is None else list(campaign.evidence)
    asked = questions(runs, plant)
    result = {"machine": plant.name, "check": found, "sound": found.is_sound, "questions": asked}
    present(json_, result, *check_lines(plant, found), *(f"Check: {line}" for line in asked))
    return ExitCode.OK if found.is_sound else ExitCode.FAILED


def check_lines(plant: "Plant", found: "CheckedPlant") -> list[str]:
    """Return the result of a check as lines."""
    lines = [] if found.equations else [f"No equation can be written for {plant.name}."]
    for equation in found.equations:
        lines += ["", f"{equation.name}: {equation.sentence}", *_parameter_lines(equation)]
    if found.missing:
        lines += ["", "Not identified:"]
        lines += [f"  {gap.what} Needed: {gap.needed}" for gap in found.missing]
    warm = {sensor.name for sensor in plant.sensors if sensor.reads == "temperature"}
    if others := [name for name in found.unused if name not in warm]:
        lines += ["", f"Read by no equation: {', '.join(others)}."]
    if causes := [name for name in found.unused if name in warm]:
        lines += ["", f"Read by causes of a diagnosis alone: {', '.join(causes)}."]
    if found.contradictions:
        lines += ["", "The recordings contradict the file:"]
        lines += [f"  {sentence}" for sentence in found.contradictions]
    return lines[1:] if lines and not lines[0] else lines


def _parameter_lines(equation: "CheckedEquation") -> list[str]:
    from estimation.model import AT_BOUND
    from rig.reports.diagnosis_words import plain_unit

    lines = []
    for one in equation.parameters:
        value = "" if one.value is None else f" = {one.value:.5g}"
        plain = plain_unit(one.unit)
        unit = "" if plain == "1" else f" {plain}"
        text = f"{value}{unit}" if value else f" ({plain})"
        text += ", at its bound" if one.at_bound else ""
        text += "" if one.is_shown or one.at_bound else ", not identified by these runs"
        lines.append(f"  {one.effect}, {one.name}{text}: {one.description}")
    if any(one.at_bound for one in equation.parameters):
        lines.append(f"  {AT_BOUND}")
    if equation.relative_error is not None:
        share = 100 * equation.relative_error
        lines.append(f"  Residual: {share:.3f} % of the root mean square of {equation.target}.")
    lines += [f"  {limit}" for limit in equation.limits]
    if equation.trouble:
        is_fitted = equation.relative_error is not None
        lead = "Contradicted by the recordings" if is_fitted else "Cannot be fitted"
        lines.append(f"  {lead}: {equation.trouble}")
    return lines


@machine_app.command()
def new(
    out: Annotated[Path, Argument(metavar="FILE", help="Machine file to write.")],
    name: Annotated[str, Option(help="Name of the machine; by default the file's.")] = "",
    axis: Annotated[
        list[str] | None,
        Option(help="Axis, NAME:rad or NAME:m, in the order they drive one another."),
    ] = None,
    transmission: Annotated[
        list[str] | None,
        Option(
            help="INPUT:OUTPUT:RATIO; without a ratio it is fitted. It is written as compliant,"
            " with an equation of its deflection, where both its travels are read."
        ),
    ] = None,
    actuator: Annotated[
        list[str] | None, Option(help="AXIS:CHANNEL, such as motor:motor_current_a.")
    ] = None,
    sensor: Annotated[
        list[str] | None,
        Option(
            help="AXIS:CHANNEL, or CHANNEL alone of no axis, such as thrust_n; what it reads"
            " follows from the channel's unit. A position or a speed is of an axis."
        ),
    ] = None,
    from_: Annotated[
        Path | None, Option("--from", help="Table: its columns are listed under [data].")
    ] = None,
    json_: JsonFlag = False,
) -> None:
    """Write a machine file, from options or from answers on a terminal.

    Without a terminal nothing is asked: what is not stated is not in the file.
    """
    from estimation.plant_file import write
    from rig.cli.machine_new import UNMAPPED, asked, data_text, example_of, filtered, plant_of

    require_new(out)
    words = {"axis": axis, "transmission": transmission, "actuator": actuator, "sensor": sensor}
    stated = {kind: given or [] for kind, given in words.items()}
    plant = plant_of(name or out.stem, stated if any(stated.values()) else asked(from_))
    data = ""
    if from_:
        raw, side = example_of(from_)
        plant, data = filtered(plant, raw), data_text(raw, side, plant)
    write(plant, out, data)
    step = f"rig machine check {out} {from_ or 'DATA'}"
    if UNMAPPED in data:
        step = (
            f"replace COLUMN:UNIT under [data.columns] in it, then: rig import {from_} --machine"
            f" {out} --preview"
        )
    bending = [
        f"{one.name} is written as compliant, since both its travels are read. If it is rigid,"
        " state compliant = false: it then has no equation of its deflection."
        for one in plant.transmissions
        if one.compliant
    ]
    present(json_, {"machine": out}, f"Machine: {out}. Next: {step}", *bending)
