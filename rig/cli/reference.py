"""`rig reference`: give the encoders of a restarted board their zeros."""

from typing import Annotated

import typer

from rig.cli.rig_options import ConfigOption, SimFlag, chosen_rig
from rig.output.console import JsonFlag, emit_json, results

AtOption = Annotated[
    list[float] | None,
    typer.Option("--at", help="Angle of the mark, rad; once for each setpoint. If none: 0."),
]
YesFlag = Annotated[bool, typer.Option("--yes", help="The rig stands at its mark; do not ask.")]


def reference(
    config: ConfigOption = None,
    sim: SimFlag = False,
    at: AtOption = None,
    yes: YesFlag = False,
    json: JsonFlag = False,
) -> int:
    """Give the encoders their zeros, after every restart of the board.

    Turn the rig by hand to its mark first. The board refuses while it is armed or a shaft turns.
    """
    from rig.bench.referencing import reference_board, require_place
    from rig.machines.choose import machine_of

    settings = chosen_rig(config, sim)
    names = machine_of(settings).here_channels
    here_rad = at or [0.0] * len(names)
    require_place(settings, here_rad)
    place = ", ".join(f"{name} = {angle:g}" for name, angle in zip(names, here_rad, strict=True))
    if not yes:
        typer.confirm(
            f"Turn the rig by hand to {place} and let go. Does it stand there?",
            abort=True,
            err=True,
        )
    identity = reference_board(settings, here_rad)
    results(json).print(
        f"{settings.name}: referenced at {place}; board {identity.serial}, start {identity.boot}.",
        markup=False,
    )
    if json:
        emit_json({"referenced": identity.referenced, "boot": identity.boot, "at_rad": here_rad})
    return 0
