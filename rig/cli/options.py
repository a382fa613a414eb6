"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.shipped import complete_machine, complete_model, machine_names, model_names

MachineOption = Annotated[
    Path | None,
    typer.Option(
        "--machine",
        help=f"Machine of the recordings: a file, or one of {', '.join(machine_names())}. If none:"
        " the reference rig.",
        autocompletion=complete_machine,
    ),
]

ModelOption = Annotated[
    Path | None,
    typer.Option(
        "--model",
        "-m",
        help=f"Declared model: a file, or one of {', '.join(model_names())}.",
        autocompletion=complete_model,
    ),
]

FormatOption = Annotated[
    str | None, typer.Option("--format", help="Format of the recordings; detected by default.")
]
EquationOption = Annotated[
    str | None, typer.Option("--equation", help="Only this equation, such as motor.")
]
LedgerOption = Annotated[Path | None, typer.Option(help="Path of the held-out-data usage log.")]
JsonFile = Annotated[Path | None, typer.Option("--json-out", help="File for the result as JSON.")]
QuickFlag = Annotated[bool, typer.Option("--quick", help="Propose no next experiment.")]
PlainFlag = Annotated[bool, typer.Option("--plain", help="Lines instead of the display.")]
WorkersOption = Annotated[
    int, typer.Option("--workers", min=1, help="Number of processes; 1 is this one.")
]
SchedulerOption = Annotated[str | None, typer.Option(help="Address of a Dask scheduler.")]
SeedOption = Annotated[int, typer.Option(help="Seed of everything random, such as the folds.")]
SimulationSeed = Annotated[
    int | None, typer.Option("--seed", help="Seed of the simulated rig; by default by the clock.")
]
TablesFile = Annotated[Path | None, typer.Option("--out", help="File for the tables, in Markdown.")]
FiguresFolder = Annotated[Path | None, typer.Option(help="Folder for the figures, as SVG.")]
