"""`rig reference`: give the encoders of a restarted board their zeros."""

from enum import StrEnum
from typing import Annotated

import typer
from typer import Option

from rig.cli.options import ConfigOption, SimFlag, chosen_rig, require_yes
from rig.output.console import JsonFlag, present, results

AtOption = Annotated[
    list[float] | None,
    Option("--at", help="Angle of the mark, rad; once for each setpoint. If none: 0."),
]


class Stop(StrEnum):
    """A mechanical stop of the spindle."""

    CLOSED = "closed"
    OPEN = "open"


StopOption = Annotated[
    Stop | None,
    Option(help="Drive gently against this stop first; --at is where it stands then."),
]
IndexFlag = Annotated[
    bool, Option("--index", help="Take the place of the encoder's index; --at is its angle.")
]
YesFlag = Annotated[bool, Option("--yes", help="The rig stands at its mark; do not ask.")]


def reference(
    config: ConfigOption = None,
    sim: SimFlag = False,
    at: AtOption = None,
    hard_stop: StopOption = None,
    index: IndexFlag = False,
    yes: YesFlag = False,
    json: JsonFlag = False,
) -> int:
    """Give the encoders their zeros, after every restart of the board.

    Turn the rig by hand to its mark first. The board refuses while it is armed or a shaft turns.
    With --hard-stop the motor turns it, with no more than the command that holds: keep clear.
    With --index turn the spindle through its encoder's index and let go; it waits a minute.
    """
    from rig.bench.referencing import reference_board, require_place
    from rig.machines.choose import machine_of

    settings = chosen_rig(config, sim)
    names = machine_of(settings).here_channels
    here_rad = at or [0.0] * len(names)
    require_place(settings, here_rad)
    place = ", ".join(f"{name} = {angle:g}" for name, angle in zip(names, here_rad, strict=True))
    if hard_stop is not None:
        from rig.bench.hard_stop import drive_to_stop

        require_yes("The motor will turn. Is the jaw empty and clear?", yes)
        turned_rad = drive_to_stop(settings, hard_stop is Stop.CLOSED)
        results(json).print(f"It turned {turned_rad:+.3f} rad to the {hard_stop} stop.")
    if index:
        typer.echo("Turn the spindle through its index and let go.", err=True)
    else:
        how = "The motor is off" if hard_stop else "Turn the rig by hand to it and let go"
        require_yes(f"The place is {place}. {how}. Does it stand there?", yes)
    identity = reference_board(settings, here_rad, index)
    present(
        json,
        {"referenced": identity.referenced, "boot": identity.boot, "at_rad": here_rad},
        f"{settings.name}: referenced at {place}; board {identity.serial}, start {identity.boot}.",
    )
    return 0
