"""Clear what the rig has latched: a drive's fault, or the trip of a logger board.

A latch is cleared by a person's command, never on the way to something else: whoever clears it has
looked at the cause. The power stage stays off.
"""

from dataclasses import dataclass

from drivers.epos4.driver import Epos4
from drivers.epos4.faults import explain
from drivers.registry import made
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import Trip
from drivers.transport.can_bus import CanBus
from drivers.transport.python_can import open_can
from rig.bench.logger import open_logger
from rig.bench.trips import WORDS
from rig.configuration.config import Config
from rig.logic.latch import TripLatch
from rig.machines.choose import machine_of


@dataclass(frozen=True, slots=True)
class Latch:
    """What was latched, and what is left to do."""

    what: str  # the fault or trip in words; empty when nothing was latched
    code: int  # its code, 0 for none
    then: str  # what is left to do; may be empty


def clear_latch(config: Config) -> Latch:
    """Take the configured rig out of force and clear its fault or trip.

    Raises:
        DisarmUnconfirmedError: The rig has not confirmed that it is out of force.
        DriverError: It cannot be reached, or its fault stays.
    """
    return _clear_drive(config) if config.logger.driver == "epos4" else _clear_board(config)


def _clear_drive(config: Config) -> Latch:
    drive = made(_bus(config), lambda bus: Epos4(bus, **config.logger.options), "EPOS4")
    try:
        code = drive.clear_fault()
    finally:
        drive.close()
    found = [explain(code)[0]] if code else []
    latch = TripLatch(config.logger.url)
    trip = latch.code
    if trip:  # of the logic in this computer, which ends with its process
        latch.keep(0)
        found.append(WORDS[Trip(trip)][0])
    return Latch("; ".join(found), code or trip, "")


def _bus(config: Config) -> CanBus:
    if not config.is_simulated:
        return open_can(config.logger.url)
    from rig.canopen.simulated import open_simulated_bus

    return open_simulated_bus(config)


def _clear_board(config: Config) -> Latch:
    """Disarm a logger board, read its trip and clear that very one."""
    with TeensyLogger(open_logger(config), machine_of(config).profile) as logger:
        logger.identify()
        logger.disarm()
        report = logger.trip()
        logger.clear(int(report.code))
    if report.code is Trip.NONE:
        return Latch("", 0, "")
    what, fix = WORDS[report.code]
    return Latch(f"{what}.", int(report.code), fix)
