"""`rig reference | stop | clear`: what is asked of the board itself, and confirmed by it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from rig.bench.holding import Ending
from rig.cli.options import ConfigOption, SimFlag, announced, chosen_rig, require_yes
from rig.errors import ExitCode, RigError, UsageError
from rig.output.console import JsonFlag, present, remarks, results


class Stop(StrEnum):
    """A mechanical stop of the spindle."""

    CLOSED = "closed"
    OPEN = "open"


def reference(
    config: ConfigOption = None,
    sim: SimFlag = False,
    at: Annotated[
        list[float] | None,
        Option("--at", help="Angle of the mark, rad; once for each setpoint. If none: 0."),
    ] = None,
    hard_stop: Annotated[
        Stop | None,
        Option(help="Drive gently against this stop first; --at is where it stands then."),
    ] = None,
    index: Annotated[
        bool, Option("--index", help="Take the place of the encoder's index; --at is its angle.")
    ] = False,
    yes: Annotated[bool, Option("--yes", help="The rig stands at its mark; do not ask.")] = False,
    json: JsonFlag = False,
) -> None:
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


def stop(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Disarm the rig and read back that it is disarmed; without options, every configured rig.

    A session of this program that has the rig is first asked to disarm and end (SIGTERM), and is
    killed when it does not: the board then misses it and stops by itself. Programs of other makers
    are left alone and named. Configured are RIG_CONFIG, ./rig.toml and all of ~/.config/rig/*.toml.
    Exit code 0 only when every rig itself has confirmed it; 4 when the state of one is unknown: cut
    its motor supply; 2 when none is configured.
    """
    from rig.configuration.chosen import ONE_OF, choose_config, configured_rigs
    from rig.configuration.config import load_config

    if config is not None:
        load_config(config)  # a slip in what was typed is said before anything is tried
    meant = [choose_config(config, sim)] if config or sim else configured_rigs()
    if not meant:
        raise UsageError(
            "Nothing was stopped: no rig is configured.",
            "The motors of a running rig may be energised. Cut their supply by hand.",
            ONE_OF,
        )
    stopped = [_stopped(path, json) for path in meant]
    unknown = [rig for rig in stopped if rig["state"] == "unknown"]
    present(json, {"state": "unknown" if unknown else "disarmed", "rigs": stopped})
    return int(ExitCode.SAFETY) if unknown else 0


def _stopped(path: Path, json: bool) -> dict[str, Any]:
    """Disarm one rig; whatever fails, the next one is still stopped."""
    from drivers.errors import DriverError
    from drivers.teensy.driver import TeensyLogger
    from rig.bench.logger import open_logger
    from rig.configuration.config import load_config
    from rig.machines.choose import machine_of

    name, ending = str(path), None
    try:
        settings = announced(load_config(path))
        name = settings.name
        ending = _released(settings.logger.url)
        with TeensyLogger(open_logger(settings), machine_of(settings).profile) as logger:
            logger.disarm()
    except (DriverError, RigError) as error:
        screen = remarks()
        screen.print(f"{name}: UNKNOWN. Treat the motors as live. Cut the motor supply by hand.")
        why = f"{_ended(ending)} {error.what} {error.why}".strip()
        screen.print(f"  why: {why}\n  fix: {error.fix}")
        unknown = {"name": name, "config": path, "state": "unknown", "why": str(error)}
        return unknown | {"holder": ending}
    said = f"{name}: disarmed, confirmed by the rig. {_ended(ending)}"
    results(json).print(said.strip())
    return {"name": name, "config": path, "state": "disarmed", "holder": ending}


def _released(url: str) -> Ending | None:
    """Let the session that has the rig, if any, disarm and end."""
    from drivers.errors import PortBusyError
    from rig.bench.holding import holder, let_go

    try:
        return let_go(url)
    except PermissionError as error:
        raise PortBusyError(
            f"{url} is in use.",
            f"It is held by PID {holder(url)}, a session of another user.",
            "Ask that user to end it, or run this command as that user.",
        ) from error


def _ended(ending: Ending | None) -> str:
    if ending is None:
        return ""
    how = "did not end when asked and was killed" if ending.was_killed else "was asked to end"
    return f"The session that had the rig (PID {ending.pid}) {how}."


def clear(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> None:
    """Clear the rig's latched fault or trip; the motors stay out of force.

    Find the cause first. An EPOS4 drive is taken out of force, its communication is reset and set
    up again, and its fault is cleared. A logger board is disarmed, and the trip it reports is
    cleared by its code.
    """
    from rig.bench.clearing import clear_latch

    settings = chosen_rig(config, sim)
    latch = clear_latch(settings)
    text = "nothing is latched."
    if latch.code:
        text = f"cleared: {latch.what} (code {latch.code:#06x}) {latch.then}".rstrip()
    latched = {"what": latch.what, "code": latch.code} if latch.code else None
    data = {"state": "disarmed", "latched": latched, "cleared": True}
    present(json, data, f"{settings.name}: out of force; {text}")
