"""`rig config`: is a configuration sound, and what does it come to."""

from pathlib import Path
from typing import Annotated

import typer

from rig.output.console import JsonFlag, emit_json, results

config_app = typer.Typer(
    name="config",
    help="Check and show a configuration.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

ConfigArgument = Annotated[
    Path | None,
    typer.Argument(help="A TOML file, or a shipped one by name; the simulated rig's if none."),
]


@config_app.command()
def check(path: ConfigArgument = None, json: JsonFlag = False) -> int:
    """Check keys, ranges, drivers, options, and that devices on a CAN bus get along.

    Exit code 2 when the configuration cannot be used; every problem is named.
    """
    from rig.configuration.check import problems
    from rig.configuration.config import load_config

    settings = load_config(path)
    found = problems(settings)
    screen = results(json)
    for problem in found:
        screen.print(f"{problem.key}: {problem.what}\n  fix: {problem.fix}", markup=False)
    if not found:
        screen.print(
            f"{settings.name} is sound. The logger and further devices: {len(settings.devices)}."
        )
    if json:
        emit_json({"name": settings.name, "sound": not found, "problems": found})
    return 2 if found else 0


@config_app.command()
def show(path: ConfigArgument = None, json: JsonFlag = False) -> None:
    """Show the whole configuration as every log keeps it, defaults and units written out."""
    from rig.configuration.config import load_config
    from rig.configuration.text import to_toml

    settings = load_config(path)
    if json:
        emit_json(settings.model_dump())
    else:
        typer.echo(to_toml(settings), nl=False)


@config_app.command(name="list")
def list_(json: JsonFlag = False) -> None:
    """List the shipped configurations."""
    from rig.configuration.config import SHIPPED, load_config, shipped_configs

    found = {name: load_config(Path(name)).name for name in shipped_configs()}
    if json:
        emit_json({"folder": SHIPPED, "configs": found})
        return
    for name, rig in found.items():
        results(json).print(f"{name:12} {rig}", markup=False)
