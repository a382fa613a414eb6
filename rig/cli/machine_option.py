"""The options that name the machine a recording is of, and the model declared of it."""

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
