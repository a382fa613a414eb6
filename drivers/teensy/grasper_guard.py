"""The limit checks of the grasper's board on every sample, and the motor commands of a tick.

`check` and `drive` of `firmware/core/profile_grasper.hpp` in Python, as `drivers.teensy.guard` for
the reference rig.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import LIMIT, control_tick
from drivers.teensy.grasper import AXIS_LIMIT_NAMES, GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.logic import BoardLogic
from drivers.teensy.protocol import (
    GAIN_NAMES,
    MISSING,
    STATUS_ARMED,
    STATUS_HOLDING,
    TOP,
    Trip,
)
from drivers.teensy.watches import (
    BOARD_PLACES,
    ENGAGED,
    HOLD_COMMAND,
    LAST_COUNT,
    LAST_MOTOR,
    MAX_STALL,
    MOTOR_PLACES,
    NO_CHANNEL,
    NONE,
    PRIMED,
    SATURATED_TICKS,
    STALL_ANCHOR,
    STALL_TICKS,
    STATE,
    TICKS,
    judge_by_time,
    motor_crossing,
    note_trip,
    sensor_crossing,
    silence,
    untripped,
)

MOTORS = GRASPER.motors
MOTOR, CURRENT, FORCE, COMMAND_E4, TARGET = (MOTORS * part for part in range(5))
STATUS = 5 * MOTORS
COLUMNS = STATUS + 1
"""Columns of a tick's row, three of each: inputs, what the motors got, targets; the state last."""
INPUTS = 3 * MOTORS

HOLD_TARGET = BOARD_PLACES
MOTOR_WATCH = HOLD_TARGET + MOTORS
SENSOR_PLACES = 1 + 2 * MOTORS
CURRENT_WATCH = MOTOR_WATCH + MOTORS * MOTOR_PLACES
FORCE_WATCH = CURRENT_WATCH + SENSOR_PLACES
GUARD_PLACES = FORCE_WATCH + SENSOR_PLACES
"""Places in the guard's state, int64, behind those of every profile."""

AXIS_LIMITS = len(AXIS_LIMIT_NAMES)
MAX_CURRENT, MAX_FORCE, MIN_MOTOR, MAX_MOTOR, MOTOR_LIMITS = range(5)
"""Places in one motor's limits."""
FORCE_MAX = 4095
INT16_MIN, INT16_MAX = -(2**15), 2**15 - 1
TICK_US = GRASPER.tick_us
_OVER_CURRENT = int(Trip.OVER_CURRENT)
_OVER_FORCE = int(Trip.OVER_FORCE)
_MOTOR_TRAVEL = int(Trip.MOTOR_TRAVEL)
_SENSOR_MISSING = int(Trip.SENSOR_MISSING)


@dataclass(frozen=True, slots=True, eq=False)
class GrasperDrive:
    """All that a tick of the grasper's board needs and changes, besides its inputs.

    Attributes:
        guard: State of the guard, int64; changed in place.
        limits: `GrasperLimits.as_array`, int64.
        control_state: State of each controller, shape (3, 4); changed in place.
        gains: Gains of each controller, shape (3, 5); holding lowers their limits.
    """

    guard: NDArray[np.int64] = field(default_factory=lambda: untripped(GUARD_PLACES))
    limits: NDArray[np.int64] = field(default_factory=lambda: GrasperLimits().as_array())
    control_state: NDArray[np.float64] = field(default_factory=lambda: np.zeros((MOTORS, 4)))
    gains: NDArray[np.float64] = field(default_factory=lambda: np.zeros((MOTORS, len(GAIN_NAMES))))

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Return guard, limits, controllers and gains, as `grasper_tick` takes them."""
        return self.guard, self.limits, self.control_state, self.gains


@numba.njit(cache=True)
def grasper_tick(
    row: NDArray[np.int32],
    targets: NDArray[np.int32],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do one tick behind the inputs in `row`: hold the limits, then command the motors.

    Args:
        row: One row of `COLUMNS` counts; the inputs are read, the rest is written.
        targets: Target of each motor, counts, shape (3,), followed when armed and engaged.
        guard: State of the guard.
        limits: Limits the board was armed with.
        control_state: State of the controllers.
        gains: Gains of the controllers.
    """
    crossing = silence(guard, limits)
    if crossing[0] != NONE:
        _trip(guard, limits, gains, row, crossing)
    if guard[STATE] & (STATUS_ARMED | STATUS_HOLDING):
        crossing = _check(guard, limits, row)
        if crossing[0] != NONE:
            _trip(guard, limits, gains, row, crossing)
    holding = guard[STATE] & STATUS_HOLDING
    moving = holding or (guard[STATE] & STATUS_ARMED and guard[ENGAGED])
    for k in range(MOTORS):
        row[COMMAND_E4 + k] = 0
        row[TARGET + k] = row[MOTOR + k]
        if moving:
            followed = int(guard[HOLD_TARGET + k]) if holding else int(targets[k])
            row[TARGET + k] = followed
            motor = int(row[MOTOR + k])
            row[COMMAND_E4 + k] = control_tick(control_state[k], gains[k], followed, motor, motor)
    row[STATUS] = guard[STATE]
    guard[TICKS] += 1


@numba.njit(cache=True)
def _trip(guard, limits, gains, row, crossing):  # type: ignore[no-untyped-def]
    """Go to the safe state."""
    if note_trip(guard, limits, crossing):
        guard[CURRENT_WATCH + SATURATED_TICKS] = 0
        guard[FORCE_WATCH + SATURATED_TICKS] = 0
        for k in range(MOTORS):
            guard[HOLD_TARGET + k] = row[MOTOR + k]
            gains[k, LIMIT] = min(gains[k, LIMIT], float(limits[HOLD_COMMAND]))
            guard[MOTOR_WATCH + MOTOR_PLACES * k + STALL_TICKS] = 0
            guard[CURRENT_WATCH + LAST_COUNT + MOTORS + k] = 0
            guard[FORCE_WATCH + LAST_COUNT + MOTORS + k] = 0


@numba.njit(cache=True)
def _check(guard, limits, row):  # type: ignore[no-untyped-def]
    """Return code, channel, value, limit and lateness of what is crossed, code 0 for nothing."""
    for channel in range(INPUTS):
        if row[channel] == MISSING:
            return _SENSOR_MISSING, channel, MISSING, 0, 0
    if not guard[PRIMED]:
        _prime(guard, row)
    for k in range(MOTORS):
        axis = limits[AXIS_LIMITS * k : AXIS_LIMITS * (k + 1)]
        motor, current = np.int64(row[MOTOR + k]), np.int64(row[CURRENT + k])
        force = np.int64(row[FORCE + k])
        if abs(current) > axis[MAX_CURRENT]:
            return _OVER_CURRENT, CURRENT + k, current, axis[MAX_CURRENT], 0
        if force > axis[MAX_FORCE]:
            return _OVER_FORCE, FORCE + k, force, axis[MAX_FORCE], 0
        if motor < axis[MIN_MOTOR]:
            return _MOTOR_TRAVEL, MOTOR + k, motor, axis[MIN_MOTOR], 0
        if motor > axis[MAX_MOTOR]:
            return _MOTOR_TRAVEL, MOTOR + k, motor, axis[MAX_MOTOR], 0
    for k in range(MOTORS):
        place = MOTOR_WATCH + MOTOR_PLACES * k
        crossing = motor_crossing(
            guard[place : place + MOTOR_PLACES],
            limits[AXIS_LIMITS * k + MOTOR_LIMITS : AXIS_LIMITS * (k + 1)],
            limits[MAX_STALL],
            TICK_US,
            np.int64(row[MOTOR + k]),
            np.int64(row[CURRENT + k]),
            MOTOR + k,
            CURRENT + k,
        )
        if crossing[0] != NONE:
            return crossing
    currents, forces = row[CURRENT:FORCE], row[FORCE:COMMAND_E4]
    crossing = sensor_crossing(
        guard[CURRENT_WATCH:FORCE_WATCH],
        limits,
        TICK_US,
        currents,
        CURRENT,
        INT16_MIN,
        INT16_MAX,
    )
    if crossing[0] != NONE:
        return crossing
    return sensor_crossing(guard[FORCE_WATCH:], limits, TICK_US, forces, FORCE, MISSING, FORCE_MAX)


@numba.njit(cache=True)
def _prime(guard, row):  # type: ignore[no-untyped-def]
    """Begin every watch with the first counts."""
    guard[PRIMED] = 1
    for k in range(MOTORS):
        guard[MOTOR_WATCH + MOTOR_PLACES * k + LAST_MOTOR] = row[MOTOR + k]
        guard[MOTOR_WATCH + MOTOR_PLACES * k + STALL_ANCHOR] = row[MOTOR + k]
        guard[CURRENT_WATCH + LAST_COUNT + k] = row[CURRENT + k]
        guard[FORCE_WATCH + LAST_COUNT + k] = row[FORCE + k]


@numba.njit(cache=True)
def first_crossing(
    rows: NDArray[np.int32],
    ticks: NDArray[np.float64],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
) -> tuple[int, int, int, int, int, int]:
    """Check the limits on rows of inputs; see `drivers.teensy.guard.first_crossing`."""
    for k in range(len(rows)):
        for motor in range(MOTORS if guard[PRIMED] else 0):
            watch = guard[MOTOR_WATCH + MOTOR_PLACES * motor :]
            judge_by_time(watch, np.int64(rows[k, MOTOR + motor]), ticks[k])
        code, channel, value, limit, late_us = _check(guard, limits, rows[k])
        if code != NONE:
            return k, code, channel, value, limit, late_us
    return len(rows), NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def run_ticks(
    rows: NDArray[np.int32],
    targets: NDArray[np.int32],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do a tick behind every row, for benches whose inputs do not follow the motors.

    Targets are of shape (n, 3).
    """
    for k in range(len(rows)):
        grasper_tick(rows[k], targets[k], guard, limits, control_state, gains)


def _limits_of(wire: Sequence[int]) -> GrasperLimits:
    axes = [wire[AXIS_LIMITS * k : AXIS_LIMITS * (k + 1)] for k in range(MOTORS)]
    one, two, three = (AxisLimits(*axis) for axis in axes)
    return GrasperLimits((one, two, three), *wire[AXIS_LIMITS * MOTORS :])


def _armed(gains: NDArray[np.float64], limits: Sequence[int]) -> GrasperDrive:
    drive = GrasperDrive(limits=np.array(limits, np.int64), gains=gains.copy())
    drive.guard[STATE] = STATUS_ARMED
    return drive


def _allows(setpoints: NDArray[np.int64], limits: NDArray[np.int64]) -> bool:
    axes = limits[: AXIS_LIMITS * MOTORS].reshape(MOTORS, AXIS_LIMITS)
    low, high = axes[:, MIN_MOTOR], axes[:, MAX_MOTOR]
    return bool(((setpoints >= low) & (setpoints <= high)).all())


_PARTS = {
    "motor_{}": MOTOR,
    "current_{}": CURRENT,
    "force_{}": FORCE,
    "command_{}_e4": COMMAND_E4,
    "target_{}": TARGET,
}

GRASPER_LOGIC = BoardLogic(
    profile=GRASPER,
    idle=GrasperDrive,
    armed=_armed,
    limits_are_valid=lambda limits: _limits_of(limits).valid,
    allows=_allows,
    columns={
        name.format(k + 1): column + k for name, column in _PARTS.items() for k in range(MOTORS)
    },
    status_column=STATUS,
    converted={CURRENT + k: (INT16_MIN, INT16_MAX) for k in range(MOTORS)}
    | {FORCE + k: (-TOP - 1, FORCE_MAX) for k in range(MOTORS)},
)
"""What `drivers.teensy.fake.PythonBoard` does a tick on the grasper."""
