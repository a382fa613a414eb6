"""Limits of channels that only the opened devices name: one that does not exist is refused."""

from collections.abc import Collection, Sequence
from contextlib import closing

from calibration.linear import CalibrationSet
from estimation.errors import nearest
from rig.bench.companions import Companion
from rig.bench.device_logger import with_channels
from rig.bench.logger import DRIVE, open_section
from rig.configuration.check import LOGGER, Problem
from rig.configuration.config import Config, is_simulated
from rig.errors import UsageError


def refuse_unknown_limits(
    config: Config, calibrations: CalibrationSet, companions: Sequence[Companion]
) -> None:
    """Refuse a limit on a channel that the opened devices do not have (UsageError)."""
    known = {*calibrations.channels, *(name for one in companions for name in one.channels)}
    found = _unknown(config.limits.further, known)
    if found:
        raise UsageError(
            f"[limits] of {config.name} has a channel that no device has; nothing was armed.",
            " ".join(problem.what for problem in found),
            " ".join(problem.fix for problem in found),
        )


def limit_problems(config: Config) -> list[Problem]:
    """Return the limits on channels that do not exist, without opening a real device.

    The channels of a real device are known when it is opened; a session refuses its own then.
    """
    limits = config.limits.further
    owners = {name: name.partition(".")[0] if "." in name else LOGGER for name in limits}
    sections = {LOGGER: config.logger, **config.devices}
    known: set[str] = set()
    for owner in sorted(set(owners.values()) & set(sections)):
        if not is_simulated(sections[owner].url):
            known |= {name for name in limits if owners[name] == owner}
            continue
        with closing(open_section(sections[owner])) as device:
            device.identify()
            channels = device.channels
        if owner == LOGGER:
            is_drive = config.logger.profile == DRIVE
            known |= set(with_channels(config.calibration_set(), channels, is_drive).channels)
        else:
            known |= {f"{owner}.{channel.name}" for channel in channels}
    return _unknown(limits, known)


def _unknown(limits: Collection[str], known: Collection[str]) -> list[Problem]:
    return [
        Problem("limits", f"No device has the channel {name!r}.", nearest(name, sorted(known)))
        for name in sorted(set(limits) - set(known))
    ]
