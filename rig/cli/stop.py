"""`rig stop`: take the motors out of force, and say so only once the board has confirmed it."""

from pathlib import Path
from typing import Any

from rig.cli.rig_options import ConfigOption, SimFlag, announced
from rig.output.console import JsonFlag, emit_json, remarks, results


def stop(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Disarm the rig and read back that it is disarmed; without options, every configured rig.

    Configured are RIG_CONFIG, ./rig.toml and all of ~/.config/rig/*.toml. Exit code 0 only when
    every rig itself has confirmed it; 4 when the state of one is unknown; 2 when none is
    configured.
    """
    from rig.configuration.chosen import ONE_OF, choose_config, configured_rigs
    from rig.configuration.config import load_config
    from rig.errors import ExitCode, UsageError

    if config is not None:
        load_config(config)  # a slip in what was typed is said before anything is tried
    meant = [choose_config(config, sim)] if config or sim else configured_rigs()
    if not meant:
        raise UsageError(
            "Nothing was stopped: no rig is configured.",
            "The motors of a rig that is running may be in force. Cut their supply by hand.",
            ONE_OF,
        )
    stopped = [_stopped(path, json) for path in meant]
    unknown = [rig for rig in stopped if rig["state"] == "unknown"]
    if json:
        state = "unknown" if unknown else "disarmed"
        emit_json({"state": state, "rigs": stopped})
    return int(ExitCode.SAFETY) if unknown else 0


def _stopped(path: Path, json: bool) -> dict[str, Any]:
    """Disarm one rig; whatever fails, the next one is still stopped."""
    from drivers.errors import DriverError
    from drivers.teensy.driver import TeensyLogger
    from rig.bench.logger import open_logger
    from rig.configuration.config import load_config
    from rig.errors import RigError
    from rig.machines.choose import machine_of

    name = str(path)
    try:
        settings = announced(load_config(path))
        name = settings.name
        with TeensyLogger(open_logger(settings), machine_of(settings).profile) as logger:
            logger.disarm()
    except (DriverError, RigError) as error:
        screen = remarks()
        screen.print(f"{name}: UNKNOWN. Treat the motors as live; cut their supply by hand.")
        for word, text in (("why", f"{error.what} {error.why}"), ("fix", error.fix)):
            screen.print(f"  {word}: {text}", markup=False)
        return {"name": name, "config": path, "state": "unknown", "why": str(error)}
    results(json).print(f"{name}: disarmed, confirmed by the rig.", markup=False)
    return {"name": name, "config": path, "state": "disarmed"}
