"""The configured devices, opened: the real ones by URL, their fakes behind `sim:`."""

from collections.abc import Callable, Iterator
from functools import partial

from drivers.device import Device
from drivers.teensy.device import TeensyDevice, raw_channels
from rig.bench.logger import DRIVE, SENSOR, open_logger, open_section
from rig.configuration.check import LOGGER
from rig.configuration.config import Config
from rig.machines.choose import machine_of

SIMULATED_STEP_S = 0.02
"""A simulated device delivers as often as a real one may; its silences are counted."""


def openers(config: Config) -> Iterator[tuple[str, Callable[[], Device]]]:
    """Yield name and a function that opens it, of the logger and of each further device."""
    sections = {LOGGER: config.logger, **config.devices}
    if config.logger.profile != SENSOR:
        del sections[LOGGER]
        yield LOGGER, partial(_open_board, config)
    for name, section in sections.items():
        yield name, partial(open_section, section)


def _open_board(config: Config) -> Device:
    counts = {line.counts for line in config.calibration_set().channels.values()}
    if config.logger.driver == "epos4" or config.logger.profile == DRIVE:
        counts -= {"current"}  # a drive that is switched off reports no current
    profile = machine_of(config).profile
    every = raw_channels(profile)
    wired = {field: channel for field, channel in every.items() if field in counts}
    return TeensyDevice(open_logger(config, step_s=SIMULATED_STEP_S), wired, profile)
