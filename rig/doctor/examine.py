"""The whole examination: configuration, ports, every device, the firmware."""

from collections.abc import Iterator

from drivers.errors import DriverError
from drivers.registry import broken_drivers
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import Trip
from rig.bench.devices import openers
from rig.bench.limited import limit_problems
from rig.bench.logger import SENSOR, open_logger
from rig.bench.trips import WORDS
from rig.configuration.check import problems
from rig.configuration.config import Config
from rig.doctor.finding import Finding, Level
from rig.doctor.ports import port_findings, serial_ports
from rig.doctor.stream import device_findings
from rig.machines.choose import machine_of


def examine(config: Config) -> Iterator[Finding]:
    """Yield the findings on the rig of a configuration as they are made."""
    wrong = problems(config) or limit_problems(config)
    for problem in wrong:
        yield Finding("configuration", problem.key, Level.ERROR, problem.what, problem.fix)
    if not wrong:
        yield Finding("configuration", "sound", Level.OK, f"{config.name} is sound.")
    for driver, error in broken_drivers().items():
        yield Finding("drivers", driver, Level.WARNING, error.what, error.fix)
    yield from port_findings(serial_ports())
    if wrong:
        return  # it would be opened as it must not be
    for name, open_it in openers(config):
        yield from device_findings(name, open_it)
    if config.logger.driver != "epos4" and config.logger.profile != SENSOR:
        yield from _board_findings(config)


def _board_findings(config: Config) -> Iterator[Finding]:
    """Yield whether the logger board may be armed: its zeros, and what it tripped over."""
    try:
        with TeensyLogger(open_logger(config), machine_of(config).profile) as logger:
            identity = logger.identify()
            trip = logger.trip().code
    except DriverError:
        return  # reported with the device
    if not identity.referenced:
        what = (
            "The encoders have no zeros: the board was restarted, or a check of an encoder failed."
        )
        yield Finding("logger", "referenced", Level.WARNING, what, "Run: rig reference")
    if trip is not Trip.NONE:
        what, fix = WORDS[trip]
        yield Finding("logger", "tripped", Level.WARNING, f"{what}.", f"{fix} Then run: rig clear")
