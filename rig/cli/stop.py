"""`rig stop | clear`: disarm the motors, confirmed by the board; clear a latched fault or trip."""

from pathlib import Path
from typing import Any

from rig.bench.holding import Ending
from rig.cli.options import ConfigOption, SimFlag, announced, chosen_rig
from rig.errors import ExitCode, RigError, UsageError
from rig.output.console import JsonFlag, present, remarks, results


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


def clear(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
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
    return 0
