"""Report of the recordings that a command excludes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.output.console import remarks

if TYPE_CHECKING:
    from estimation.campaign import Campaign

SkipBad = Annotated[
    bool, typer.Option("--skip-bad", help="Leave out runs that cannot be read, and name them.")
]


def say_left_out(path: Path, campaign: "Campaign") -> None:
    """Print on stderr the files and runs at a path that a campaign excludes, with the reason."""
    from rig.importers.registry import left_out

    screen = remarks()
    for line in left_out(path, campaign):
        screen.print(line)
