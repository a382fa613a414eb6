"""`rig reference`: give the encoders of a board that was started their zeros."""

from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.doctor import ConfigOption
from rig.output.console import JsonFlag, emit_json, results

if TYPE_CHECKING:
    from drivers.teensy.driver import TeensyLogger

AtOption = Annotated[
    list[float] | None,
    typer.Option("--at", help="Angle it stands at, rad; once for each setpoint. Default 0."),
]
YesFlag = Annotated[bool, typer.Option("--yes", help="Do not ask; it stands there already.")]


REST_SAMPLES = 300
"""Samples after which the board has seen whether a shaft turns."""
SILENT_READS = 5


def reference(
    config: ConfigOption = None, at: AtOption = None, yes: YesFlag = False, json: JsonFlag = False
) -> int:
    """Say where the rig stands: after every start of the board, before anything moves.

    Turn it by hand to its mark first. The board refuses while it is armed or a shaft turns.
    """
    from drivers.teensy.driver import TeensyLogger
    from rig.bench.logger import open_logger
    from rig.configuration.config import load_config
    from rig.errors import UsageError
    from rig.machines.choose import machine_of

    settings = load_config(config)
    machine = machine_of(settings)
    axes = len(machine.here_channels)
    here = at or [0.0] * axes
    if len(here) != axes:
        raise UsageError(
            f"{settings.name} is referenced by {axes} angles, {len(here)} were given.",
            fix=f"Give --at {axes} times: {', '.join(machine.here_channels)}.",
        )
    where = ", ".join(f"{n} = {a:g}" for n, a in zip(machine.here_channels, here, strict=True))
    screen = results(json)
    if not yes:
        typer.confirm(f"Turn it by hand to {where} and let go. Does it stand there?", abort=True)
    with TeensyLogger(open_logger(settings), machine.profile) as logger:
        logger.identify()
        logger.start()
        _watch_at_rest(logger)
        logger.reference(machine.reference_counts(settings, settings.calibration_set(), here))
        logger.stop()
        identity = logger.identify()
    text = f"{settings.name}: referenced at {where}, in start {identity.boot} of {identity.serial}."
    screen.print(text, markup=False)
    if json:
        emit_json({"referenced": identity.referenced, "boot": identity.boot, "at_rad": here})
    return 0


def _watch_at_rest(logger: "TeensyLogger") -> None:
    """Let the board see for a while that nothing turns; it refuses where something does."""
    seen = silent = 0
    while seen < REST_SAMPLES and silent < SILENT_READS:
        samples = len(logger.read(0.2).samples)
        seen += samples
        silent += not samples
