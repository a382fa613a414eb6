"""`rig stop`: take the motors out of force, and say so only once the board has said so."""

from rig.bench.holding import Ending
from rig.cli.doctor import ConfigOption
from rig.output.console import JsonFlag, emit_json, plain, remarks, results


def stop(config: ConfigOption = None, json: JsonFlag = False) -> int:
    """Disarm the rig and read back that it is disarmed.

    A session of this program that has the rig is first asked to disarm and end (SIGTERM), and is
    killed when it does not: the board then misses it and stops by itself. Programs of other makers
    are left alone and named. Exit code 0 only when the rig itself has said that it is disarmed; 4
    when its state is unknown: cut the motor supply.
    """
    from drivers.errors import DriverError
    from drivers.teensy.driver import TeensyLogger
    from rig.bench.logger import open_logger
    from rig.configuration.config import load_config
    from rig.errors import ExitCode
    from rig.machines.choose import machine_of

    settings = load_config(config)
    ending = None
    try:
        ending = _released(settings.logger.url)
        with TeensyLogger(open_logger(settings), machine_of(settings).profile) as logger:
            logger.disarm()
    except DriverError as error:
        screen = remarks()
        screen.print(f"{settings.name}: UNKNOWN. Take the motors for live.", markup=False)
        fix = f"Cut the motor supply. {error.fix}"
        for word, text in (("why", f"{_ended(ending)} {error.what} {error.why}"), ("fix", fix)):
            screen.print(f"  {word}: {text.strip()}", markup=False)
        if json:
            emit_json({"state": "unknown", "why": str(error), "holder": plain(ending)})
        return int(ExitCode.SAFETY)
    said = f"{settings.name}: disarmed, and it has said so. {_ended(ending)}"
    results(json).print(said.strip(), markup=False)
    if json:
        emit_json({"state": "disarmed", "holder": plain(ending)})
    return 0


def _released(url: str) -> Ending | None:
    """Let the session that has the rig, if any, disarm and end.

    Raises:
        PortBusyError: It is another user's.
    """
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
