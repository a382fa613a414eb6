"""Open the logger a configuration names: the real one, or the simulated one behind `sim://`."""

from drivers.device import Drive
from drivers.registry import open_device, open_fake
from drivers.transport import Transport, open_transport
from rig.bench.sensor_logger import SensorWay
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.logic.latch import TripLatch
from rig.logic.link import LogicLink

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

    Args:
        config: The configuration.
        pace: Simulated seconds a real second, None for as fast as possible; a real logger has its
            own pace.
        step_s: Longest simulated time between looks at the logger's output; its own choice if None.

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

        return open_simulated_logger(
            config.simulation,
            config.logger.url,
            config.logger.profile,
            pace,
            config.safety.watchdog_s,
            step_s,
        )
    if config.logger.driver == "teensy-can":
        from drivers.teensy.can_device import open_can_transport

        return open_can_transport(config.logger.url, **config.logger.options)
    return open_transport(config.logger.url)


def _open_any(config: Config, pace: float | None) -> Transport:
    """Return the way to any device: a drive behind the board's logic, or a sensor alone.

    Raises:
        UsageError: The device has no motor, and the profile is a drive's.
    """
    section = config.logger
    if config.is_simulated:
        device = open_fake(section.driver)
    else:
        device = open_device(section.driver, section.url, **section.options)
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
        rate_hz = device.channels[0].rate_hz
        return LogicLink(
            device,
            section.url,
            rate_hz=rate_hz,
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
