"""`rig config`: is a configuration sound, and what does it come to."""

import shlex
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from estimation.errors import nearest
from estimation.files import write_text_atomic
from rig.cli.options import SimFlag, complete_config, config_names, group, require_new
from rig.errors import UsageError
from rig.output.console import JsonFlag, emit_json, present

config_app = group("config", "Begin, check and show a configuration.")

TEENSY = "16c0:0483"
"""USB vendor and product of the Teensy's serial port."""

ConfigArgument = Annotated[
    Path | None, Argument(help="A TOML file, or a shipped one by name; the default one if none.")
]


@config_app.command()
def init(
    out: Annotated[Path, Argument(help="File to write.")] = Path("rig.toml"),
    like: Annotated[
        str,
        Option(
            help=f"Shipped configuration to begin with: {', '.join(config_names())}.",
            autocompletion=complete_config,
        ),
    ] = "reference",
    json: JsonFlag = False,
) -> None:
    """Write a configuration to begin with, for the board that is plugged in.

    Comments and units stand in it; what was measured on another rig (gains, limits) is to be looked
    at before anything moves.
    """
    from rig.configuration.config import SHIPPED, load_config
    from rig.doctor.ports import serial_ports

    if like not in config_names():
        raise UsageError(
            f"There is no shipped configuration {like!r}.",
            f"There are: {', '.join(config_names())}.",
            nearest(like, config_names()),
        )
    require_new(out)
    boards = [port for port in serial_ports() if port.usb.startswith(TEENSY)]
    text = (SHIPPED / f"{like}.toml").read_text()
    if len(boards) == 1:
        text = text.replace(f'"usb:{TEENSY}"', f'"usb:{boards[0].usb}"')
    if not load_config(Path(like)).is_simulated:
        line = 'calibration = "reference"\n'
        text = text.replace(
            line, line + 'calibration_store = "default"  # what `rig calibrate use` chose\n'
        )
    write_text_atomic(out, text)
    found = ", ".join(f"{board.path} (usb:{board.usb})" for board in boards)
    said = [f"Wrote {out}. Boards plugged in: {found or 'none'}."]
    if len(boards) != 1:
        said.append(f"Write the board's address into `url` of {out}; `rig devices` shows it.")
    file = shlex.quote(str(out))
    said += [
        "Check limits and gains before it moves. Then:",
        f"  rig config check {file}",
        f"  rig doctor --config {file}",
    ]
    present(json, {"written": out, "boards": boards}, *said)


@config_app.command()
def check(path: ConfigArgument = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Check keys, ranges, drivers, options, limits, and that devices on a CAN bus get along.

    Exit code 2 when the configuration cannot be used; every problem is named.
    """
    from rig.bench.limited import limit_problems
    from rig.configuration.check import problems
    from rig.configuration.chosen import choose_rig

    settings = choose_rig(path, sim)
    found = problems(settings) or limit_problems(settings)
    sound = f"{settings.name} is sound. The logger and further devices: {len(settings.devices)}."
    said = [f"{problem.key}: {problem.what}\n  fix: {problem.fix}" for problem in found]
    data = {"name": settings.name, "sound": not found, "problems": found}
    present(json, data, *(said or [sound]))
    return 2 if found else 0


@config_app.command()
def show(path: ConfigArgument = None, sim: SimFlag = False, json: JsonFlag = False) -> None:
    """Show the whole configuration as every log keeps it, defaults and units written out."""
    from rig.configuration.chosen import choose_rig
    from rig.configuration.config import to_toml

    settings = choose_rig(path, sim)
    if json:
        emit_json(settings.model_dump())
    else:
        typer.echo(to_toml(settings), nl=False)


@config_app.command(name="list")
def list_(json: JsonFlag = False) -> None:
    """List the shipped configurations."""
    from rig.configuration.config import SHIPPED, load_config

    found = {name: load_config(Path(name)).name for name in config_names()}
    width = max(map(len, found))
    lines = (f"{name:{width}}  {rig}" for name, rig in found.items())
    present(json, {"folder": SHIPPED, "configs": found}, *lines)
