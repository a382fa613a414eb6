"""`rig firmware`: which firmware is where, build it, flash it."""

from typing import Annotated

from typer import Option

from rig.cli.help import group
from rig.cli.options import ConfigOption, SimFlag, chosen_rig
from rig.output.console import JsonFlag, present

firmware_app = group("firmware", "Show firmware versions, build the firmware, flash it.")

BoardOption = Annotated[
    str, Option("--board", "-b", help="teensy35, teensy41 or teensy41-grasper.")
]


@firmware_app.command()
def version(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Hold the board's firmware against this program's and this source tree's.

    Exit code 1 when they do not go together.
    """
    from rig.bench.firmware import compare

    versions = compare(chosen_rig(config, sim))
    present(
        json,
        versions,
        f"program   {versions.program}",
        f"sources   {versions.sources}",
        f"board     {versions.board}",
        *versions.remarks,
    )
    return 0 if versions.fits else 1


@firmware_app.command()
def build(board: BoardOption = "", json: JsonFlag = False) -> None:
    """Build the firmware: for the simulated rig, or with --board for a Teensy."""
    from rig.bench.firmware import build as make
    from rig.bench.firmware import build_for

    where = build_for(board) if board else make()
    present(json, {"built": where}, f"Built {where}.")


@firmware_app.command()
def flash(
    board: BoardOption = "teensy41",
    serial: Annotated[str, Option(help="Serial number the board must have.")] = "",
    json: JsonFlag = False,
) -> None:
    """Build for a Teensy and write it to the only one that is plugged in.

    A second Teensy on this computer is refused, for the loader takes the first it finds, and so is
    an armed board or one that another program has.
    """
    from rig.bench.firmware import flash as write

    found = write(board, serial)
    text = f"Flashed {board} to the board {found.serial}. Next: rig firmware version"
    present(json, {"flashed": board, "serial": found.serial, "port": found.port}, text)
