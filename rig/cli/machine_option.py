"""The option that names the machine a recording is of."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.shipped import complete_machine, machine_names

MachineOption = Annotated[
    Path | None,
    typer.Option(
        "--machine",
        help=f"Machine of the recordings: a file, or one of {', '.join(machine_names())}. If none:"
        " the reference rig.",
        autocompletion=complete_machine,
    ),
]
