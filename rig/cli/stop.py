"""`rig stop`: disarm the motors, and report it only after the board has confirmed it."""

from rig.cli.doctor import ConfigOption
from rig.output.console import JsonFlag, emit_json, remarks, results


def stop(config: ConfigOption = None, json: JsonFlag = False) -> int:
    """Disarm the rig and read back that it is disarmed.

    Exit code 0 only when the rig itself has confirmed it; 4 when its state is unknown.
    """
    from drivers.errors import DriverError
    from drivers.teensy.driver import TeensyLogger
    from rig.bench.logger import open_logger
    from rig.configuration.config import load_config
    from rig.errors import ExitCode
    from rig.machines.choose import machine_of

    settings = load_config(config)
    try:
        with TeensyLogger(open_logger(settings), machine_of(settings).profile) as logger:
            logger.disarm()
    except DriverError as error:
        screen = remarks()
        screen.print(f"{settings.name}: UNKNOWN. Take the motors for live.", markup=False)
        for word, text in (("why", f"{error.what} {error.why}"), ("fix", error.fix)):
            screen.print(f"  {word}: {text}", markup=False)
        if json:
            emit_json({"state": "unknown", "why": str(error)})
        return int(ExitCode.SAFETY)
    results(json).print(f"{settings.name}: disarmed, confirmed by the board.", markup=False)
    if json:
        emit_json({"state": "disarmed"})
    return 0
