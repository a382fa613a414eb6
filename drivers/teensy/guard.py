"""What an armed board holds against every sample, and what a tick then gives the motors.

The twin of `firmware/core/guard.hpp` and of the middle of `Board::tick`: the same whole-number
operations in the same order, so that fake and firmware answer with the same bytes. Counts and
ticks throughout; what a limit means is said in `drivers.teensy.protocol.Limits`.
"""

from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import LIMIT, control_tick, new_state
from drivers.teensy.protocol import (
    LIMIT_NAMES,
    MISSING,
    STATUS_ARMED,
    STATUS_HOLDING,
    STATUS_LIMIT_TRIPPED,
    STATUS_WATCHDOG_TRIPPED,
    TICK_US,
    TRIP_SHIFT,
    Limits,
    SafeState,
    Trip,
)

(
    MOTOR,
    SPINDLE,
    JAW,
    PROXIMAL,
    DISTAL,
    CURRENT,
    FSR,
    COMMAND_E4,
    LOAD_MA,
    TARGET,
    STATUS,
) = range(11)
"""Columns of a tick's row: seven inputs, what the motors got, the target and the board's state."""
COLUMNS = 11

(
    STATE,
    ENGAGED,
    SILENT_US,
    PRIMED,
    LAST_MOTOR,
    FAST_TICKS,
    HEAT,
    HOT_TICKS,
    STALL_ANCHOR,
    STALL_TICKS,
    SATURATED_TICKS,
    HOLD_TARGET,
    TICKS,
    TRIP_CODE,
    TRIP_CHANNEL,
    TRIP_VALUE,
    TRIP_LIMIT,
    TRIP_LATE_US,
    TRIP_TICK,
) = range(19)
LAST_COUNT, SAME_TICKS = 19, 22
"""Places in the guard's state, shape (25,), int64."""

_AT = {name: place for place, name in enumerate(LIMIT_NAMES)}
MAX_CURRENT, MAX_PROXIMAL, MAX_DISTAL = (
    _AT["max_current"],
    _AT["max_proximal"],
    _AT["max_distal"],
)
MIN_SPINDLE, MAX_SPINDLE = _AT["min_spindle"], _AT["max_spindle"]
MIN_JAW, MAX_JAW = _AT["min_jaw"], _AT["max_jaw"]
MAX_MOTOR_STEP, CONTINUOUS, I2T = _AT["max_motor_step"], _AT["continuous_current"], _AT["i2t"]
STALL_CURRENT, STALL_MOTION = _AT["stall_current"], _AT["stall_motion"]
MAX_STALL, MAX_SATURATED, MAX_STALE = (
    _AT["stall_ticks"],
    _AT["saturated_ticks"],
    _AT["stale_ticks"],
)
WATCHDOG_US, SAFE_STATE, HOLD_COMMAND = (
    _AT["watchdog_us"],
    _AT["safe_state"],
    _AT["hold_command_e4"],
)
OVER_SPEED_TICKS = 3
NO_CHANNEL = 255
_NONE = int(Trip.NONE)
_HOST_SILENT = int(Trip.HOST_SILENT)
_OVER_CURRENT = int(Trip.OVER_CURRENT)
_PROXIMAL_TORQUE = int(Trip.PROXIMAL_TORQUE)
_DISTAL_TORQUE = int(Trip.DISTAL_TORQUE)
_SPINDLE_TRAVEL = int(Trip.SPINDLE_TRAVEL)
_JAW_TRAVEL = int(Trip.JAW_TRAVEL)
_OVER_SPEED = int(Trip.OVER_SPEED)
_OVERHEATED = int(Trip.OVERHEATED)
_STALLED = int(Trip.STALLED)
_SENSOR_SATURATED = int(Trip.SENSOR_SATURATED)
_SENSOR_STALE = int(Trip.SENSOR_STALE)
_SENSOR_MISSING = int(Trip.SENSOR_MISSING)
_HOLD = int(SafeState.HOLD)


def _whole_zeros() -> NDArray[np.int64]:
    return np.zeros(SAME_TICKS + 3, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """All that a tick of the board needs and changes, besides its inputs.

    Attributes:
        guard: State of the guard, see the places above, int64; changed in place.
        limits: `Limits.as_array`, int64.
        control_state: State of the controller, shape (4,); changed in place.
        gains: Gains of the controller, shape (5,); holding lowers its limit.
    """

    guard: NDArray[np.int64] = field(default_factory=_whole_zeros)
    limits: NDArray[np.int64] = field(default_factory=lambda: Limits.widest().as_array())
    control_state: NDArray[np.float64] = field(default_factory=new_state)
    gains: NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))

    @classmethod
    def armed(cls, gains: Any, limits: Limits | None = None, engaged: bool = True) -> "Drive":
        """Return a drive that was just armed; `engaged` where a setpoint has come already."""
        bounds = (limits or Limits.widest()).as_array()
        drive = cls(limits=bounds, gains=np.array(gains, np.float64))
        drive.guard[STATE] = STATUS_ARMED
        drive.guard[ENGAGED] = engaged
        return drive

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """Return guard, limits, controller and gains, as `drive_tick` takes them."""
        return self.guard, self.limits, self.control_state, self.gains


@numba.njit(cache=True)
def drive_tick(
    row: NDArray[np.int32],
    target: int,
    load_ma: int,
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do one tick behind the inputs in `row`: hold the limits, then command the motors.

    Args:
        row: One row of `COLUMNS` counts; the inputs are read, the rest is written.
        target: Target of the spindle, counts, followed when armed and engaged.
        load_ma: Current of the load motor, mA, likewise.
        guard: State of the guard.
        limits: Limits the board was armed with.
        control_state: State of the controller.
        gains: Gains of the controller.
    """
    if guard[STATE] & STATUS_ARMED and guard[SILENT_US] > 0:
        silent_us = guard[SILENT_US]
        _trip(
            guard,
            limits,
            gains,
            row,
            _HOST_SILENT,
            NO_CHANNEL,
            silent_us,
            limits[WATCHDOG_US],
            silent_us,
        )
    guard[SILENT_US] = 0
    if guard[STATE] & (STATUS_ARMED | STATUS_HOLDING):
        code, channel, value, limit, late_us = _check(guard, limits, row)
        if code != _NONE:
            _trip(guard, limits, gains, row, code, channel, value, limit, late_us)
    row[COMMAND_E4] = 0
    row[LOAD_MA] = 0
    row[TARGET] = row[SPINDLE]
    followed = target
    if guard[STATE] & STATUS_HOLDING:
        followed = guard[HOLD_TARGET]
    if guard[STATE] & STATUS_HOLDING or (guard[STATE] & STATUS_ARMED and guard[ENGAGED]):
        row[TARGET] = followed
        row[COMMAND_E4] = control_tick(control_state, gains, followed, row[SPINDLE], row[MOTOR])
        if guard[STATE] & STATUS_ARMED:
            row[LOAD_MA] = load_ma
    row[STATUS] = guard[STATE]
    guard[TICKS] += 1


@numba.njit(cache=True)
def _trip(guard, limits, gains, row, code, channel, value, limit, late_us):  # type: ignore[no-untyped-def]
    """Go to the safe state; the first cause stays."""
    holdable = code in (_HOST_SILENT, _STALLED, _SENSOR_SATURATED, _SENSOR_STALE)
    in_force = guard[STATE] & STATUS_ARMED and guard[ENGAGED]
    state = guard[STATE] & ~(STATUS_ARMED | STATUS_HOLDING)
    if guard[TRIP_CODE] == _NONE:
        guard[TRIP_CODE] = code
        guard[TRIP_CHANNEL] = channel
        guard[TRIP_VALUE] = value
        guard[TRIP_LIMIT] = limit
        guard[TRIP_LATE_US] = late_us
        guard[TRIP_TICK] = guard[TICKS]
        state |= code << TRIP_SHIFT
        state |= STATUS_WATCHDOG_TRIPPED if code == _HOST_SILENT else STATUS_LIMIT_TRIPPED
    if holdable and in_force and limits[SAFE_STATE] == _HOLD:
        state |= STATUS_HOLDING
        guard[HOLD_TARGET] = row[SPINDLE]
        gains[LIMIT] = min(gains[LIMIT], float(limits[HOLD_COMMAND]))
        guard[STALL_TICKS] = 0
        guard[SATURATED_TICKS] = 0
        for k in range(3):
            guard[SAME_TICKS + k] = 0
    guard[STATE] = state
    guard[ENGAGED] = 0


@numba.njit(cache=True)
def _check(guard, limits, row):  # type: ignore[no-untyped-def]
    """Return code, channel, value, limit and lateness of what is crossed, code 0 for nothing."""
    for channel in range(6):
        if row[channel] == MISSING:
            return _SENSOR_MISSING, channel, MISSING, 0, 0
    motor, current = np.int64(row[MOTOR]), np.int64(row[CURRENT])
    if not guard[PRIMED]:
        guard[PRIMED] = 1
        guard[LAST_MOTOR] = motor
        guard[STALL_ANCHOR] = motor
        for k in range(3):
            guard[LAST_COUNT + k] = row[PROXIMAL + k]
    if abs(current) > limits[MAX_CURRENT]:
        return _OVER_CURRENT, CURRENT, current, limits[MAX_CURRENT], 0
    proximal, distal = np.int64(row[PROXIMAL]), np.int64(row[DISTAL])
    if abs(proximal) > limits[MAX_PROXIMAL]:
        return _PROXIMAL_TORQUE, PROXIMAL, proximal, limits[MAX_PROXIMAL], 0
    if abs(distal) > limits[MAX_DISTAL]:
        return _DISTAL_TORQUE, DISTAL, distal, limits[MAX_DISTAL], 0
    spindle, jaw = np.int64(row[SPINDLE]), np.int64(row[JAW])
    if spindle < limits[MIN_SPINDLE]:
        return _SPINDLE_TRAVEL, SPINDLE, spindle, limits[MIN_SPINDLE], 0
    if spindle > limits[MAX_SPINDLE]:
        return _SPINDLE_TRAVEL, SPINDLE, spindle, limits[MAX_SPINDLE], 0
    if jaw < limits[MIN_JAW]:
        return _JAW_TRAVEL, JAW, jaw, limits[MIN_JAW], 0
    if jaw > limits[MAX_JAW]:
        return _JAW_TRAVEL, JAW, jaw, limits[MAX_JAW], 0
    # motion
    step = motor - guard[LAST_MOTOR]
    guard[LAST_MOTOR] = motor
    guard[FAST_TICKS] = guard[FAST_TICKS] + 1 if abs(step) > limits[MAX_MOTOR_STEP] else 0
    if guard[FAST_TICKS] >= OVER_SPEED_TICKS:
        late_us = (guard[FAST_TICKS] - 1) * TICK_US
        return _OVER_SPEED, MOTOR, step, limits[MAX_MOTOR_STEP], late_us
    heat = guard[HEAT] + current * current - limits[CONTINUOUS] * limits[CONTINUOUS]
    guard[HEAT] = max(heat, 0)
    guard[HOT_TICKS] = guard[HOT_TICKS] + 1 if guard[HEAT] > 0 else 0
    if guard[HEAT] > limits[I2T] * 1000:
        return _OVERHEATED, CURRENT, guard[HEAT] // 1000, limits[I2T], guard[HOT_TICKS] * TICK_US
    still = abs(motor - guard[STALL_ANCHOR]) <= limits[STALL_MOTION]
    if still and abs(current) >= limits[STALL_CURRENT]:
        guard[STALL_TICKS] += 1
    else:
        guard[STALL_ANCHOR] = motor
        guard[STALL_TICKS] = 0
    if guard[STALL_TICKS] >= limits[MAX_STALL]:
        return _STALLED, MOTOR, current, limits[STALL_CURRENT], guard[STALL_TICKS] * TICK_US
    # sensors
    saturated = NO_CHANNEL
    for channel in range(CURRENT, JAW, -1):
        if row[channel] <= -32768 or row[channel] >= 32767:
            saturated = channel
    guard[SATURATED_TICKS] = guard[SATURATED_TICKS] + 1 if saturated != NO_CHANNEL else 0
    if guard[SATURATED_TICKS] >= limits[MAX_SATURATED]:
        late_us = guard[SATURATED_TICKS] * TICK_US
        count = np.int64(row[saturated])
        return _SENSOR_SATURATED, saturated, count, limits[MAX_SATURATED], late_us
    for k in range(3):
        count = np.int64(row[PROXIMAL + k])
        same = guard[SAME_TICKS + k] + 1 if count == guard[LAST_COUNT + k] else 0
        guard[SAME_TICKS + k] = same
        guard[LAST_COUNT + k] = count
        if same >= limits[MAX_STALE]:
            return _SENSOR_STALE, PROXIMAL + k, count, limits[MAX_STALE], same * TICK_US
    return _NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def first_crossing(
    rows: NDArray[np.int32], guard: NDArray[np.int64], limits: NDArray[np.int64]
) -> tuple[int, int, int, int, int, int]:
    """Hold the limits against rows of inputs, for a host that repeats what the board does.

    Args:
        rows: Inputs as counts, shape (n, at least 6).
        guard: State of the guard, carried from call to call.
        limits: `Limits.as_array`.

    Returns:
        Row, code, channel, value, limit and lateness, us, of the first crossing; row n and code 0
        when there is none.
    """
    for k in range(len(rows)):
        code, channel, value, limit, late_us = _check(guard, limits, rows[k])
        if code != _NONE:
            return k, code, channel, value, limit, late_us
    return len(rows), _NONE, NO_CHANNEL, 0, 0, 0


@numba.njit(cache=True)
def run_ticks(
    rows: NDArray[np.int32],
    targets: NDArray[np.int32],
    loads_ma: NDArray[np.int32],
    guard: NDArray[np.int64],
    limits: NDArray[np.int64],
    control_state: NDArray[np.float64],
    gains: NDArray[np.float64],
) -> None:
    """Do a tick behind every row, for benches whose inputs do not follow the motors."""
    for k in range(len(rows)):
        drive_tick(rows[k], targets[k], loads_ma[k], guard, limits, control_state, gains)
