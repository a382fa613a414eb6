"""The acceptance test of a bench: every device, and that the board really makes itself safe.

Nothing moves: the board is armed without a setpoint, so the motors stay without current throughout.
What that cannot show is left to a person, by the tests in `bench.toml`.
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from calibration.errors import CalibrationError
from calibration.zero import drift_verdicts, measure_zeros
from drivers.errors import CommandRefusedError, DriverError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.profile import ArmLimits
from drivers.teensy.protocol import STATUS_ARMED, TRIP_SHIFT, Trip
from rig.bench.devices import openers
from rig.bench.logger import held_logger, read_for
from rig.configuration.config import Config
from rig.doctor.finding import Level
from rig.doctor.stream import device_findings
from rig.machines.choose import machine_of

ZERO_S = 1.0
APART_S = 3.0
SETTLE_S = 0.2
LATEST_TRIP_S, LATEST_TRIP_SAMPLES = 0.002, 2
"""A board may trip so late, s; the logic of a slow drive, run once a sample, so many samples."""

BoardCheck = Callable[[TeensyLogger, Config], tuple[bool, str]]
"""Whether it passed, and the detail."""


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check; the detail is numbers, or what went wrong."""

    name: str
    passed: bool
    detail: str


@dataclass(frozen=True, slots=True)
class BenchTest:
    """One test for a person with a bench: why nothing else shows it, what to do, what it shows."""

    name: str
    why: str
    do: str
    shows: str


def bench_tests() -> list[BenchTest]:
    """Return the tests for a person, in the order in which they are made."""
    text = Path(__file__).with_name("bench.toml").read_text("utf-8")
    return [BenchTest(**test) for test in tomllib.loads(text)["tests"]]


def selftest(config: Config) -> Iterator[Check]:
    """Yield the checks of the acceptance test as they are made; motors may be powered."""
    for name, open_it in openers(config):
        findings = device_findings(name, open_it)
        bad = [f"{f.check}: {f.what}" for f in findings if f.level is not Level.OK]
        yield Check(f"{name} answers and streams", not bad, " ".join(bad) or findings[0].what)
    for name, check in BOARD_CHECKS.items():
        yield _on_the_board(name, check, config)


def _on_the_board(name: str, check: BoardCheck, config: Config) -> Check:
    try:
        with held_logger(config) as logger:
            logger.identify()
            logger.start()
            if logger.trip().code is not Trip.NONE:
                return Check(name, False, "The board has tripped before. Run: rig clear")
            passed, detail = check(logger, config)
            logger.disarm()
            logger.clear(int(logger.trip().code))  # what this self-test made it trip over
            logger.stop()
    except (DriverError, CalibrationError) as error:
        return Check(name, False, str(error))
    return Check(name, passed, detail)


def _zero_drift(logger: TeensyLogger, config: Config) -> tuple[bool, str]:
    calibrations = config.calibration_set()
    before = measure_zeros(read_for(logger, ZERO_S).samples, calibrations)
    read_for(logger, APART_S)
    after = measure_zeros(read_for(logger, ZERO_S).samples, calibrations)
    drifts = drift_verdicts(before, after, calibrations, config.drift_limits)
    detail = ", ".join(f"{d.channel} {d.after - d.before:+.2g} {d.unit}" for d in drifts)
    return all(d.passes for d in drifts), f"in {APART_S:g} s: {detail or 'no tared channel'}"


def _travel_limit(logger: TeensyLogger, config: Config) -> tuple[bool, str]:
    """Arm with a travel that ends before where the rig stands: the board must trip at once."""
    here = read_for(logger, SETTLE_S).samples[-1]
    limits, trip = machine_of(config).too_narrow(_limits(config), here)
    return _must_trip(logger, config, limits, trip, SETTLE_S)


def _setpoint_limit(logger: TeensyLogger, config: Config) -> tuple[bool, str]:
    machine, limits = machine_of(config), _limits(config)
    logger.arm(machine.gains(config), limits)
    try:
        logger.queue(*machine.beyond(limits))
    except CommandRefusedError as error:
        return True, error.what
    return False, "A setpoint beyond the travel was taken."


def _watchdog(logger: TeensyLogger, config: Config) -> tuple[bool, str]:
    """Arm and fall silent: the board must trip when its patience is over, not before, not late."""
    patience_s = config.safety.watchdog_s
    passed, detail = _must_trip(logger, config, _limits(config), Trip.HOST_SILENT, 2 * patience_s)
    late_s = logger.trip().late_us * 1e-6 - patience_s
    latest_s = max(LATEST_TRIP_S, LATEST_TRIP_SAMPLES / machine_of(config).profile.rate_hz)
    return passed and 0 <= late_s <= latest_s, f"{detail}, {late_s * 1e3:.3g} ms late"


def _stop(logger: TeensyLogger, config: Config) -> tuple[bool, str]:
    """Arm, disarm, and read back: what `rig stop` and every way out rely on."""
    logger.arm(machine_of(config).gains(config), _limits(config))
    logger.disarm()
    status = int(read_for(logger, SETTLE_S).samples["status"][-1])
    return not status & STATUS_ARMED, f"status {status:#06x} read back after disarming"


BOARD_CHECKS: dict[str, BoardCheck] = {
    "zeros stay where they are": _zero_drift,
    "the board trips at a travel limit": _travel_limit,
    "the board refuses a setpoint beyond the travel": _setpoint_limit,
    "the board goes to its safe state when the host is silent": _watchdog,
    "the board disarms and confirms it": _stop,
}
"""Checks on the logger alone, each on a fresh link."""


def _limits(config: Config) -> ArmLimits:
    """Return the configured limits, but none that a rig at rest may already be beyond."""
    machine = machine_of(config)
    return machine.untroubled(machine.board_limits(config, config.calibration_set()))


def _must_trip(
    logger: TeensyLogger, config: Config, limits: ArmLimits, trip: Trip, within_s: float
) -> tuple[bool, str]:
    logger.arm(machine_of(config).gains(config), limits)
    status = int(read_for(logger, within_s).samples["status"][-1])
    told = Trip(status >> TRIP_SHIFT)
    return told is trip, f"status {status:#06x}: {told.name.lower().replace('_', ' ')}"
