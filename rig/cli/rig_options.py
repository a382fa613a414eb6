"""The options that select the rig of a command, and the line for a simulated rig."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.shipped import complete_config, config_names

if TYPE_CHECKING:
    from rig.configuration.config import Config

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        help=f"Configuration: a file, or one of {', '.join(config_names())}. If none: RIG_CONFIG,"
        " ./rig.toml, ~/.config/rig/rig.toml.",
        autocompletion=complete_config,
    ),
]
SimFlag = Annotated[bool, typer.Option("--sim", help="Use the simulated rig; nothing real moves.")]


def chosen_rig(config: Path | None, sim: bool) -> "Config":
    """Return the chosen configuration, and say on stderr if it is a simulated rig's.

    Raises:
        UsageError: No rig is configured, or the configuration is wrong.
    """
    from rig.configuration.chosen import choose_rig

    return announced(choose_rig(config, sim))


def announced(settings: "Config") -> "Config":
    """Return a configuration; the session on it begins with a line if it is simulated."""
    from rig.output.console import remarks

    if settings.is_simulated:
        remarks().print(f"Simulated rig ({settings.name}): nothing real moves or is measured.")
    return settings
