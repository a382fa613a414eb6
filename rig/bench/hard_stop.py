"""Find the zeros of a restarted board by driving gently against a mechanical stop.

The board moves without a reference only for this: with a command no larger than the one that holds,
whose limit the board itself bounds. The shaft is at the stop when it has turned and then stands
still with that current. The board then trips over the stall and releases the motor.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.errors import CommandRefusedError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import STATUS_ARMED, TOP, Trip
from drivers.teensy.reference import Limits
from rig.bench.logger import held_logger, read_for
from rig.bench.trips import WORDS
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.machines.choose import machine_of

SPEED_RAD_S = 0.2
STALL_S = 0.3
STALL_SHARE = 0.5
"""Share of the largest current behind which a shaft that stands still is at the stop."""
LEAST_TURN_RAD = 0.05
"""A shaft that turned less has not shown that it is free."""
BLOCK = 50
COLD_S = 2.0
"""Time before the first motion: what a board does not know to be cold it does not arm."""


class StopNotFoundError(UsageError):
    """The shaft came to no stop, or never turned."""


def drive_to_stop(config: Config, closing: bool) -> float:
    """Drive the spindle against its closed or open stop and release it there.

    The rig has one motor, which is powered, and no object in its jaw. Returns how far the spindle
    turned, rad, closing positive.

    Raises:
        UsageError: A rig of several motors, or one without a board.
        StopNotFoundError: The shaft never turned, came to no stop, or something else tripped.
        DriverError: The board cannot be reached, or refuses.
    """
    machine, calibrations = machine_of(config), config.calibration_set()
    limits = machine.board_limits(config, calibrations)
    if not isinstance(limits, Limits) or config.logger.driver == "epos4":
        raise UsageError(
            f"{config.name} is not referenced by a stop.",
            "That is for rigs with one motor on a logger board.",
            "Turn it by hand to its mark and run: rig reference",
        )
    slope = calibrations.channels["spindle_angle_rad"].slope
    reach = round(abs(2.0 * config.reference_limits.spindle_angle_rad / slope))
    step = SPEED_RAD_S * 1e-3 / slope * (1 if closing else -1)
    gains = [*config.controller.gains()[:4], float(limits.hold_command_e4)]
    with held_logger(config) as logger:
        logger.identify()
        logger.start()
        here = int(read_for(logger, COLD_S).samples["spindle"][-1])
        logger.arm(gains, _gentle(limits, here, reach))
        armed = _follow(logger, here, step, reach)
        logger.disarm()
        trip = logger.trip().code
        if trip is not Trip.NONE:
            logger.clear(int(trip))
        logger.stop()
    turned_rad = (int(armed["spindle"][-1]) - here) * slope if armed.size else 0.0
    if trip is not Trip.STALLED:
        what = WORDS[trip][0] if trip is not Trip.NONE else "It turned freely all the way"
        raise StopNotFoundError("The spindle came to no stop.", f"{what}.", "Run: rig doctor")
    if turned_rad * (1 if closing else -1) < LEAST_TURN_RAD:
        raise StopNotFoundError(
            "The spindle did not turn.",
            "It stands at the stop already, is blocked, or its friction is above the command.",
            "Turn it away from the stop by hand, or raise [safety] hold_command_ratio.",
        )
    return turned_rad


def _gentle(limits: Limits, here: int, reach: int) -> Limits:
    """Return limits that need no reference; what encoders say of one another is still held."""
    full = abs(limits.full_scale_current) or limits.max_current
    stalled = STALL_SHARE * full * limits.hold_command_e4 / 1e4
    return replace(
        limits,
        seek=1,
        min_spindle=here - reach,
        max_spindle=here + reach,
        min_jaw=-TOP - 1,
        max_jaw=TOP,
        max_beyond=TOP,
        max_load_ma=0,
        max_motor_step=max(1, limits.max_motor_step // 4),
        max_following=TOP,
        stall_current=round(stalled),
        stall_ticks=round(STALL_S * 1e3),
        safe_state=0,
    )


def _follow(logger: TeensyLogger, here: int, step: float, reach: int) -> NDArray[np.void]:
    """Queue a slow ramp until the board releases the motor; return the armed samples."""
    parts = []
    for first in range(0, int(reach / abs(step)) - BLOCK, BLOCK):
        ramp = here + np.round(step * np.arange(first, first + BLOCK)).astype(np.int64)
        try:
            logger.queue(ramp, np.zeros(BLOCK, np.int64))
        except CommandRefusedError:
            if logger.trip().code is Trip.NONE:
                raise
            break
        parts.append(read_for(logger, BLOCK * 1e-3).samples)
        if first and not (parts[-1]["status"][-1] & STATUS_ARMED):
            break
    samples = np.concatenate(parts)
    return np.asarray(samples[(samples["status"] & STATUS_ARMED) != 0])
