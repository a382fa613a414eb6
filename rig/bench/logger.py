"""Open the logger a configuration names, or a device: the real one, or what is behind `sim:`."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from drivers.device import Device, Drive
from drivers.errors import DriverError
from drivers.registry import open_device, open_fake
from drivers.teensy.driver import SampleBatch, TeensyLogger
from drivers.transport import Transport, open_transport
from rig.bench.holding import holding
from rig.bench.sensor_logger import SensorWay, require_units
from rig.configuration.config import Config, is_simulated
from rig.configuration.sections import DeviceSection
from rig.errors import UsageError
from rig.logic.latch import TripLatch
from rig.logic.link import LogicLink
from rig.machines.choose import machine_of

PTY_URL = "sim://pty"
"""The firmware as a process, in real time."""
VIRTUAL_CAN_URL = "sim://virtual-can"
"""The fake of an EPOS4 on a virtual bus of python-can, in real time."""
DRIVE, SENSOR = "drive", "sensor"
"""Profiles in which any driver may stand where the logger does: with a motor, and without."""


def is_real_time(config: Config) -> bool:
    """Whether the logger samples by itself, as time passes."""
    if config.logger.profile == DRIVE:
        return False  # it is asked for each sample by the session itself
    return not config.is_simulated or config.logger.url in (PTY_URL, VIRTUAL_CAN_URL)


def open_logger(
    config: Config, pace: float | None = None, step_s: float | None = None
) -> Transport:
    """Return an open transport to the configured logger.

    A simulated logger runs at a pace of simulated seconds a real second, None for as fast as
    possible, and its output is looked at every `step_s` or sooner, None for its own choice.

    Raises:
        DriverError: The logger cannot be reached.
    """
    if config.logger.url == PTY_URL:
        from rig.simulation.firmware_process import FirmwareProcess

        return FirmwareProcess(config.logger.profile)
    if config.logger.profile in (DRIVE, SENSOR):
        return _open_any(config, pace)
    if config.logger.driver == "epos4":
        return _open_canopen_logger(config)
    if config.is_simulated:
        # the plant is compiled code that a session with a real rig does not need
        from rig.simulation.logger import open_simulated_logger

        return open_simulated_logger(config, pace, step_s)
    return open_transport(config.logger.url)


def open_section(section: DeviceSection) -> Device:
    """Open one configured device, or its driver's fake where its URL is `sim:`.

    Raises:
        DriverError: It cannot be opened.
    """
    if is_simulated(section.url):
        return open_fake(section.driver)
    return open_device(section.driver, section.url, **section.options)


@contextmanager
def held_logger(config: Config) -> Iterator[TeensyLogger]:
    """Hold the rig and open its logger without a session; it is disarmed on the way out.

    Raises:
        DriverError: It cannot be reached.
    """
    with (
        holding(config.logger.url),
        TeensyLogger(open_logger(config), machine_of(config).profile) as logger,
    ):
        yield logger


def read_for(logger: TeensyLogger, duration_s: float, is_alive: bool = False) -> SampleBatch:
    """Read a streaming board for a while by its clock; with `is_alive` it gets signs of life.

    Raises:
        DriverError: Nothing comes.
    """
    parts: list[SampleBatch] = []
    while not parts or parts[-1].tick_us[-1] - parts[0].tick_us[0] < duration_s * 1e6:
        if is_alive:
            logger.heartbeat()
        batch = logger.read(1.0)
        if not len(batch.samples):
            raise DriverError("The logger sends nothing.", fix="Run: rig doctor")
        parts.append(batch)
    return SampleBatch(
        np.concatenate([part.samples for part in parts]),
        np.concatenate([part.tick_us for part in parts]),
        parts[-1].lost,
    )


def _open_any(config: Config, pace: float | None) -> Transport:
    """Return the way to any device: a drive behind the board's logic, or a sensor alone."""
    section, device = config.logger, open_section(config.logger)
    paced = pace if config.is_simulated else None
    try:
        if section.profile == SENSOR:
            return SensorWay(device, section.url, config.is_simulated, paced)
        if not isinstance(device, Drive):
            raise UsageError(
                f"A {section.driver} has no motor.",
                'The configuration has [logger] profile = "drive".',
                'Write profile = "sensor".',
            )
        require_units(section.driver, device.channels)
        return LogicLink(
            device,
            section.url,
            is_cold=config.is_simulated,
            pace=paced,
            latch=None if config.is_simulated else TripLatch(section.url),
        )
    except BaseException:
        device.close()
        raise


def _open_canopen_logger(config: Config) -> Transport:
    """Return the link to a logger's logic on an EPOS4."""
    if config.is_simulated and config.logger.url != VIRTUAL_CAN_URL:
        from rig.canopen.simulated import open_simulated_canopen

        return open_simulated_canopen(config)
    from rig.canopen.process import CanopenProcess

    return CanopenProcess(config)
